"""A switched valve for brake fluid: delay, lag, area of the cone and faults."""

import math

import numpy as np
import pytest

from bywire.core.errors import BywireError
from bywire.plant import brake_fluid, orifice, solenoid_valve
from systems import fluids

BAR, H = 1e5, 20e-6
FLUID = brake_fluid.Parameters.create(fluids.STIFF)
VALUES = {
    "seat.d": 0.5e-3,
    "seat.C_d": 0.65,
    "seat.Re_cr": 100.0,
    "lift": 0.2e-3,
    "alpha": math.pi / 4,
    "t_delay": 1e-3,
    "tau": 1e-3,
    "unpowered": "open",
    "low": 0.0,
    "high": 1.0,
}


def valve(**changes: float | str) -> solenoid_valve.Parameters:
    return solenoid_valve.Parameters.create({**VALUES, **changes})


def lifts(par: solenoid_valve.Parameters, on: float, x: float, duration: float) -> float:
    """Return the lift after a time under one command, integrated with the midpoint rule."""
    u = solenoid_valve.Input(on, 0.0, 0.0)
    for _ in range(round(duration / H)):
        first = solenoid_valve.balance(solenoid_valve.State(x), u, par) / par.tau
        middle = solenoid_valve.State(x + 0.5 * H * first)
        x += H * solenoid_valve.balance(middle, u, par) / par.tau
    return x


@pytest.mark.parametrize(("T", "ticks"), [(1e-3, 1), (0.5e-3, 2), (0.4e-3, 3), (2e-3, 1)])
def test_a_command_acts_after_the_delay_in_whole_samples(T, ticks):
    par, coil, seen = valve(), solenoid_valve.Coil(0.0, 0.0), []
    for command in [0.0, *[1.0] * 9]:
        coil = solenoid_valve.delayed(coil, command, T, par)
        seen.append(coil.on)
    assert seen.index(1.0) - 1 == ticks
    assert all(seen[1 + ticks :])


def test_without_a_delay_a_command_acts_at_once():
    coil = solenoid_valve.delayed(solenoid_valve.Coil(0.0, 0.0), 1.0, 1e-3, valve(t_delay=0.0))
    assert coil == (1.0, 0.0)


def test_a_pulse_shorter_than_the_delay_does_not_move_the_armature():
    par, coil = valve(), solenoid_valve.Coil(0.0, 0.0)
    for command in (1.0, 0.0, 0.0, 1.0, 0.0):
        coil = solenoid_valve.delayed(coil, command, 1e-3, par)
        assert coil.on == 0.0
    assert coil.waiting == 0.0


def test_the_armature_follows_with_its_lag():
    par = valve()
    assert lifts(par, 1.0, par.lift, 1e-3) == pytest.approx(par.lift * math.exp(-1.0), rel=1e-4)
    closed = valve(unpowered="closed")
    expected = closed.lift * (1.0 - math.exp(-1.0))
    assert lifts(closed, 1.0, 0.0, 1e-3) == pytest.approx(expected, rel=1e-4)


def test_the_cone_limits_the_area_until_the_orifice_does():
    par = valve()
    kink = par.seat.d / (4.0 * math.sin(par.alpha))
    shares = [
        solenoid_valve.opening(solenoid_valve.State(x), par)
        for x in (0.0, 0.5 * kink, kink, par.lift)
    ]
    assert kink < par.lift
    assert shares == pytest.approx([0.0, 0.5, 1.0, 1.0])
    u = solenoid_valve.Input(0.0, 100 * BAR, 0.0)
    through = solenoid_valve.flow(solenoid_valve.State(par.lift), u, par, FLUID)
    assert through == orifice.flow(orifice.Input(100 * BAR, 0.0, 1.0), par.seat, FLUID)
    assert solenoid_valve.flow(solenoid_valve.State(0.0), u, par, FLUID) == 0.0


def test_every_fault_changes_the_flow_of_one_position():
    faults = {fault.name: fault for fault in solenoid_valve.FAULTS}
    stuck = valve(**{faults["stuck-open"].replaced: faults["stuck-open"].value})
    assert lifts(stuck, 1.0, stuck.lift, 20e-3) == pytest.approx(stuck.lift)
    closed = valve(**{faults["stuck-closed"].replaced: faults["stuck-closed"].value})
    assert lifts(closed, 0.0, 0.0, 20e-3) == 0.0
    dirty = valve(**{faults["leaking"].replaced: faults["leaking"].value})
    left = lifts(dirty, 1.0, dirty.lift, 40e-3)
    assert left == pytest.approx(0.02 * dirty.lift, rel=1e-6)
    assert np.isclose(
        solenoid_valve.opening(solenoid_valve.State(left), dirty), 0.02 * 1.1314, 1e-3
    )


def test_a_valve_must_not_be_more_open_when_it_is_closed():
    with pytest.raises(BywireError, match="low"):
        valve(low=0.5, high=0.4)
    with pytest.raises(BywireError, match="seat"):
        valve(**{"seat.d": 0.0})
