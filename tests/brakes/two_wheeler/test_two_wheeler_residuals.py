"""Residuals of the two-wheeler's ECU: slip of each wheel, speed against deceleration."""

from __future__ import annotations

import numpy as np
import pytest

from bywire.brakes.two_wheeler.residuals import RESIDUALS
from bywire.campaigns.residual import NEVER
from bywire.core.catalog import PARAMETER_SETS

DT = 1e-3
TIME = np.arange(0.0, 2.0, DT)
PAR = PARAMETER_SETS.find("sport600").parameters()


def judged(name, **signals):
    residual = next(each for each in RESIDUALS if each.name == name)
    assert set(residual.signals) == set(signals)
    rows = {each: np.broadcast_to(value, TIME.shape)[None] for each, value in signals.items()}
    return residual.lasted(rows, PAR, TIME)[0]


@pytest.mark.parametrize("side", ["f", "r"])
def test_a_wheel_that_seems_to_stand_is_seen_once_it_has_lasted(side):
    name = {"f": "slip-front", "r": "slip-rear"}[side]
    slip = np.where(TIME < 1.0, 0.1, 1.0)
    values = judged(name, v_hat=20.0, **{f"slip_{side}_hat": slip})
    assert (values[TIME < 1.045] == 0.1).all()
    assert (values[TIME > 1.055] == 1.0).all()


def test_a_speed_that_jumps_is_off_what_the_accelerometer_shows_by_its_jump():
    v = 30.0 - 8.0 * TIME
    assert judged("speed", v_hat=v, a_hat=8.0)[200:].max() == pytest.approx(0.0, abs=1e-9)
    jumped = judged("speed", v_hat=v + np.where(TIME < 1.0, 0.0, 3.0), a_hat=8.0)
    assert jumped[1050] == pytest.approx(3.0)
    assert jumped[-1] == pytest.approx(0.0, abs=1e-9)  # it compares changes


@pytest.mark.parametrize("name", ["slip-front", "slip-rear", "speed"])
def test_nothing_is_judged_where_wheels_may_lock(name):
    signals = next(each for each in RESIDUALS if each.name == name).signals
    slow = {each: 1.0 for each in signals} | {"v_hat": 0.9 * PAR.ecu.front_slip.v_fall}
    assert (judged(name, **slow) == NEVER).all()
