"""Life of the caliper: any brake declares what wears of it."""

import numpy as np
import pytest

import bywire as toolkit


def test_the_clearance_grows_until_the_brake_is_too_slow():
    life = toolkit.project_life("caliper-pads", {"options.duration": "0.4 s"}).projection
    each = 174e3 * 3.6e-14 / 50e-4  # of both pads by a stop
    worn = life.states["clearance"] - life.states["clearance"][0]
    assert worn == pytest.approx(each * np.arange(life.stops + 1), rel=1e-9)
    assert life.ended_by == "time"
    # The pads cross the clearance at the largest speed of the motor.
    par = toolkit.parameters("emb42v")
    speed = par.ecu.force.omega_max * 0.0263e-3
    slower = np.diff(life.states["dead_time"][[1, -1]])[0]
    assert slower == pytest.approx(worn[-1] / speed, rel=0.05)
    assert life.states["dead_time"][-1] == pytest.approx(0.15, abs=0.002)
