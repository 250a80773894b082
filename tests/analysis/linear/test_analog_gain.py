"""Loop gain of the drives' analog current control, against its closed form and its closed loop."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bywire.analysis.linear.sampled_loops import analog_gain
from bywire.analysis.loop import LOOPS
from bywire.analysis.loop_figures import LoopFigures
from bywire.analysis.margins import margins
from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError, UnknownNameError

LOOP = LOOPS.find("drive-current")
PAR = parameters("roberts2003")


def test_it_is_the_closed_form_of_pi_winding_and_filter() -> None:
    f = np.geomspace(1.0, 1e4, 50)
    s = 2j * math.pi * f
    drive, motor = PAR.drive, PAR.motor_1
    pi = drive.V_dc * (drive.k_p + drive.k_i / s)
    sensor = drive.G_sense / (1.0 + 1j * f / drive.f_sense)
    expected = pi / (motor.R_ref * (1.0 + motor.a_R * motor.dT) + motor.L_M * s) * sensor
    gain = LOOP.gain(PAR, 5.0)
    assert gain.period == 0.0
    np.testing.assert_allclose(gain.response(f)[:, 0, 0], expected, rtol=1e-10)


def test_gain_and_closed_loop_belong_together() -> None:
    """From the demand: its filter, then L/(1 + L) before the sensor; held for a sample."""
    f = np.geomspace(10.0, 3e3, 30)
    L = LOOP.gain(PAR, 0.0).response(f)[:, 0, 0]
    drive = PAR.drive
    sensor = drive.G_sense / (1.0 + 1j * f / drive.f_sense)
    closed = L / (1.0 + L) / sensor / (1.0 + 1j * f / drive.f_demand)
    found = LOOP.closed(PAR, 0.0)
    hold = np.sinc(f * found.period) * np.exp(-1j * math.pi * f * found.period)
    # Images at the sampling frequency are left of it: some 1e-4.
    np.testing.assert_allclose(found.response(f)[:, 0, 0], closed * hold, rtol=2e-3)


def test_margins_of_a_continuous_gain_are_those_of_the_gain_sampled_quickly() -> None:
    found = margins(LOOP, PAR, 0.0)
    fine = LOOP.gain(PAR, 0.0).sampled(2e-7)
    figures = LoopFigures(fine, LOOP.closed(PAR, 0.0), 4000)
    assert found.stable
    assert found.crossover == pytest.approx(figures.crossover, rel=1e-3)
    assert found.phase == pytest.approx(figures.phase_margin, abs=0.1)
    assert found.gain == math.inf  # two poles and a zero never turn by 180 degrees
    exact = LoopFigures(LOOP.gain(PAR, 0.0), LOOP.closed(PAR, 0.0), 4000)
    assert exact.gain_margin == math.inf
    assert exact.phase_margin == pytest.approx(found.phase, abs=0.05)


def test_points_that_do_not_exist() -> None:
    for value, change, name in (
        (25.0, {}, r"drive\.i_max"),
        (15.0, {"drive.V_dc": 5.0}, r"drive\.V_dc"),
        (-15.0, {"rig.T_clamp": 1.0}, r"rig\.T_clamp"),
    ):
        with pytest.raises(ParameterError, match=name):
            LOOP.point(PAR.replace(change), value)


def test_states_that_cannot_be_cut() -> None:
    p = LOOP.point(PAR, 0.0)
    with pytest.raises(UnknownNameError, match="sensed_1"):
        analog_gain(p.model, p.par, p.state, p.memory, cut="sensed")
    with pytest.raises(ParameterError, match="nothing in shaft-rig reads it"):
        analog_gain(p.model, p.par, p.state, p.memory, cut="theta_1", locked=("omega_1",))
