"""Residuals with which the wedge brake's real-time computer can detect a failure.

They count only while the demanded moment is steady, because during gap crossing and ramps all
residuals are large even without a fault.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from bywire.brakes.wedge.laws.moment_control import MOMENT
from bywire.brakes.wedge.model import WedgeBrake
from bywire.campaigns.residual import (
    NEVER,
    Residual,
    largest_of_the_last,
    least_of_the_last,
    mean_of_the_last,
)
from bywire.core.typing import Array

NAME = WedgeBrake.name
Signals = Mapping[str, Array]
_STEADY = 0.1  # s: length of the transient after a demand step
_AVERAGE = 10e-3  # s: averaging window for contacts and free play
_TURN = 0.1  # s: about one turn of the disc, whose runout affects the moment
_IN_MOMENT = 0.2  # s: length of the moment build-up


def _steady(signals: Signals, dt: float, values: Array) -> Array:
    """Return the mean of a residual while the demand is steady, otherwise none."""
    rows, M_set = round(_STEADY / dt), signals["M_set"]
    still = largest_of_the_last(M_set, rows) - least_of_the_last(M_set, rows) <= 0
    return np.where(still, mean_of_the_last(values, max(round(_AVERAGE / dt), 1)), NEVER)


def _moment(signals: Signals, par: Any, dt: float) -> Array:
    return _steady(signals, dt, np.abs(signals["M_set"] - signals["M_meas"]))


def _difference(signals: Signals, par: Any, dt: float) -> Array:
    """Return the difference between both demands, by which the motors work against each other."""
    return _steady(signals, dt, np.abs(signals["i_1_ref"] - signals["i_2_ref"]))


def _effort(signals: Signals, par: Any, dt: float) -> Array:
    return _steady(signals, dt, np.maximum(abs(signals["i_1_ref"]), abs(signals["i_2_ref"])))


def _in_moment(signals: Signals, dt: float, values: Array) -> Array:
    """Return a residual after some time under moment control, otherwise none."""
    rows, error = round(_IN_MOMENT / dt), np.abs(signals["mode"] - MOMENT)
    return np.where(largest_of_the_last(error, rows) < 0.5, values, NEVER)


def _stiffness(signals: Signals, par: Any, dt: float) -> Array:
    """Return the measured moment minus the moment from angle and assumed slope."""
    expected = par.control.moment.slope_hat * (np.abs(signals["theta_ref"]) - signals["theta_c"])
    off = mean_of_the_last(signals["M_meas"] - expected, round(_TURN / dt))
    return _in_moment(signals, dt, np.abs(off))


def _still(signals: Signals, par: Any, dt: float) -> Array:
    """Return the negative ripple of the moment over a turn, zero if the sensor is stuck."""
    rows, M = round(_TURN / dt), signals["M_meas"]
    return _in_moment(signals, dt, least_of_the_last(M, rows) - largest_of_the_last(M, rows))


RESIDUALS = (
    Residual(
        "moment-error",
        "demanded and measured moment",
        NAME,
        "N*m",
        ("M_set", "M_meas"),
        _moment,
        hold=10e-3,
    ),
    Residual(
        "moment-angle",
        "measured moment and moment from the angle",
        NAME,
        "N*m",
        ("M_meas", "theta_ref", "theta_c", "mode"),
        _stiffness,
        hold=10e-3,
    ),
    Residual(
        "still-moment",
        "ripple due to runout in the measured moment",
        NAME,
        "N*m",
        ("M_meas", "mode"),
        _still,
        hold=5e-3,
    ),
    Residual(
        "motor-difference",
        "demands of both motors",
        NAME,
        "A",
        ("i_1_ref", "i_2_ref", "M_set"),
        _difference,
        hold=5e-3,
    ),
    Residual(
        "effort",
        "the larger of the two motors' demands",
        NAME,
        "A",
        ("i_1_ref", "i_2_ref", "M_set"),
        _effort,
        hold=5e-3,
    ),
)
