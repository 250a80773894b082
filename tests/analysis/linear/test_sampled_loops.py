"""Linear models of the sampled loops against simulations that share nothing with them."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.signal import cont2discrete

from bywire.analysis.crossings import fall
from bywire.analysis.linear.sampled_loops import closed_loop
from bywire.analysis.loop import LOOPS
from bywire.analysis.response.frequency_response import frequency_response
from bywire.analysis.response.sweep import Sweep, complex_values
from bywire.bench.experiment import as_run
from bywire.brakes.motorcycle.case import case_from_rest
from bywire.brakes.motorcycle.linear import PressureLoop, cancelling_pi, current_loop, first_orders
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at
from bywire.control import current_pi, low_pass_2, pressure_pid
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import UnknownNameError
from bywire.core.signals import zeros
from bywire.simulation.run import simulate

MEDIUM = first_orders("medium", 10.2e5, (0.096,), (1.25, 7.15, 0.104))
FRICTIONLESS = {
    "seal.T_pr": 0.0,
    "seal.f_cfr_p": 0.0,
    "seal.f_cfr_n": 0.0,
    "seal.mu_T": 0.0,
    "ecu.dither.waveform": "off",
    "adc.law": "ideal",
}


def brake(**changes: Any) -> MotorcycleParameters:
    found = PARAMETER_SETS.find("dardanelli2010").parameters().replace(changes)
    assert isinstance(found, MotorcycleParameters)
    return found


@pytest.mark.parametrize("rotor", ["locked", "free"])
def test_current_loop_is_that_of_the_simulation(rotor: Any) -> None:
    """A small step of the set point, tick by tick."""
    lock = {"seal.T_pr": 10.0, "adc.law": "ideal"}
    par = brake(**(lock if rotor == "locked" else FRICTIONLESS))
    height, p = 0.01, 20e5
    hold = memory_at(p, par).i_source
    case = case_from_rest(
        "step", par, "current-direct", p, lambda t: {"i_set": hold + height * (t >= -1e-9)}, 0.05
    )
    run = simulate(as_run(case, 5e-6), signals=("i",))
    loop = current_loop(par, p, rotor)
    z, expected = np.zeros(len(loop.states)), []
    for _ in run.time:
        expected.append(float((loop.C @ z)[0] + loop.D[0, 0]))
        z = loop.A @ z + loop.B[:, 0]
    assert np.max(np.abs((run["i"] - hold) / height - expected)) < 2e-3
    assert max(expected) > 0.9


def test_closed_pressure_loop_is_that_of_sine_tests() -> None:
    """Without friction the nonlinear brake is nearly linear: one model checks the other."""
    own = brake(**FRICTIONLESS, **{"drive.mode": "pressure"})
    p = 20e5
    linear = closed_loop(
        MotorcycleBrake(),
        own,
        state_at(p, own),
        memory_at(p, own),
        inputs=("p_set",),
        outputs=("p_mc",),
    )
    sweep = Sweep(("p_set",), "p_mc", (0.5, 2.0, 10.0), (1e4,), flags=())
    found = frequency_response(LOOPS.find("pressure").point(own, p).run(), sweep)
    expected = linear.response(found["frequency"].values)[:, 0, 0]
    measured = complex_values(found.isel(variant=0, amplitude=0))
    np.testing.assert_allclose(measured, expected, rtol=2e-3)


def test_pressure_loop_is_that_of_a_simulation_of_its_chain() -> None:
    """Sine of 4 Hz through the laws on floats and a discretized motor, brake and filter."""
    par, f, count = brake(), 4.0, 4000
    T, ecu = par.ecu.T_s, par.ecu
    loop = PressureLoop(par, MEDIUM, p=25e5)
    drive = par.supply.V_bat - 2.0 * par.supply.R_bat * memory_at(25e5, par).duty * (
        memory_at(25e5, par).i_source
    )
    plant = _chain(par, drive, T)
    x = np.zeros(plant[0].shape[0])
    pid, pi, low = zeros(pressure_pid.State), zeros(current_pi.State), zeros(low_pass_2.State)
    demand, pressure = 1e3 * np.sin(2.0 * math.pi * f * T * np.arange(count)), np.zeros(count)
    for k in range(count):
        i_meas, pressure[k], p_meas = plant[2] @ x
        signals = pressure_pid.Input(p_ref=float(demand[k]), p_meas=float(p_meas))
        pid, wanted = pressure_pid.output(pid, signals, T, ecu.pressure)
        low, smooth = low_pass_2.output(low, wanted.i, T, ecu.filter)
        pi, out = current_pi.output(pi, current_pi.Input(smooth.y, float(i_meas)), T, ecu.current)
        x = plant[0] @ x + plant[1][:, 0] * out.duty
    last = slice(count - 1000, count)
    turning = np.exp(-2j * math.pi * f * T * np.arange(count)[last])
    got = np.mean(pressure[last] * turning) / np.mean(demand[last] * turning)
    assert got == pytest.approx(complex(loop.closed(np.array([f]))[0]), rel=1e-3)


def _chain(par: MotorcycleParameters, volts: float, T: float) -> tuple[Any, ...]:
    """Return the sampled chain from duty to measured current, pressure, measured pressure."""
    m, w = par.motor, 2.0 * math.pi * par.anti_alias.f_aa
    R = m.R_m + par.supply.R_bat * memory_at(25e5, par).duty ** 2
    s = np.array(MEDIUM.den) / MEDIUM.den[0]
    b = np.array([0.0, 0.0, *MEDIUM.num]) / MEDIUM.den[0]
    A, B, C = np.zeros((6, 6)), np.zeros((6, 1)), np.zeros((3, 6))
    A[0, 0], B[0, 0] = -R / m.L_m, volts / m.L_m  # current
    A[1, :2] = w, -w  # measured current
    A[2, 0], A[2, 2:5], A[3, 2], A[4, 3] = 1.0, -s[1:], 1.0, 1.0  # brake
    A[5, 2:5], A[5, 5] = w * b[1:], -w  # measured pressure
    C[0, 1], C[1, 2:5], C[2, 5] = 1.0, b[1:], 1.0
    return cont2discrete((A, B, C, np.zeros((3, 1))), T)[:3]


def test_pid_and_pi_have_their_known_margins() -> None:
    loop = PressureLoop(brake(), MEDIUM)
    pid = loop.margin()
    assert pid.crossover == pytest.approx(10.0, abs=0.2)
    assert pid.phase == pytest.approx(64.0, abs=1.0)
    pi = cancelling_pi(loop, 1.0 / (2.0 * math.pi * 1.25), 10.0).margin()
    assert pi.crossover == pytest.approx(10.0, rel=1e-6)
    assert pi.phase == pytest.approx(16.0, abs=1.0)


def test_fall_is_interpolated() -> None:
    f = np.array([0.25, 1.0, 4.5, 5.5, 30.0])
    assert fall(1.0 / np.abs(1.0 + 1j * f / 5.0), f) == pytest.approx(5.0, rel=0.01)
    assert fall(2.0 / f, f) == pytest.approx(2.0 * math.sqrt(2.0), rel=1e-12)
    assert fall(2.0 / f, f, start=8.0) == pytest.approx(2.0 / (8.0 * math.sqrt(0.5)), rel=1e-12)
    assert fall(np.ones(5), f) == math.inf
    assert fall(np.full(5, 0.5), f) == 0.0
    assert fall(np.array([1.0, 1.0, math.nan, math.nan, math.nan]), f) == 1.0, "it sticks"


def test_refusals() -> None:
    par = brake(**{"drive.mode": "pressure"})
    with pytest.raises(UnknownNameError, match="p_sett"):
        closed_loop(
            MotorcycleBrake(),
            par,
            state_at(20e5, par),
            memory_at(20e5, par),
            inputs=("p_sett",),
            outputs=("p_mc",),
        )
