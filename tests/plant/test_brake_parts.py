"""Chambers, valves, accumulator, stiffening caliper and pedal simulator against closed forms."""

import math

import numpy as np
import pytest

from bywire.core.errors import ParameterError
from bywire.plant import (
    accumulator,
    brake_chamber,
    brake_fluid,
    pedal_simulator,
    relay_valve,
    stiffening_caliper,
)
from raising import raises
from systems import fluids

BAR = 1e5
FLUID = brake_fluid.Parameters.create(fluids.FLUID)
CHAMBER = {
    "V_0": 0.55e-3,
    "x_table": (0.0, 0.043, 0.064),
    "A_table": (0.014, 0.014, 0.009),
    "F_s0": 420.0,
    "k_s": 8e3,
    "G_leak": 0.0,
}
STORE = {"p_0": 1.5 * BAR, "k": BAR / 1e-6, "V_max": 3.5e-6, "c_stop": 4e-15}


def test_a_chamber_moves_at_the_pressure_of_its_spring():
    par = brake_chamber.Parameters.create(CHAMBER)
    assert brake_chamber.output(brake_chamber.Input(0.0, 0.0, 0.30 * BAR), par).F == 0.0


def test_the_volume_of_a_chamber_is_the_integral_of_its_area():
    par = brake_chamber.Parameters.create(CHAMBER)
    x = np.linspace(0.0, 0.07, 70001)
    A = np.interp(x, par.x_table, par.A_table)
    integral = par.V_0 + np.concatenate([[0.0], np.cumsum((A[1:] + A[:-1]) / 2 * np.diff(x))])
    for k in (0, 30000, 43000, 60000, 70000):
        q = brake_chamber.output(brake_chamber.Input(x[k], 0.1, 5 * BAR), par)
        assert pytest.approx(integral[k], rel=1e-9) == q.V
        assert q.V_rate == pytest.approx(0.1 * A[k])


@pytest.mark.parametrize(
    ("changes", "name"),
    [({"A_table": (0.014,)}, "A_table"), ({"x_table": (0.01, 0.043, 0.064)}, "x_table")],
)
def test_a_chamber_needs_a_curve(changes, name):
    with raises(ParameterError, name=name):
        brake_chamber.Parameters.create(CHAMBER | changes)


def test_a_relay_valve_holds_within_its_overlap_and_never_opens_both_seats():
    lag = {"law": "lag", "tau": 12e-3, "overlap": 0.05, "p_full": 0.5 * BAR}
    mechanical = {"a": 1.0, "p_crack": 0.1 * BAR, "p_fr": 0.04 * BAR}  # without effect
    par = relay_valve.Parameters.create(lag | mechanical)
    openings = [relay_valve.output(relay_valve.State(s), par) for s in np.linspace(-1, 1, 201)]
    assert all(out.feed * out.exhaust == 0.0 for out in openings)
    held = [out == (0.0, 0.0) for out in openings]
    assert sum(held) == pytest.approx(11, abs=1)
    assert openings[0].exhaust == openings[-1].feed == 1.0


def test_a_stiffening_caliper_absorbs_volume_and_energy():
    values = {"V_1": 0.35e-6, "p_1": 4 * BAR, "c": 0.011e-6 / BAR}
    par = stiffening_caliper.Parameters.create(values)
    V = stiffening_caliper.volume(stiffening_caliper.State(100 * BAR), par)
    assert pytest.approx(1.450e-6, rel=1e-4) == V
    stiff = FLUID.replace({"beta": 1e15})
    x = 100 / 4
    closed = par.V_1 * par.p_1 * (1 - math.exp(-x) * (1 + x)) + par.c * (100 * BAR) ** 2 / 2
    W = stiffening_caliper.energy(stiffening_caliper.State(100 * BAR), par, stiff)
    assert pytest.approx(closed, rel=1e-6) == W


def test_an_accumulator_stores_the_energy_of_its_spring():
    par, stiff = accumulator.Parameters.create(STORE), FLUID.replace({"beta": 1e15})
    W = accumulator.energy(accumulator.State(2e-6), par, stiff)
    assert pytest.approx(1.5 * BAR * 2e-6 + 0.5 * par.k * 4e-12, rel=1e-6) == W


def test_the_pressure_of_an_accumulator_is_never_below_vacuum():
    par = accumulator.Parameters.create(STORE)
    V = np.array([-1e-3, -1e-6, -1e-9, 0.0, 1e-6, 3.5e-6, 3.502e-6])
    p = np.array([accumulator.pressure(accumulator.State(v), par, FLUID) for v in V])
    assert np.all(p > -FLUID.p_atm)
    assert np.all(np.diff(p) > 0.0)
    assert p[3:] / BAR == pytest.approx([1.5, 2.5, 5.0, 10.002], rel=1e-6)
    gas = par.c_stop * (FLUID.p_atm + par.p_0)  # isothermal
    for v, each in zip(-V[:3], p[:3], strict=True):
        product = (each + FLUID.p_atm) * (gas + v)
        assert product == pytest.approx((FLUID.p_atm + par.p_0) * gas, rel=1e-4)


def test_an_accumulator_reports_that_it_is_full():
    par = accumulator.Parameters.create(STORE)
    t = np.array([0.0, 0.1, 0.2])
    texts = accumulator.watch(t, accumulator.State(np.array([1e-6, 3.6e-6, 2e-6])), par)
    assert len(texts) == 1
    assert "0.1 s" in texts[0]
    assert accumulator.watch(t, accumulator.State(np.full(3, 3.4e-6)), par) == []


@pytest.mark.parametrize(("x", "F", "W"), [(0.010, 200.0, 0.680), (0.014, 408.0, 1.896)])
def test_a_pedal_simulator_stiffens(x, F, W):
    values = {"k_1": 12e3, "k_2": 40e3, "x_1": 8e-3, "d_in": 200.0, "d_out": 400.0}
    par, u = pedal_simulator.Parameters.create(values), pedal_simulator.Input(x, 0.0)
    assert pedal_simulator.force(u, par) == pytest.approx(F)
    assert pedal_simulator.energy(u, par) == pytest.approx(W)
    moving = [pedal_simulator.force(u._replace(v=v), par) - F for v in (0.1, -0.1)]
    assert moving == pytest.approx([20.0, -40.0])
