"""The wedge brake at 20 us against an independent code: Runge-Kutta, Karnopp's friction.

Root mean squares of the wedge's position [nm], package at 20 us less reference without band:

    moment pulses 0.23, power-off hold 0.14, release 0.42, other direction 0.17, uneven motors
    0.18, screw friction by torque 0.14, driven disc 0.16, weak pads 0.93, beyond the neutral
    point 0.31, scheduled offset 2.7, disc stops 10.5 (pads dropped) and 0.16 (pads stick),
    runaway to the end stop 7.2

They fall with the square of the step, but for contacts that begin or end: the package does not
locate these within a substep. Where the pads' pull on the wedge drops out with the disc's
rotation, by 1.1 kN, the substep is cut.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from brakes.wedge.wedge_runs import IDEAL, TAN_ALPHA, brake, drive
from bywire.simulation.compiler import find_compiler
from cross.wedge_scenarios import COMPARED, SCENARIOS, Scenario, package, reference, rms, simulated

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")

NANOMETER, STEP = 1e-9, 20e-6
LIMITS = {
    "moment pulses": (0.3, 0.01),
    "power-off hold": (0.2, 0.01),
    "release": (0.6, 0.02),
    "other direction": (0.25, 0.01),
    "uneven motors": (0.25, 0.01),
    "screw friction by torque, driven disc": (0.2, 0.01),
    "weak pads": (1.2, 0.03),
    "beyond the neutral point": (0.4, 0.01),
    "scheduled offset": (4.0, 0.1),
    "disc stops, pads dropped": (12.0, 2.0),
    "disc stops, pads stick": (0.25, 0.01),
    "runaway to the end stop": (10.0, 0.6),
}
"""of the root mean squares of the position [nm] and of the heart's forces [N] at 20 us"""
SMOOTH = (
    "moment pulses",
    "power-off hold",
    "other direction",
    "uneven motors",
    "screw friction by torque, driven disc",
    "weak pads",
    "beyond the neutral point",
)
"""where no contact of the heart and no stop falls within a substep"""
RESTING = ("moment pulses", "power-off hold", "other direction", "uneven motors", "weak pads")


def compare(name: str, other: Mapping[str, NDArray[np.float64]], step: float = STEP) -> None:
    """Position within its limit, forces by as much as the position moves them, currents, speeds."""
    run, par = package(name, step), brake(mu_B=SCENARIOS[name].mu_B)
    finer = (step / STEP) ** 2
    x, f = LIMITS[name][0] * NANOMETER * finer, LIMITS[name][1] * finer
    F_N = par.caliper.K_cal * TAN_ALPHA * x
    hits_the_stop = name == "runaway to the end stop"
    limits = {
        "x": x,
        "F_N": F_N,
        "M_B": 2.0 * par.wedge.mu_B * par.caliper.r_B * F_N,
        "i_1": 5e-4,
        "omega_1": 1e-2 if hits_the_stop else 5e-4,
        "f_1": f,
        "f_2": f,
    }
    found = {signal: rms(run, other, signal) for signal in COMPARED}
    assert all(found[signal] < limits[signal] for signal in COMPARED), found


@pytest.mark.parametrize("name", SCENARIOS)
def test_agrees_at_20_us(name: str) -> None:
    compare(name, reference(name))


@pytest.mark.parametrize("name", SMOOTH)
def test_nears_the_reference_with_the_square_of_the_step(name: str) -> None:
    exact = reference(name)
    coarse, fine = (rms(package(name, step), exact, "x") for step in (STEP, STEP / 2.0))
    assert coarse / fine == pytest.approx(4.0, abs=0.15)


@pytest.mark.parametrize("name", RESTING)
def test_sticks_at_the_same_instants(name: str) -> None:
    run, other = package(name), reference(name)
    for speed in ("omega_1", "omega_2", "v"):
        sticks = other[speed] == 0.0
        assert 0 < np.count_nonzero(sticks) < sticks.size
        np.testing.assert_array_equal(run[speed] == 0.0, sticks)


def test_karnopp_converges_to_the_package_as_the_band_falls() -> None:
    """Position against the package at 5 us: 32, 8.0, 2.1, 0.53 nm, and 0.014 nm without band."""
    run = package("moment pulses", 5e-6)
    bands = (0.2, 0.1, 0.05, 0.025)
    found = [rms(run, reference("moment pulses", band), "x") for band in bands]
    for wide, narrow in pairwise(found):
        assert wide / narrow > 3.0
    assert rms(run, reference("moment pulses"), "x") < 0.05 * found[-1]


