"""Residuals with which the ECU can detect faults of plunger, brakes and valves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bywire.authoring import NEVER, Array, Residual

ASSEMBLIES = ("one-box", "one-box-corner")
_SETTLED = 0.2  # s after a change of the demand
Signals = Mapping[str, Array]


def _held(signals: Signals, dt: float, values: Array) -> Array:
    """Return a residual while the demand is constant, otherwise none."""
    p_ref, rows = signals["p_ref"], max(round(_SETTLED / dt), 1)
    before = np.concatenate((np.broadcast_to(p_ref[:, :1], (len(p_ref), rows)), p_ref), axis=1)
    is_held = np.abs(p_ref - before[:, : p_ref.shape[1]]) < 1.0
    return np.where(is_held & (p_ref > 0.0), values, NEVER)


def _pressure(signals: Signals, par: Any, dt: float) -> Array:
    """Return the error of the plunger pressure."""
    return _held(signals, dt, np.abs(signals["p_ref"] - signals["p_mc"]))


def _volume(signals: Signals, par: Any, dt: float) -> Array:
    """Return the volume that the plunger gave minus that of the assumed brakes."""
    law = par.ecu.pressure
    p, pads = np.maximum(signals["p_mc"], 0.0), law.brakes
    assumed = pads.V_1 * (1.0 - np.exp(-p / pads.p_1)) + pads.c * p
    given = law.A_hat * law.k_hat * (signals["theta"] - law.theta_rest)
    return _held(signals, dt, np.abs(given - assumed))


def _torque(signals: Signals, par: Any, dt: float) -> Array:
    """Return the motor torque minus that of the pressure."""
    law = par.ecu.pressure
    load = law.k_hat * law.A_hat * signals["p_mc"]
    return _held(signals, dt, np.abs(par.ecu.position.K_hat * signals["i"] - load))


def _slip(signals: Signals, par: Any, dt: float) -> Array:
    """Return the slip above the speed at which anti-lock control fades out, otherwise none."""
    is_fast = signals["v_hat"] > par.antilock.rules.v_fall
    return np.where(is_fast, np.abs(signals["slip_hat"]), NEVER)


RESIDUALS = (
    Residual(
        "wheel-slip",
        "slip of the wheel, which anti-lock control limits",
        "one-box-corner",
        "1",
        ("slip_hat", "v_hat"),
        _slip,
        hold=50e-3,
    ),
    Residual(
        "plunger-pressure",
        "pressure demand and measured pressure",
        ASSEMBLIES,
        "Pa",
        ("p_ref", "p_mc"),
        _pressure,
        hold=30e-3,
    ),
    Residual(
        "brake-volume",
        "volume of the plunger and of the assumed brakes at this pressure",
        ASSEMBLIES,
        "m**3",
        ("p_ref", "p_mc", "theta"),
        _volume,
        hold=30e-3,
    ),
    Residual(
        "plunger-torque",
        "motor torque and load of the plunger",
        ASSEMBLIES,
        "N*m",
        ("p_ref", "p_mc", "i"),
        _torque,
        hold=30e-3,
    ),
)
