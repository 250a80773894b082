"""Screws, ball ramps, drums and backlash against closed forms."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bywire.core.errors import ParameterError
from bywire.plant import backlash, ball_ramp, drum, lead_screw
from raising import raises

EPB = {"lead": 2e-3, "d_m": 10e-3, "mu": 0.12, "beta": math.radians(15)}
EMB = {"lead": 5e-3, "d_m": 12e-3, "mu": 0.01, "beta": math.radians(15)}


def screw(values):
    return lead_screw.Parameters.create(values)


def test_a_self_locking_screw():
    par = screw(EPB)
    angles = [math.degrees(math.atan(t)) for t in lead_screw.tangents(par)]
    assert angles == pytest.approx([3.643, 7.082], rel=1e-3)
    assert lead_screw.efficiencies(par) == pytest.approx((0.3361, -0.9440), rel=1e-3)
    u = lead_screw.Input(-20e3, 0.0)  # the reaction of a clamped brake
    T, T_load = lead_screw.friction(u, par), lead_screw.load_torque(u, par)
    assert -T_load + T.T_p == pytest.approx(18.94, rel=1e-3)  # to apply
    assert T.T_n + T_load == pytest.approx(6.01, rel=1e-3)  # to release; > 0: it holds alone


def test_a_screw_that_the_load_drives():
    par = screw(EMB)
    assert lead_screw.efficiencies(par) == pytest.approx((0.9263, 0.9207), rel=1e-3)
    u = lead_screw.Input(-20e3, 0.0)
    back = -lead_screw.load_torque(u, par) - lead_screw.friction(u, par).T_n
    assert back == pytest.approx(14.65, rel=1e-3)


def test_a_screw_that_no_torque_can_drive_is_rejected():
    with raises(ParameterError, name="mu", valid="<"):
        screw(EPB | {"lead": 60e-3, "mu": 0.9})


def test_a_ball_ramp():
    par = ball_ramp.Parameters.create({"r": 20e-3, "alpha": math.radians(3), "mu": 0.0})
    assert ball_ramp.slope(par) == pytest.approx(1.0482e-3, rel=1e-3)
    per_torque = 1.0 / ball_ramp.load_torque(ball_ramp.Input(1.0, 0.0), par)
    assert per_torque == pytest.approx(954.1, rel=1e-3)


DRUM = {
    "law": "simplex",
    "r": 0.150,
    "b": 0.032,
    "a": 0.12265,
    "c": 0.212,
    "theta_1": 0.0,
    "theta_2": math.radians(126),
    "mu": 0.32,
}


def shoes(**changes):
    return drum.Parameters.create(DRUM | changes)


def test_the_moments_of_a_textbook_drum():
    par = shoes()
    M, p = drum.moments(par), 1e6
    assert (M.normal * p, M.friction * p * par.mu) == pytest.approx((787.3, 304.2), rel=1e-3)
    F = (M.normal - par.mu * M.friction) * p / par.c
    assert pytest.approx(2279, rel=1e-3) == F
    T = [factor * par.r * F for factor in drum.shoe_factors(par)]
    assert pytest.approx([365.8, 161.9], rel=1e-3) == T
    assert drum.output(drum.Input(F, 1.0), par).T_p == pytest.approx(527.8, rel=1e-3)
    assert drum.brake_factors(par)[0] == pytest.approx(1.5438, rel=1e-3)


def test_the_largest_pressure_of_a_textbook_problem():
    par = shoes(b=0.040, a=0.125, c=0.2165, theta_2=math.radians(120), mu=0.28)
    M = drum.moments(par)
    assert 2200 * par.c / (M.normal - par.mu * M.friction) == pytest.approx(734.45e3, rel=1e-3)


def test_brake_factors_over_friction():
    assert drum.coefficients(shoes()) == pytest.approx((0.48729, 0.58830), rel=1e-4)
    factors = [drum.brake_factors(shoes(mu=mu))[0] for mu in (0.3, 0.4)]
    assert factors == pytest.approx([1.4172, 2.1410], rel=1e-4)
    leading, trailing = drum.shoe_factors(shoes())
    assert drum.brake_factors(shoes(law="duplex")) == (2 * leading, 2 * trailing)
    assert drum.brake_factors(shoes(law="servo"))[0] > 2 * leading


def test_shoes_in_series_balance_their_moments():
    par, F = shoes(law="servo"), 1000.0
    M = drum.moments(par)
    first = F * par.c / (M.normal - par.mu * M.friction) * par.mu * M.torque
    pushed = (F * (par.c - par.a) + first) / par.a  # moments of the floating shoe about the center
    second = pushed * 2 * par.a / (M.normal - par.mu * M.friction) * par.mu * M.torque
    assert drum.output(drum.Input(F, 1.0), par).T_p == pytest.approx(first + second)


def test_moments_and_torque_agree_with_numerical_integrals():
    par, n = shoes(theta_1=0.2, theta_2=1.2), 20001
    angle = np.linspace(par.theta_1, par.theta_2, n)
    p = np.sin(angle) / math.sin(par.theta_2)  # a short lining: largest at its end
    scale = par.b * par.r
    integrals = [
        scale * np.trapezoid(p * par.a * np.sin(angle), angle),
        scale * np.trapezoid(p * (par.r - par.a * np.cos(angle)), angle),
        scale * np.trapezoid(p * par.r, angle),
    ]
    assert list(drum.moments(par)) == pytest.approx(integrals, rel=1e-8)


@pytest.mark.parametrize("mu", [0.75, 0.82, 0.95])
def test_a_drum_near_locking_is_rejected(mu):
    with raises(ParameterError, name="mu", value=f"{mu}", valid="<= 0.74"):
        shoes(mu=mu)


MESH = {"i": 1.0, "b": 2e-3, "k": 400.0, "tau": 0.0}
J_1, J_2 = 3e-4, 2e-4


def crash(par, omega, J_other=math.inf):
    """Return the largest torque and the rebound of a shaft that hits a flank at its end of play."""

    def rate(t, y):
        u = backlash.Input(y[0], y[1], y[2], y[3])
        T = backlash.torque(backlash.forces(u, par))
        return [y[1], -T / J_1, y[3], T / J_other]

    t = np.linspace(0.0, 6e-3, 60001)
    y = solve_ivp(
        rate, (0.0, t[-1]), [par.b / 2, omega, 0.0, 0.0], t_eval=t, rtol=1e-10, atol=1e-13
    ).y
    T = [backlash.torque(backlash.forces(backlash.Input(*row), par)) for row in y.T]
    return max(T), (y[3, -1] - y[1, -1]) / omega


def test_the_torque_after_a_play():
    par = backlash.Parameters.create(MESH)
    omega = math.sqrt(2 * par.b * 0.3 / J_1)  # from rest with 0.3 N m across the whole play
    assert omega == pytest.approx(2.0, rel=1e-4)
    assert crash(par, omega)[0] == pytest.approx(0.6928, rel=1e-2)
    assert crash(par, omega, J_2)[0] == pytest.approx(0.4382, rel=1e-2)


@pytest.mark.parametrize(("zeta", "rebound"), [(0.1, 0.744079), (0.5, 0.298436)])
def test_a_damped_flank_never_pulls(zeta, rebound):
    tau = 2 * zeta / math.sqrt(400.0 / J_1)
    par = backlash.Parameters.create(MESH | {"tau": tau, "b": 0.1})  # it meets no other flank
    assert crash(par, 2.0)[1] == pytest.approx(rebound, rel=1e-3)
