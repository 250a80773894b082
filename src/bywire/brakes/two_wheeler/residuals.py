"""Residuals with which the two-wheeler's ECU can detect encoder and accelerometer failures.

If a wheel seems to lock, or the vehicle speed is physically impossible, the cause is either a short
slip that the controller ends, or a wrong reading.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from bywire.brakes.two_wheeler.model import TwoWheelerByWire
from bywire.brakes.two_wheeler.rigs.whole_rear import TwoWheelerWholeRear
from bywire.campaigns.residual import NEVER, Residual, mean_of_the_last
from bywire.core.typing import Array

VEHICLES = (TwoWheelerByWire.name, TwoWheelerWholeRear.name)
Signals = Mapping[str, Array]
_SPAN = 0.1  # s: comparison window of both speeds


def _fast(signals: Signals, par: Any, values: Array) -> Array:
    """Return a residual above the speed at which slip control fades out, otherwise none."""
    return np.where(signals["v_hat"] > par.ecu.front_slip.v_fall, values, NEVER)


def _slip(side: str) -> Callable[[Signals, Any, float], Array]:
    """Return the slip of a wheel, "f" or "r", as its residual, because control keeps it small."""

    def compute(signals: Signals, par: Any, dt: float) -> Array:
        return _fast(signals, par, np.abs(signals[f"slip_{side}_hat"]))

    return compute


def _speed(signals: Signals, par: Any, dt: float) -> Array:
    """Return the change in estimated speed minus the change measured by the accelerometer."""
    rows, v = round(_SPAN / dt), signals["v_hat"]
    lost = np.concatenate((np.broadcast_to(v[:, :1], (len(v), rows)), v[:, :-rows]), axis=1) - v
    shown = mean_of_the_last(signals["a_hat"], rows) * rows * dt
    return _fast(signals, par, np.abs(lost - shown))


RESIDUALS = (
    Residual(
        "slip-front",
        "front wheel slip, which the controller keeps small",
        VEHICLES,
        "1",
        ("slip_f_hat", "v_hat"),
        _slip("f"),
        hold=50e-3,
    ),
    Residual(
        "slip-rear",
        "rear wheel slip, which the controller keeps small",
        VEHICLES,
        "1",
        ("slip_r_hat", "v_hat"),
        _slip("r"),
        hold=50e-3,
    ),
    Residual(
        "speed",
        "wheel speeds and accelerometer reading",
        VEHICLES,
        "m/s",
        ("v_hat", "a_hat"),
        _speed,
        hold=5e-3,
    ),
)
