"""The loops of the two motors' rig: operating points and vibration at the sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bywire.analysis.loop import LOOPS
from bywire.brakes.wedge.rigs.screw_rig import screws_compliance
from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError
from bywire.core.signals import zeros
from bywire.plant import force_sensor, roller_screw
from bywire.simulation.run import simulate
from raising import raises


@pytest.mark.parametrize("force", [0.0, 400.0, -250.0])
def test_the_rig_rests_at_its_force(force):
    loop = LOOPS.find("force-against")
    run = replace(loop.point(loop.smooth(parameters("roberts2003")), force).run(), duration=0.05)
    found = simulate(run, signals=("y_F", "F", "omega_1", "omega_2"))
    np.testing.assert_allclose(found["F"], force, atol=1e-6)
    np.testing.assert_allclose(found["y_F"], force, atol=1e-6)
    assert np.abs(found.values[:, 2:]).max() < 1e-9


def test_slowly_shaken_the_force_is_that_of_three_springs_in_a_row():
    """Both controllers and the line between them yield like springs."""
    loop, par = LOOPS.find("force-against"), parameters("roberts2003")
    k, own = roller_screw.slope(par.screw), loop.point(par, 0.0).par
    rest = zeros(force_sensor.Input)._replace(c=screws_compliance(own))
    line = force_sensor.stiffness(rest, own.rig.sensor) * k**2
    control = own.control.position
    motor = own.motor_1.K_ref * (2.0 * np.pi * control.f_n) ** 2 * control.J_hat / control.K_hat
    expected = 1.0 / (1.0 / line + 2.0 / motor) / k
    found = loop.closed(par, 0.0).response(np.zeros(1))[0, 0, 0]
    assert found.real == pytest.approx(expected, rel=1e-3)


def test_equal_motors_on_one_reference_press_nothing():
    loop = LOOPS.find("force-fight")
    f = np.array([2.0, 20.0, 100.0])
    fight = replace(loop, output="F").closed(parameters("roberts2003"), 0.0).response(f)
    alone = LOOPS.find("force-against").closed(parameters("roberts2003"), 0.0).response(f)
    assert np.abs(fight).max() < 1e-6 * np.abs(alone).max()
    other = parameters("roberts2003").replace({"motor_2.K_ref": 0.09})
    assert np.abs(replace(loop, output="F").closed(other, 0.0).response(f)).max() > 10.0


def test_a_force_beyond_the_drives_is_refused():
    with raises(ParameterError, name="force", valid="control.position.i_max"):
        LOOPS.find("force-fight").point(parameters("roberts2003"), 1e5)
