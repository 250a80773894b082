"""Orifices and check valves against closed forms."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bywire.core.errors import ParameterError
from bywire.plant import brake_fluid, check_valve, orifice
from raising import raises
from systems import fluids

BAR = 1e5
LINE = 0.011e-6 / BAR  # linear compliance of a caliper, 0.011 cm^3/bar
FLUID = brake_fluid.Parameters.create(fluids.STIFF)


def valve(d: float) -> orifice.Parameters:
    return orifice.Parameters.create({"d": d, "C_d": 0.65, "Re_cr": 100.0})


def flow(p_a: float, p_b: float, d: float = 0.5e-3) -> float:
    return orifice.flow(orifice.Input(p_a, p_b, 1.0), valve(d), FLUID)


def time_between(start: float, end: float, p_far: float, d: float) -> float:
    """Return the time in which a linear caliper goes from one pressure to another."""

    def rate(t, p):
        return [flow(p_far, p[0], d) / LINE]

    def arrived(t, p):
        return p[0] - end

    arrived.terminal = True
    found = solve_ivp(rate, (0.0, 1.0), [start], events=arrived, rtol=1e-10, atol=1e-3)
    return float(found.t_events[0][0])


@pytest.mark.parametrize(("d", "K"), [(0.5e-3, 5.518e-9), (0.6e-3, 7.946e-9)])
def test_the_coefficient_is_that_of_a_sharp_edge(d, K):
    assert orifice.coefficient(valve(d), FLUID) == pytest.approx(K, rel=1e-3)


GRADIENTS = [(120, 0.5e-3, 1738), (50, 0.5e-3, 1122), (98.5, 0.6e-3, 2267)]


@pytest.mark.parametrize(("drop", "d", "gradient"), GRADIENTS)
def test_pressure_gradients_of_a_linear_caliper(drop, d, gradient):
    assert flow(drop * BAR, 0.0, d) / LINE / BAR == pytest.approx(gradient, rel=1e-3)


def test_a_linear_caliper_builds_and_releases_in_the_time_of_the_closed_form():
    K = orifice.coefficient(valve(0.6e-3), FLUID)
    p_a, p_0, p_1 = 1.5 * BAR, 100 * BAR, 20 * BAR
    closed = 2 * LINE / K * (math.sqrt(p_0 - p_a) - math.sqrt(p_1 - p_a))
    assert closed == pytest.approx(49.24e-3, rel=1e-3)
    assert time_between(p_0, p_1, p_a, 0.6e-3) == pytest.approx(closed, rel=5e-3)
    assert time_between(20 * BAR, 100 * BAR, 120 * BAR, 0.5e-3) == pytest.approx(69.70e-3, rel=5e-3)


def test_the_slope_at_zero_is_finite_and_the_flow_is_odd():
    par = valve(0.5e-3)
    slope = orifice.coefficient(par, FLUID) / math.sqrt(orifice.critical_pressure(par, FLUID))
    assert flow(1.0, 0.0) == pytest.approx(slope, rel=1e-6)
    assert flow(0.0, 7 * BAR) == -flow(7 * BAR, 0.0)


def test_a_check_valve_is_tight_below_its_cracking_pressure():
    par = check_valve.Parameters.create(
        {"seat.d": 1.2e-3, "seat.C_d": 0.65, "seat.Re_cr": 100.0, "p_crack": 0.2 * BAR}
    )
    drops = np.array([-50.0, 0.0, 0.2, 0.3, 10.0]) * BAR
    flows = [check_valve.flow(check_valve.Input(p, 0.0), par, FLUID) for p in drops]
    assert flows[:3] == [0.0, 0.0, 0.0]
    assert flows[3:] == [flow(0.1 * BAR, 0.0, 1.2e-3), flow(9.8 * BAR, 0.0, 1.2e-3)]


@pytest.mark.parametrize("drop", [1e-3, 10.0, 1e3, 1e5, 1e7])
def test_the_pressure_drop_is_the_inverse_of_the_flow(drop):
    par = valve(0.6e-3)
    assert orifice.pressure_drop(flow(drop, 0.0, 0.6e-3), par, FLUID) == pytest.approx(drop)
    assert orifice.pressure_drop(-flow(drop, 0.0, 0.6e-3), par, FLUID) == pytest.approx(-drop)


def test_a_cone_opens_up_to_the_area_of_the_orifice():
    par, alpha = valve(0.6e-3), math.pi / 4
    full = par.d / (4 * math.sin(alpha))
    openings = [orifice.conical_opening(share * full, alpha, par) for share in (0.0, 0.5, 1.0, 2.0)]
    assert openings == pytest.approx([0.0, 0.5, 1.0, 1.0])


@pytest.mark.parametrize(
    ("name", "value"), [("d", 0.0), ("d", -1e-3), ("C_d", 1.1), ("C_d", 0.0), ("Re_cr", 0.0)]
)
def test_an_orifice_that_cannot_exist_is_rejected(name, value):
    with raises(ParameterError, name=name):
        orifice.Parameters.create({"d": 1e-3, "C_d": 0.65, "Re_cr": 100.0} | {name: value})


def test_a_fluid_needs_an_absolute_pressure():
    with raises(ParameterError, name="p_atm"):
        FLUID.replace({"p_atm": -1e5})
