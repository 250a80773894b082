"""Residuals of the moment sensor, from the angle and from the ripple of the disc's runout."""

from __future__ import annotations

import numpy as np
import pytest

from bywire.brakes.wedge.laws.moment_control import MOMENT
from bywire.brakes.wedge.residuals import RESIDUALS
from bywire.campaigns.residual import NEVER
from bywire.core.catalog import PARAMETER_SETS

DT = 1e-3
TIME = np.arange(0.0, 1.5, DT)
PAR = PARAMETER_SETS.find("roberts2003").parameters()


def held(M_meas, M_true=200.0, mode=MOMENT):
    """Return the signals of a held moment [N m], as the controller sees it and as it is."""
    slope = PAR.control.moment.slope_hat
    return {
        "M_meas": np.broadcast_to(M_meas, TIME.shape)[None],
        "theta_ref": np.broadcast_to(-(1.2 + M_true / slope), TIME.shape)[None],  # either way
        "theta_c": np.full((1, TIME.size), 1.2),
        "mode": np.broadcast_to(mode, TIME.shape)[None],
    }


def judged(name, signals):
    residual = next(each for each in RESIDUALS if each.name == name)
    return residual.compute(signals, PAR, DT)[0]


def test_a_sensor_that_drifts_is_off_the_moment_of_the_angle_by_its_drift():
    """The loop keeps the reading, so that the angle loses what the sensor shows too much."""
    values = judged("moment-angle", held(200.0, 200.0 - 50.0 * TIME))
    assert values[-1] == pytest.approx(50.0 * (TIME[-1] - 0.05), rel=0.01)  # mean of a turn
    assert judged("moment-angle", held(200.0))[-1] == pytest.approx(0.0, abs=1e-9)


def test_a_sensor_that_is_stuck_has_no_ripple():
    ripple = 28.0 * np.sin(2.0 * np.pi * 10.0 * TIME)
    stuck = np.where(TIME < 0.8, ripple, 28.0)
    values = judged("still-moment", held(200.0 + stuck))
    assert values[700] == pytest.approx(-56.0, rel=0.01)
    assert values[-1] == 0.0


@pytest.mark.parametrize("name", ["moment-angle", "still-moment"])
def test_a_moment_that_builds_up_is_not_judged(name):
    mode = np.where(TIME < 0.5, 1.0, MOMENT)
    values = judged(name, held(200.0, mode=mode))
    assert (values[TIME < 0.65] == NEVER).all()
    assert (values[TIME > 0.75] != NEVER).all()
