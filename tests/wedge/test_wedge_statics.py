"""The wedge brake at rest and near it, against closed forms."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from wedge_runs import FRICTIONLESS, TAN_ALPHA, brake, drive

from bywire.assemblies.wedge_start import state_at, travel_for
from bywire.plant import brake_heart, roller_screw

MU = (0.2, 0.35, TAN_ALPHA, 0.5, 0.6)


@pytest.mark.parametrize("mu_B", MU)
def test_actuation_force_without_friction(mu_B):
    """Pushed below tan(alpha), pulled above, nothing at the neutral point; stable throughout."""
    run = drive(brake(FRICTIONLESS, mu_B), 0.8, M_set=lambda t: 950.0 + 0.0 * t)
    F_N = run["F_N"][-1]
    assert 2.0 * mu_B * F_N * 0.125 == pytest.approx(950.0, abs=0.01)
    assert run["F_M"][-1] == pytest.approx((TAN_ALPHA - mu_B) * F_N, abs=0.1)


def test_950_Nm():
    run = drive(brake(FRICTIONLESS), 0.8, M_set=lambda t: 950.0 + 0.0 * t)
    assert run["F_N"][-1] == pytest.approx(10.86e3, abs=5.0)
    assert run["U_caliper"][-1] == pytest.approx(1.96, abs=0.005)
    angle = 0.5 * (run["theta_1"][-1] + run["theta_2"][-1])
    assert angle == pytest.approx(4.85, abs=0.02)


def slow_rate(par, mu_B):
    """Return the slow rate [1/s] of two rotors and the wedge between them, from the matrices."""
    rotor = par.motor_1.J_M / roller_screw.slope(par.screw) ** 2
    contact = 1.0 / (1.0 / par.heart.K_S + 1.0 / par.heart.K_W)
    wedge = par.caliper.K_cal * TAN_ALPHA * (TAN_ALPHA - mu_B)
    K = contact * np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    K[1, 1] += wedge
    squares = np.linalg.eigvals(np.diag(1.0 / np.array([rotor, par.wedge.M_W, rotor])) @ K)
    return math.sqrt(np.abs(squares).min())


@pytest.mark.parametrize(("mu_B", "published"), [(0.2, 27.0), (0.5, 25.4)])
def test_open_loop_rates(mu_B, published):
    """Without friction the wedge swings below tan(alpha) and runs away above."""
    # A current loop of the usual gains acts on the shaft like 2.5 % more inertia.
    stiff = {"drive.k_p": 0.3, "drive.k_i": 7000.0, "command.mode": "current"}
    par = brake(FRICTIONLESS | stiff | {"motor_1.D_M": 0.0, "motor_2.D_M": 0.0}, mu_B)
    depth, apart, k = 10e-6, 2e-6, roller_screw.slope(par.screw)
    squeezed = brake_heart.Input(-42e-6, 42e-6, 0.0, 0.0, 0.0, 0.0)
    preload = brake_heart.forces(squeezed, par.heart).f_1
    push = (TAN_ALPHA - mu_B) * par.caliper.K_cal * TAN_ALPHA * depth
    # The balanced screws stand ahead of the wedge by what the push compresses.
    ahead = 0.5 * push * (1.0 / par.heart.K_S + 1.0 / par.heart.K_W)
    i_1, i_2 = (k * (0.5 * push + sign * preload) / par.motor_1.K_ref for sign in (-1.0, 1.0))
    duty = par.motor_1.R_ref / par.drive.V_dc
    x = travel_for(0.0, par) + depth
    state = state_at(x, par)
    state = state._replace(
        i_1=i_1, demand_1=i_1, sensed_1=i_1, integral_1=duty * i_1,
        i_2=i_2, demand_2=i_2, sensed_2=i_2, integral_2=duty * i_2,
        theta_1=state.theta_1 + (ahead + apart) / k, theta_2=state.theta_2 + (ahead + apart) / k,
        x=x + apart,
    )  # fmt: skip
    run = drive(
        par, 0.1, 5e-6, 2e-4, state,
        i_1_set=lambda t: i_1 + 0.0 * t, i_2_set=lambda t: i_2 + 0.0 * t,
    )  # fmt: skip
    found = rate_of(run.time, run["x"] - x, mu_B < TAN_ALPHA)
    assert found == pytest.approx(slow_rate(par, mu_B), rel=2e-3)
    assert found == pytest.approx(published, rel=4e-3)


def rate_of(t, n, swings):
    """Return the rate s of n'' = -s^2 n + c (or +), from n(t + T) + n(t - T) = 2 cos(s T) n(t)."""
    lag = 125
    basis = np.stack([n[lag:-lag], np.ones(n.size - 2 * lag)], axis=1)
    c = 0.5 * np.linalg.lstsq(basis, n[2 * lag :] + n[: -2 * lag], rcond=None)[0][0]
    return float(np.arccos(c) if swings else np.arccosh(c)) / (lag * (t[1] - t[0]))


def test_heart_solves_its_complementarity_problem():
    """Against every subset of the three contacts, for many overlaps and stiffnesses."""
    par = brake().heart
    C = np.array(brake_heart.matrix(par))
    random = np.random.default_rng(3)
    for _ in range(300):
        d = random.uniform(-40e-6, 40e-6, 3)
        f = np.array(brake_heart.solve(brake_heart.Overlaps(*d), par))
        gap = C @ f - d
        assert f.min() >= 0.0
        assert gap.min() >= -1e-15
        assert np.abs(f * gap).max() < 1e-9
        assert any(np.allclose(f, _subset(C, d, s)) for s in _subsets())


def _subsets():
    return [s for n in range(4) for s in itertools.combinations(range(3), n)]


def _subset(C, d, subset):
    f = np.zeros(3)
    if subset:
        rows = list(subset)
        f[rows] = np.linalg.solve(C[np.ix_(rows, rows)], d[rows])
    return f


def test_rigid_limit_is_two_percent_off():
    par = brake(mu_B=0.5)
    k = roller_screw.slope(par.screw)
    M = par.wedge.M_W + 2.0 * par.motor_1.J_M / k**2
    rigid = math.sqrt(par.caliper.K_cal * TAN_ALPHA * (0.5 - TAN_ALPHA) / M)
    assert rigid == pytest.approx(25.4, rel=0.02)
