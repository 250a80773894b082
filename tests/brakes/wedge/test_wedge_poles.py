"""Open-loop poles of the wedge brake: linear model, rigid closed form and runs."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from wedge_runs import FRICTIONLESS, TAN_ALPHA, brake, drive

from bywire.analysis.linear.linearize import linearize
from bywire.brakes.wedge.elements import brake_heart
from bywire.brakes.wedge.model import WedgeBrake, memory_at, state_at, travel_for
from bywire.plant import roller_screw

# A current loop of the usual gains acts on the shaft like 2.5 % more inertia.
OPEN_LOOP = FRICTIONLESS | {
    "drive.k_p": 0.3,
    "drive.k_i": 7000.0,
    "command.mode": "current",
    "motor_1.D_M": 0.0,
    "motor_2.D_M": 0.0,
}
UNDAMPED = OPEN_LOOP | {"heart.tau_heart": 0.0, "caliper.tau_cal": 0.0}
MECHANICAL = ("theta_1", "omega_1", "theta_2", "omega_2", "x", "v")


def slow_pole(par, depth=50e-6):
    """Return the slow pole [1/s] at constant currents, of the pair the one that grows or swings."""
    state = state_at(travel_for(0.0, par) + depth, par)
    model = linearize(
        WedgeBrake(), par, state, memory_at(state.x, par), inputs=("i_1_ref",), outputs=("x",)
    )
    return max(model.reduced(MECHANICAL, held=True).poles()[:2], key=lambda s: s.real + s.imag)


def rigid_pole(par):
    """Return sqrt(K_CAL tan(alpha) (mu_B - tan(alpha)) / M), both rotors on a rigid heart."""
    M = par.wedge.M_W + 2.0 * par.motor_1.J_M / roller_screw.slope(par.screw) ** 2
    return np.emath.sqrt(par.caliper.K_cal * TAN_ALPHA * (par.wedge.mu_B - TAN_ALPHA) / M)


@pytest.mark.parametrize("mu_B", [0.2, 0.5])
def test_poles_approach_the_rigid_ones_as_the_heart_stiffens(mu_B):
    """The error is 2 % at the set's stiffnesses and falls with the compliance."""
    errors = []
    for factor in (1.0, 10.0, 100.0):
        par = brake(UNDAMPED, mu_B)
        stiff = {name: factor * par.leaves()[name] for name in ("heart.K_S", "heart.K_W")}
        par = par.replace(stiff)
        errors.append(abs(slow_pole(par) / rigid_pole(par) - 1.0))
    assert errors[0] == pytest.approx(0.017, abs=0.003)
    for softer, stiffer in pairwise(errors):
        assert softer / stiffer == pytest.approx(10.0, rel=0.25)


def test_poles_are_zero_at_the_neutral_point():
    """What is left is the rounding error of a double pole, a root of 1e-16 times the fast ones."""
    assert abs(slow_pole(brake(UNDAMPED, TAN_ALPHA))) < 1e-3


@pytest.mark.parametrize(("mu_B", "published"), [(0.2, 27.0), (0.5, 25.4)])
def test_open_loop_rates(mu_B, published):
    """Without friction the wedge swings below tan(alpha) and runs away above."""
    par = brake(OPEN_LOOP, mu_B)
    depth, apart, k = 10e-6, 2e-6, roller_screw.slope(par.screw)
    squeezed = brake_heart.Input(-42e-6, 42e-6, 0.0, 0.0, 0.0, 0.0)
    preload = brake_heart.forces(squeezed, par.heart).f_1
    push = (TAN_ALPHA - mu_B) * par.caliper.K_cal * TAN_ALPHA * depth
    # The balanced screws are ahead of the wedge by the compression of the pushed side.
    ahead = 0.5 * push * (1.0 / par.heart.K_S + 1.0 / par.heart.K_W)
    i_1, i_2 = (k * (0.5 * push + sign * preload) / par.motor_1.K_ref for sign in (-1.0, 1.0))
    duty = par.motor_1.R_ref / par.drive.V_dc
    x = travel_for(0.0, par) + depth
    state = state_at(x, par)
    state = state._replace(
        i_1=i_1,
        demand_1=i_1,
        sensed_1=i_1,
        integral_1=duty * i_1,
        i_2=i_2,
        demand_2=i_2,
        sensed_2=i_2,
        integral_2=duty * i_2,
        theta_1=state.theta_1 + (ahead + apart) / k,
        theta_2=state.theta_2 + (ahead + apart) / k,
        x=x + apart,
    )
    run = drive(
        par,
        0.1,
        5e-6,
        2e-4,
        state,
        i_1_set=lambda t: i_1 + 0.0 * t,
        i_2_set=lambda t: i_2 + 0.0 * t,
    )
    found = rate_of(run.time, run["x"] - x, mu_B < TAN_ALPHA)
    assert found == pytest.approx(abs(slow_pole(par)), rel=2e-3)
    assert found == pytest.approx(published, rel=4e-3)


def rate_of(t, n, swings):
    """Return the rate s of n'' = -s^2 n + c (or +), from n(t + T) + n(t - T) = 2 cos(s T) n(t)."""
    lag = 125
    basis = np.stack([n[lag:-lag], np.ones(n.size - 2 * lag)], axis=1)
    c = 0.5 * np.linalg.lstsq(basis, n[2 * lag :] + n[: -2 * lag], rcond=None)[0][0]
    return float(np.arccos(c) if swings else np.arccosh(c)) / (lag * (t[1] - t[0]))
