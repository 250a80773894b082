"""Residuals that the motorcycle's ECU can compute from its sensors and demands.

The relations come from Dardanelli et al. (2010), eqs. (1), (4) and (8). The paper's rear brake has
no angle or stroke sensor. Residuals count only while the demand is steady. During a step, all
residuals are large even without a fault, so thresholds above them would not detect any fault.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.campaigns.residual import (
    NEVER,
    Residual,
    largest_of_the_last,
    least_of_the_last,
    mean_of_the_last,
)
from bywire.core.typing import Array

NAME = MotorcycleBrake.name
Signals = Mapping[str, Array]


_STEADY = 0.3  # s after which a demand step is over: several times the loop's rise time


def _period(par: Any, dt: float) -> int:
    """Return the number of rows in a dither period."""
    period: float = 1.0 / par.ecu.dither.f_dit
    return max(round(period / dt), 1)


def _steady(signals: Signals, dt: float, values: Array) -> Array:
    """Return a residual where the demand is steady, and `NEVER` elsewhere."""
    rows = round(_STEADY / dt)
    p = signals["p_ref"]
    still = largest_of_the_last(p, rows) - least_of_the_last(p, rows) <= 0
    return np.where(still, values, NEVER)


def _current(signals: Signals, par: Any, dt: float) -> Array:
    error = np.abs(signals["i_ref"] - signals["i_meas"])
    return _steady(signals, dt, mean_of_the_last(error, 5))


def _pressure(signals: Signals, par: Any, dt: float) -> Array:
    error = mean_of_the_last(signals["p_ref"] - signals["p_meas"], _period(par, dt))
    return _steady(signals, dt, np.abs(error))


def _winding(signals: Signals, par: Any, dt: float) -> Array:
    """Return the back-EMF, a measure of the speed: bridge voltage minus R_m i without dither."""
    back_emf = par.supply.V_bat * signals["duty"] - par.motor.R_m * signals["i_meas"]
    return _steady(signals, dt, np.abs(mean_of_the_last(back_emf, _period(par, dt))))


def _balance(signals: Signals, par: Any, dt: float) -> Array:
    """Return motor torque minus the pressure's load torque, averaged over the dither period."""
    torque = par.gear.eta_g * par.ecu.est_par.K_e * signals["i_meas"]
    load = par.gear.k_g * par.master_cylinder.A_mc * signals["p_meas"]
    return _steady(signals, dt, np.abs(mean_of_the_last(torque - load, _period(par, dt))))


def _still(signals: Signals, par: Any, dt: float) -> Array:
    """Return minus the pressure's range in two dither periods: zero for a stuck piston."""
    rows = 2 * _period(par, dt)
    p = signals["p_meas"]
    return _steady(signals, dt, least_of_the_last(p, rows) - largest_of_the_last(p, rows))


RESIDUALS = (
    Residual(
        "current-error",
        "demand and measured current",
        NAME,
        "A",
        ("i_ref", "i_meas", "p_ref"),
        _current,
        hold=5e-3,
    ),
    Residual(
        "pressure-error",
        "demand and measured pressure",
        NAME,
        "Pa",
        ("p_ref", "p_meas"),
        _pressure,
        hold=20e-3,
    ),
    Residual(
        "winding",
        "bridge voltage and resistive voltage",
        NAME,
        "V",
        ("duty", "i_meas", "p_ref"),
        _winding,
        hold=5e-3,
    ),
    Residual(
        "torque-balance",
        "motor torque and load torque from the pressure",
        NAME,
        "N*m",
        ("i_meas", "p_meas", "p_ref"),
        _balance,
        hold=20e-3,
    ),
    Residual(
        "still-pressure",
        "dither ripple in the measured pressure",
        NAME,
        "Pa",
        ("p_meas", "p_ref"),
        _still,
        hold=5e-3,
    ),
)
