"""Heat of a brake against closed forms, and against an independent trial of repeated stops."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import bywire
from bywire.core.catalog import PARAMETER_SETS
from bywire.plant import disc_heat
from bywire.plant.disc_heat import Input, State
from run_once import run_once

WARM = PARAMETER_SETS.find("sport600").parameters().front.heat.replace({"law": "lumped"})
NO_LOSS = {
    "h_0": 0.0,
    "h_1": 0.0,
    "epsilon": 0.0,
    "G_dp": 0.0,
    "G_open": 0.0,
    "G_pf": 0.0,
    "G_f": 0.0,
}
ICE, V = 273.15, 100.0 / 3.6
COLD = [WARM.T_a] * 3


def rate(T, u, par):
    return np.array(disc_heat.balance(State(*T), u, par)) / np.array(disc_heat.mass(par))


def after(T, u, par, duration):
    got = solve_ivp(
        lambda _, y: rate(y, u, par), (0.0, duration), T, "DOP853", rtol=1e-12, atol=1e-9
    )
    return got.y[:, -1]


def test_without_losses_all_heat_stays_where_it_goes():
    par = WARM.replace(NO_LOSS)
    E = 5e4
    rises = after(COLD, Input(E / 4.0, 20.0, 1.0), par, 4.0) - np.array(COLD)
    wanted = [par.psi * E / par.C_d, (1.0 - par.psi) * E / par.C_p, 0.0]
    assert rises == pytest.approx(wanted, rel=1e-9, abs=1e-9)


def test_discs_by_themselves_cool_down_exponentially():
    par = WARM.replace({**NO_LOSS, "h_0": 8.0, "h_1": 7.0})
    h = 8.0 + 7.0 * 25.0**0.8
    end = after([500.0, *COLD[1:]], Input(0.0, 25.0, 0.0), par, 30.0)
    wanted = par.T_a + (500.0 - par.T_a) * math.exp(-h * par.A * 30.0 / par.C_d)
    assert end == pytest.approx([wanted, *COLD[1:]], rel=1e-9)


def test_discs_that_radiate_into_the_cold_cool_down_with_the_inverse_cube():
    par = WARM.replace({**NO_LOSS, "epsilon": 1.0, "T_a": 1e-3})
    end = after([900.0, 1e-3, 1e-3], Input(0.0, 0.0, 0.0), par, 600.0)
    inverse = 900.0**-3 + 3.0 * par.sigma * par.A * 600.0 / par.C_d
    assert end[0] == pytest.approx(inverse ** (-1.0 / 3.0), rel=1e-9)


def test_steady_temperatures_are_those_of_a_chain_of_resistances():
    par = WARM.replace({"epsilon": 0.0, "psi": 1.0})
    P, v = 900.0, 15.0
    air = (par.h_0 + par.h_1 * v**0.8) * par.A
    through = 1.0 / (1.0 / par.G_dp + 1.0 / par.G_pf + 1.0 / par.G_f)
    hot = par.T_a + P / (air + through)
    flow = through * (hot - par.T_a)
    chain = State(hot, hot - flow / par.G_dp, par.T_a + flow / par.G_f)
    held = disc_heat.balance(chain, Input(P, v, 1.0), par)
    assert held == pytest.approx((0.0, 0.0, 0.0), abs=1e-9 * P)
    # all of it goes to the air
    assert disc_heat.power_loss(chain, Input(P, v, 1.0), par) == pytest.approx(P, rel=1e-12)


def test_convection_at_rest_has_a_value_and_a_derivative():
    assert disc_heat.convection(0.0, WARM) == WARM.h_0
    assert disc_heat.convection(-20.0, WARM) == disc_heat.convection(20.0, WARM)
    assert disc_heat.convection(1.0, WARM) == pytest.approx(15.0)


@pytest.mark.parametrize(
    ("degrees", "left"), [(20, 1.0), (350, 1.0), (475, 0.8), (600, 0.6), (900, 0.6)]
)
def test_pads_fade_between_two_temperatures(degrees, left):
    assert disc_heat.friction(degrees + ICE, WARM) == pytest.approx(left, rel=1e-12)
    assert disc_heat.friction(degrees + ICE, WARM.replace({"law": "off"})) == 1.0


def test_a_warning_says_which_boiling_point_is_passed_and_when():
    t = np.array([0.0, 1.0, 2.0])
    cold, hot = np.full(3, 300.0), ICE + np.array([20.0, 160.0, 240.0])
    wet, fresh = disc_heat.watch(t, State(cold, cold, hot), WARM)
    assert "boiling point of wet fluid, 155 degC, at t = 1 s" in wet
    assert "boiling point of fresh fluid, 230 degC, at t = 2 s" in fresh
    (disc,) = disc_heat.watch(t, State(hot + 500.0, cold, cold), WARM)
    assert "the discs exceed 650 degC" in disc
    assert disc_heat.watch(t, State(hot + 500.0, cold, hot), WARM.replace({"law": "off"})) == []


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ("T_1=700 degC", "T_1 = 700 degC must be < T_2 = 600 degC"),
        ("T_a=-300 degC", "T_a = -300 degC is not valid: it must be > -273.15 degC"),
        ("T_a=20", "cannot be converted to K"),
        ("f=1.2", "must be >= 0 and <= 1"),
        ("C_d=0 J/K", "must be > 0"),
    ],
)
def test_impossible_heat_is_refused(change, text):
    name, _, value = change.partition("=")
    with pytest.raises(bywire.BywireError, match=text.replace("(", r"\(")):
        run_once("straight-stop", {f"front.heat.{name}": value})


# The trial: a mass that its brakes slow down, the front one with 0.8 of the force, no other
# resistance; between the stops, at once back to speed.
MASS, A, SHARE, RADIUS, K_FRONT = 265.0, 8.0, 0.8, 0.30, 33.1e-5


def trial(stops, pause):
    """Return for each stop (disc before, disc after, pads, fluid [degC], distance [m])."""

    def braking(_, y):
        left = disc_heat.friction(y[0], WARM)
        u = Input(MASS * A * SHARE * left * max(y[3], 0.0), max(y[3], 0.0), 1.0)
        return [*rate(y[:3], u, WARM), -A * (SHARE * left + 1.0 - SHARE), y[3]]

    def standing(_, y):
        return y[3]

    standing.terminal, standing.direction = True, -1
    T, rows = np.array(COLD), []
    for _ in range(stops):
        stop = solve_ivp(
            braking, (0.0, 60.0), [*T, V, 0.0], rtol=1e-9, atol=1e-9, events=standing
        ).y[:, -1]
        rows.append((T[0] - ICE, *(stop[:3] - ICE), stop[4]))
        T = after(stop[:3], Input(0.0, V, 0.0), WARM, pause)
    return rows


def test_stops_every_half_minute_are_those_of_the_trial():
    rows = trial(10, 30.0)
    for k, before, hot in ((1, 20.0, 80.0), (2, 57.0, 115.0), (5, 98.0, 155.0), (10, 108.0, 165.0)):
        assert rows[k - 1][:2] == pytest.approx((before, hot), rel=0.01)
    assert rows[-1][2:4] == pytest.approx((116.0, 45.0), rel=0.01)
    assert [rows[0][4], rows[-1][4]] == pytest.approx([V**2 / (2.0 * A)] * 2, rel=1e-9)


def test_stops_every_five_seconds_fade_as_those_of_the_trial():
    rows = trial(20, 5.0)
    assert rows[4][:2] == pytest.approx((205.0, 257.0), rel=0.01)
    assert rows[19] == pytest.approx((409.0, 448.0, 275.0, 62.0, 53.82), rel=0.01)
    pressure = MASS * A * SHARE * RADIUS / K_FRONT / 1e5
    assert pressure == pytest.approx(15.4, rel=0.01)
    left = disc_heat.friction(rows[19][1] + ICE, WARM)
    assert pressure / left == pytest.approx(18.2, rel=0.01)
