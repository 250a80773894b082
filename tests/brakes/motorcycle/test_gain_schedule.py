"""The gain schedule of the pressure PID: continuous, bumpless, and constant at rest."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bywire.analysis.linear.sampled_loops import closed_loop
from bywire.analysis.loop import LOOPS
from bywire.bench.bench import Bench
from bywire.bench.running import run
from bywire.brakes.motorcycle import ecu as motorcycle_ecu
from bywire.brakes.motorcycle.linear import PressureLoop, first_orders
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.control import gain_schedule, pressure_pid
from bywire.core.catalog import parameters
from bywire.core.errors import ParameterError
from bywire.simulation.run import simulate
from raising import raises

REGIONS = {
    "ecu.schedule.law": "regions",
    "ecu.schedule.low.k_p": 2.2e-5,
    "ecu.schedule.low.k_i": 9e-5,
    "ecu.schedule.low.k_d": 5e-7,
    "ecu.schedule.high.k_p": 4e-6,
    "ecu.schedule.high.k_i": 3e-5,
    "ecu.schedule.high.k_d": 8e-8,
}
PRESSURES = (5e5, 9.4e5, 10e5, 20e5, 35.7e5)


def of(**changes: float) -> MotorcycleParameters:
    weights = {f"ecu.pressure.{name}": value for name, value in changes.items()}
    par = parameters("dardanelli2010").replace({**REGIONS, **weights})
    assert isinstance(par, MotorcycleParameters)
    return par


def frozen(par: MotorcycleParameters, p: float) -> MotorcycleParameters:
    own = par.ecu.pressure_at(p)
    gains = {f"ecu.pressure.{name}": getattr(own, name) for name in ("k_p", "k_i", "k_d")}
    return par.replace({**gains, "ecu.schedule.law": "off"})


def test_gains_are_continuous_and_constant_within_the_regions() -> None:
    par = of()
    schedule, medium = par.ecu.schedule, par.ecu.pressure
    p = np.linspace(0.0, 45e5, 9001)
    k_p = np.array([gain_schedule.output(one, medium, schedule).k_p for one in p])
    assert k_p[p <= 9e5] == pytest.approx(2.2e-5, rel=1e-12)
    assert k_p[(p >= 11e5) & (p <= 34e5)] == pytest.approx(medium.k_p, rel=1e-12)
    assert k_p[p >= 36e5] == pytest.approx(4e-6, rel=1e-12)
    at = gain_schedule.output(10e5, medium, schedule)
    assert at.k_i == pytest.approx(0.5 * (9e-5 + medium.k_i))
    assert at.k_d == pytest.approx(0.5 * (5e-7 + medium.k_d))
    steepest = (2.2e-5 - medium.k_p) / schedule.p_blend
    assert np.abs(np.diff(k_p)).max() == pytest.approx(steepest * (p[1] - p[0]))


@pytest.mark.parametrize("changes", [{"ecu.schedule.p_2": 11e5}, {"ecu.schedule.p_blend": 26e5}])
def test_blends_that_overlap_are_refused(changes: dict[str, float]) -> None:
    with raises(ParameterError, name="ecu.schedule.p_1", valid="<= p_2 - p_blend"):
        of().replace(changes)


def test_new_gains_at_a_constant_input_leave_the_demand_as_it_was() -> None:
    old = parameters("dardanelli2010-retuned").ecu.pressure  # type: ignore[attr-defined]
    new = old.replace({"k_p": 0.3 * old.k_p, "k_i": 0.2 * old.k_i, "k_d": 4.0 * old.k_d})
    state, u = pressure_pid.State(2.0, 0.3, 1e5), pressure_pid.Input(p_ref=25e5, p_meas=22e5)
    state, _ = pressure_pid.output(state, u, 1e-3, old)  # the input is constant from here on
    _, before = pressure_pid.output(state, u, 1e-3, old)
    taken = pressure_pid.transferred(state, u, old.k_p, new)
    _, after = pressure_pid.output(taken, u, 1e-3, new)
    _, bumped = pressure_pid.output(state, u, 1e-3, new)
    assert after.i == pytest.approx(before.i, rel=1e-14)
    assert before.i - bumped.i == pytest.approx(0.7 * old.k_p * 3e5)  # 4.3 A


def one_tick(par: MotorcycleParameters, p_before: float) -> float:
    """Return the demand of a tick at 10 bar after a different pressure at the last tick."""
    point = LOOPS.find("pressure").point(par, 10e5)
    memory: Any = point.memory
    share = (10e5 + par.ecu.p_atm) / (par.pressure_sensor.p_high - par.pressure_sensor.p_low)
    readings = motorcycle_ecu.Readings(p=share, i=0.5)
    stimulus: Any = point.stimulus
    own = par.replace({"adc.law": "ideal", "drive.mode": "pressure"})
    made = motorcycle_ecu.tick(
        readings,
        memory._replace(p_meas=p_before, pid_last=par.ecu.pressure.c * 14e5 - 10e5),
        stimulus._replace(p_set=14e5),
        own,
    )
    return made.i_star


def test_the_ecu_hands_over_from_the_gains_of_its_last_pressure() -> None:
    """Of two ticks with different previous pressures, one must compensate the change of gain."""
    par = of()
    k = [par.ecu.pressure_at(p).k_p for p in (9.5e5, 10e5)]
    difference = one_tick(par, 9.5e5) - one_tick(par, 10e5)
    assert difference == pytest.approx((k[0] - k[1]) * 4e5, rel=1e-9)
    off = par.replace({"ecu.schedule.law": "off"})
    assert one_tick(off, 9.5e5) == one_tick(off, 10e5)


@pytest.mark.parametrize("p", PRESSURES)
def test_small_motion_knows_the_frozen_gains_only(p: float) -> None:
    """Exactly: with b = 1 in every matrix, otherwise in every response."""
    loop = LOOPS.find("pressure")
    par = of(b=1.0)
    for make in (loop.gain, loop.closed):
        ours, theirs = make(par, p), make(frozen(par, p), p)
        # The pressure from the sensor differs from the set point by a rounding error: 1e-18.
        np.testing.assert_allclose(ours.A, theirs.A, rtol=1e-12, atol=1e-18)
        np.testing.assert_allclose(ours.B, theirs.B, rtol=1e-12, atol=1e-18)
    par = of(b=0.4)
    f = np.array([0.1, 1.0, 5.0, 20.0, 100.0])
    for make in (loop.gain, loop.closed):
        ours, theirs = make(par, p), make(frozen(par, p), p)
        np.testing.assert_allclose(ours.response(f), theirs.response(f), rtol=1e-9)


def test_without_the_transfer_small_motion_would_know_the_slope(monkeypatch: Any) -> None:
    """A test that can fail: the naive schedule has an additional loop within a transition."""
    monkeypatch.setattr(pressure_pid, "transferred", lambda x, u, k_p, par: x)
    par = of(b=0.4)
    loop = LOOPS.find("pressure")
    p, f = 10e5, np.array([1.0, 5.0])

    class Naive(MotorcycleBrake):
        """Another model: functions are cached by model and structure."""

        name = "naive"

    point = replace(loop.point(loop.smooth(par), p), model=Naive())
    made = closed_loop(
        point.model,
        point.par,
        point.state,
        point.memory,
        inputs=("p_set",),
        outputs=("p_mc",),
        stimulus=point.stimulus,
    )
    theirs = loop.closed(frozen(par, p), p)
    assert np.abs(made.response(f) / theirs.response(f) - 1.0).max() > 0.05


def test_laws_of_the_identified_loop_are_those_of_the_region() -> None:
    medium = first_orders("medium", 10.2e5, (0.096,), (1.25, 7.15, 0.104))
    par, f = of(), np.array([0.5, 3.0, 10.0])
    for p in (5e5, 20e5, 37e5):
        ours, theirs = PressureLoop(par, medium, p), PressureLoop(frozen(par, p), medium, p)
        np.testing.assert_allclose(ours.open(f), theirs.open(f), rtol=1e-12)
        np.testing.assert_allclose(ours.closed(f), theirs.closed(f), rtol=1e-12)
    low, high = PressureLoop(par, medium, 5e5), PressureLoop(par, medium, 37e5)
    assert np.abs(low.open(f) / high.open(f)).max() > 2.0


def test_a_schedule_of_equal_gains_is_none() -> None:
    """The complete nonlinear braking from 6 to 37 bar, with dither and converter."""
    bench = Bench("hard-braking", "dardanelli2010-retuned")
    off = run(bench).recordings["run"]
    on = run(bench.with_overrides({"ecu.schedule.law": "regions"})).recordings["run"]
    np.testing.assert_allclose(on["p_mc"], off["p_mc"], rtol=1e-9)


@pytest.mark.parametrize("p", [5e5, 10e5, 36e5])
def test_the_equilibrium_of_a_scheduled_loop_rests(p: float) -> None:
    loop = LOOPS.find("pressure")
    own = loop.smooth(of(b=0.7))
    found = simulate(replace(loop.point(own, p).run(), duration=0.2))
    np.testing.assert_allclose(found["p_mc"], p, rtol=1e-6)
