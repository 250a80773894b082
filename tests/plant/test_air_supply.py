"""Compressor, governor and spring brake of an air brake, against closed forms."""

import pytest

from bywire.core.errors import ParameterError
from bywire.plant import air, compressor, governor, spring_brake

GAS = air.Parameters.create(
    {"p_ref": 1e5, "rho_0": 1.185, "T_0": 293.15, "gamma": 1.4, "p_atm": 101_325.0}
)
SPRING = spring_brake.Parameters.create(
    {
        "A": 0.0194,
        "V_0": 0.3e-3,
        "x_max": 0.06,
        "F_s0": 9.9e3,
        "k_s": 85e3,
        "m": 3.0,
        "d": 500.0,
        "F_fr": 150.0,
    }
)


def pumped(p, c=0.04):
    par = compressor.Parameters.create({"V_dot": 2.5e-3, "c": c})
    return compressor.output(compressor.Input(p, 1.0), par, GAS)


def test_a_compressor_without_clearance_fills_a_tank_at_a_constant_rate():
    V, R_T = 20e-3, air.gas_constant(GAS) * GAS.T_0
    rate = pumped(5e5, c=0.0).mdot * R_T / V
    # Isothermal: dp/dt = V_dot p_a/V
    assert rate == pytest.approx(2.5e-3 * GAS.p_atm / V)
    assert pumped(9e5, c=0.0).mdot == pumped(2e5, c=0.0).mdot


def test_the_flow_falls_to_zero_at_the_pressure_of_its_clearance():
    zero = GAS.p_atm * (1.0 + 1.0 / 0.04) ** GAS.gamma
    assert pumped(GAS.p_atm).mdot == pytest.approx(pumped(GAS.p_atm, c=0.0).mdot)
    assert pumped(0.999 * zero).mdot > 0.0
    assert pumped(1.001 * zero).mdot == 0.0


def test_an_idle_compressor_delivers_exactly_nothing():
    par = compressor.Parameters.create({"V_dot": 2.5e-3, "c": 0.04})
    assert compressor.output(compressor.Input(5e5, 0.0), par, GAS) == (0.0, 0.0)


def test_a_governor_keeps_its_position_between_its_pressures():
    par = governor.Parameters.create({"T_s": 0.01, "p_in": 8.1e5, "p_out": 9.3e5})
    x, seen = governor.State(0.0), []
    for p in (8.5, 8.0, 8.5, 9.2, 9.4, 9.2, 8.2, 8.05):
        x = governor.output(x, governor.Input(p * 1e5), par)
        seen.append(x.on)
    assert seen == [0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0]


def test_a_governor_without_hysteresis_is_rejected():
    with pytest.raises(ParameterError, match=r"p_in = 9\.3 bar must be < p_out = 9\.3 bar"):
        governor.Parameters.create({"T_s": 0.01, "p_in": 9.3e5, "p_out": 9.3e5})


def test_the_spring_brake_balances_its_release_pressure():
    assert spring_brake.release_pressure(SPRING) == pytest.approx(5.103e5, rel=1e-3)
    x = spring_brake.State(0.0, 0.0)
    u = spring_brake.Input(spring_brake.release_pressure(SPRING), 0.0, 0.0)
    assert spring_brake.balance(x, u, SPRING).v == pytest.approx(0.0, abs=1e-9)


def test_a_parked_spring_brake_presses_with_what_is_left_of_the_spring():
    x = spring_brake.State(0.03, 0.0)
    assert spring_brake.spring_force(x, SPRING) == pytest.approx(9.9e3 - 85e3 * 0.03)
    assert pytest.approx(0.3e-3 + 0.0194 * 0.03) == spring_brake.output(x, SPRING).V
    rest = spring_brake.energy(spring_brake.State(0.0, 0.0), SPRING)
    released = rest - spring_brake.energy(x, SPRING)
    assert released == pytest.approx((9.9e3 - 0.5 * 85e3 * 0.03) * 0.03)
