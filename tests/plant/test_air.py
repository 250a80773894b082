"""Volumes of compressed air against closed forms: isothermal, adiabatic, with heat."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bywire.core.errors import ParameterError
from bywire.plant import air, air_orifice, air_volume

BAR, V = 1e5, 1e-3
GAS = air.Parameters.create(
    {"p_ref": 1e5, "rho_0": 1.185, "T_0": 293.15, "gamma": 1.4, "p_atm": 101_325.0}
)
SUPPLY = 9.51325 * BAR


def fill(start, end, law="isothermal", G_w=0.0, far=SUPPLY, r_lam=1 - 1e-12):
    """Return time, final temperature, mass, drawn and lost exergy [J] of a fill or an exhaust.

    ``start`` and ``end``: gauge pressures in bar; ``far``: absolute pressure at the other end.
    """
    par = air_volume.Parameters.create({"law": law, "G_w": G_w})
    gap = air_orifice.Parameters.create({"C": 4e-8, "b": 0.3, "r_lam": r_lam})
    R = air.gas_constant(GAS)

    def parts(y):
        x = air_volume.State(y[0], y[1])
        p = air_volume.pressure(x, air_volume.Input(0.0, 0.0, V, 0.0), par, GAS)
        ends = air_orifice.Input(far, p, GAS.T_0, x.T, 1.0)
        return x, p, ends, air_orifice.output(ends, gap, GAS)

    def rate(t, y):
        x, _, ends, q = parts(y)
        u = air_volume.Input(q.mdot, q.H, V, 0.0)
        f, b = air_volume.mass(x, par, GAS), air_volume.balance(x, u, par, GAS)
        loss = air_orifice.power_loss(ends, gap, GAS)
        return [b.m / f.m, b.T / f.T, q.mdot * air.exergy(far, GAS), loss]

    def arrived(t, y):
        return parts(y)[1] - end * BAR - GAS.p_atm

    arrived.terminal = True
    m = (start * BAR + GAS.p_atm) * V / (R * GAS.T_0)
    y = [m, GAS.T_0, 0.0, 0.0]
    found = solve_ivp(rate, (0.0, 3.0), y, events=arrived, rtol=1e-9, atol=1e-12, max_step=2e-3)
    x = air_volume.State(*found.y[:2, -1])
    stored = air_volume.energy(x, air_volume.Input(0.0, 0.0, V, 0.0), par, GAS)
    return float(found.t_events[0][0]), float(x.T), stored, found.y[2, -1], found.y[3, -1]


TAU = V / (4e-8 * 1e5)


def test_the_gas_constant_follows_from_the_reference_state():
    assert air.gas_constant(GAS) == pytest.approx(287.87, rel=2e-5)


def test_an_isothermal_fill_takes_the_time_of_the_closed_form():
    b, r_0, r_1 = 0.3, GAS.p_atm / SUPPLY, (5 * BAR + GAS.p_atm) / SUPPLY
    closed = TAU * ((b - r_0) + (1 - b) * math.asin((r_1 - b) / (1 - b)))
    assert closed == pytest.approx(134.876e-3, rel=1e-4)
    time, T, stored, drawn, lost = fill(0.0, 5.0)
    assert time == pytest.approx(closed, rel=1e-4)
    assert T == GAS.T_0
    assert (drawn, stored, lost) == pytest.approx((1119.8, 570.8, 548.9), rel=1e-3)
    assert drawn == pytest.approx(stored + lost, rel=1e-6)


def test_an_adiabatic_fill_heats_the_air():
    time, T, *_ = fill(0.0, 5.0, "heat")
    assert time == pytest.approx(96.340e-3, rel=1e-4)
    assert pytest.approx(384.5, abs=0.1) == T


def test_heat_to_the_walls_lies_between():
    time, T, *_ = fill(0.0, 5.0, "heat", G_w=10.0)
    assert time == pytest.approx(101.06e-3, rel=5e-3)
    assert pytest.approx(370.5, rel=5e-3) == T


@pytest.mark.parametrize(("end", "time"), [(2.0, 211.21e-3), (0.1, 502.73e-3)])
def test_an_isothermal_exhaust(end, time):
    assert fill(6.0, end, far=GAS.p_atm)[0] == pytest.approx(time, rel=1e-4)


def test_a_choked_adiabatic_exhaust_cools_the_air():
    p_0, p_1, g = 6 * BAR + GAS.p_atm, 4 * BAR + GAS.p_atm, 1.4
    closed = 2 * TAU / (g - 1) * ((p_1 / p_0) ** (-(g - 1) / (2 * g)) - 1)
    assert closed == pytest.approx(61.410e-3, rel=1e-4)
    time, T, *_ = fill(6.0, 4.0, "heat", far=GAS.p_atm)
    assert time == pytest.approx(closed, rel=1e-4)
    assert pytest.approx(266.3, abs=0.1) == T


def test_the_flow_reverses_with_the_pressures_and_is_continuous():
    par = air_orifice.Parameters.create({"C": 4e-8, "b": 0.3, "r_lam": 0.999})
    one = air_orifice.Input(6e5, 5e5, 300.0, 300.0, 1.0)
    other = one._replace(p_a=5e5, p_b=6e5)
    assert air_orifice.output(one, par, GAS).mdot == -air_orifice.output(other, par, GAS).mdot
    for ratio in (0.3, 0.999, 1.0):
        near = [one._replace(p_b=6e5 * (ratio + d)) for d in (-1e-9, 1e-9)]
        low, high = (air_orifice.output(u, par, GAS).mdot for u in near)
        assert low == pytest.approx(high, abs=1e-6)


@pytest.mark.parametrize("values", [{"b": 1.0}, {"b": 1.2}, {"b": 0.5, "r_lam": 0.4}])
def test_an_impossible_critical_ratio_is_rejected(values):
    with pytest.raises(ParameterError):
        air_orifice.Parameters.create({"C": 4e-8, "b": 0.3, "r_lam": 0.999} | values)


def test_a_growing_volume_does_work():
    par = air_volume.Parameters.create({"law": "heat", "G_w": 0.0})
    x = air_volume.State(5e-3, 300.0)
    u = air_volume.Input(0.0, 0.0, 1e-3, 1e-3)
    p = air_volume.pressure(x, u, par, GAS)
    T_rate = air_volume.balance(x, u, par, GAS).T / air_volume.mass(x, par, GAS).T
    # adiabatic: dT/T = -(gamma - 1) dV/V
    assert T_rate / x.T == pytest.approx(-(GAS.gamma - 1.0) * u.V_rate / u.V)
    assert np.isclose(p, 5e-3 * air.gas_constant(GAS) * 300.0 / 1e-3)