@pytest.mark.parametrize(
    ("name", "nanometers"),
    [
        ("moment pulses", 0.001),
        pytest.param("release", 0.1, marks=pytest.mark.trust),
    ],
)
def test_the_reference_is_converged(name: str, nanometers: float) -> None:
    coarse, fine = (reference(name, step=step) for step in (2e-6, 1e-6))
    assert rms(coarse, fine, "x") < nanometers * NANOMETER


def test_a_brake_without_power_rests() -> None:
    """Both codes come to rest: not a bit of travel changes in the last 100 ms."""
    for run in (package("power-off hold"), reference("power-off hold")):
        assert np.ptp(run["x"][-500:]) == 0.0
        assert run["M_B"][-1] == pytest.approx(500.0, abs=20.0)


def test_the_reference_refuses_what_it_does_not_know() -> None:
    with pytest.raises(ValueError, match="'quantized': the reference knows 'ideal' only"):
        simulated(Scenario(200.0, 200.0, 0.0, 0.01, changes={"encoder.law": "quantized"}))


MORE = [
    ("moment pulses", "bearing.T_nu", 20e-6),
    ("moment pulses", "bearing.G_S", 20e-6),
    ("moment pulses", "bearing.omega_S", 20e-6),
    ("moment pulses", "wedge_friction.mu_int", 20e-6),
    ("moment pulses", "wedge_friction.mu_R", 20e-6),
    ("moment pulses", "wedge.M_W", 20e-6),
    ("moment pulses", "screw.eta_f", 20e-6),
    ("moment pulses", "screw.eta_b", 20e-6),
    ("moment pulses", "caliper.K_cal", 20e-6),
    ("moment pulses", "caliper.tau_cal", 20e-6),
    ("moment pulses", "motor_2.T_cog", 20e-6),
    ("moment pulses", "flywheel.J_F", 20e-6),
    ("moment pulses", "bearing.C_2", 5e-6),
    ("moment pulses", "heart.tau_heart", 5e-6),
    ("moment pulses", "drive.f_sense", 5e-6),
    ("moment pulses", "motor_1.L_M", 5e-6),
    ("uneven motors", "bearing.C_1", 20e-6),
    ("uneven motors", "wedge.k_return", 20e-6),
    ("uneven motors", "drive.T_t", 20e-6),
    ("runaway to the end stop", "stop.k_stop", 20e-6),
]


@pytest.mark.parametrize(
    ("name", "parameter", "step"),
    [
        ("moment pulses", "bearing.C_0", 20e-6),
        ("moment pulses", "wedge.mu_B", 20e-6),
        ("moment pulses", "heart.K_W", 20e-6),
        ("uneven motors", "motor_1.dT", 20e-6),
        ("power-off hold", "drive.R_off", 20e-6),
        ("scheduled offset", "heart.g_12", 20e-6),
        *(pytest.param(*case, marks=pytest.mark.trust) for case in MORE),
    ],
)
def test_two_per_cent_of_a_parameter_show(name: str, parameter: str, step: float) -> None:
    values = brake(IDEAL | dict(SCENARIOS[name].changes), SCENARIOS[name].mu_B).leaves()
    fine = step / 10.0
    compare(name, reference(name, step=fine), step)
    wrong = ((parameter, 1.02 * values[parameter]),)
    with pytest.raises(AssertionError):
        compare(name, reference(name, step=fine, changes=wrong), step)


@pytest.mark.parametrize("mu_B", [0.2, 0.6])
def test_control_is_stable_on_both_sides_of_the_neutral_point(mu_B: float) -> None:
    """Without runout the brake comes to rest at the demand after both steps, in both codes.

    A crossover of 80 Hz instead of 8 Hz does not.
    """
    for f_c, rests in ((8.0, True), (80.0, False)):
        still = {"flywheel.runout": 0.0, "control.moment.f_c": f_c}
        s = Scenario(500.0, 300.0, 0.4, 0.8, mu_B=mu_B, changes=still)
        par = brake(IDEAL | still, mu_B)
        run = drive(par, s.duration, STEP, 2e-4, M_set=s.M_set, power_off=s.off)
        for found in (run["M_B"], simulated(s)["M_B"]):
            for end, demand in ((2000, 500.0), (found.size, 300.0)):
                tail = found[end - 250 : end]
                settled = np.ptp(tail) < 0.01 and abs(tail.mean() - demand) < 0.1
                assert settled == rests, (f_c, demand, tail.mean(), np.ptp(tail))
