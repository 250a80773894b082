"""Tests of the event-driven reference itself, against closed forms and its own refinement."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from scipy.linalg import expm

from .event_driven import STATES, Plant, excess, radau_step, simulate, slip_field, stick

PERIOD = 1e-3
BAR = 1e5
BRAKE = Plant(
    R_m=0.35,
    L_m=1e-4,
    K_e=30.4e-3,
    V_bat=12.0,
    R_bat=0.02,
    eta_g=0.9,
    J_mot=3.018e-5,
    k_g=3e-4,
    M_mc=1e-2,
    k_damp=2e4,
    A_mc=0.903e-4,
    s_mc=10.06e-3,
    beta=1e9,
    nu=5e-4,
    rho=1e3,
    L_pl=1.0,
    d_pl=9.019e-3,
    A_pd=3e-4,
    K_pd=1.114e6,
    f_aa=180.0,
    T_pr=2e-3,
    f_cfr_p=1.6e-8,
    f_cfr_n=5.4e-9,
    k_brk_p=2.6,
    k_brk_n=2.3,
    c=5.0,
    mu_T=2e-7,
)
# No fluid compresses and the friction is constant: a block on a rough plane.
BLOCK = replace(BRAKE, beta=1e-6, k_damp=0.0, f_cfr_p=0.0, f_cfr_n=0.0, k_brk_p=1.0, k_brk_n=1.0)
gears = pytest.mark.parametrize("gear", ["paper", "directional"])
Gear = Literal["paper", "directional"]
# Seconds each: the other law is a trust run.
long_gears = pytest.mark.parametrize(
    "gear", [pytest.param("paper", marks=pytest.mark.trust), "directional"]
)


def balanced(plant: Plant, p: float, omega: float = 0.0, x: float = 7e-3) -> dict[str, float]:
    """Return the state in which the motor holds the pressure `p` without friction."""
    i = plant.k_g * plant.A_mc * p / plant.direction(1)[0]
    return dict(zip(STATES, (i, x / plant.k_g, omega, p, p, p, i), strict=True))


def dithered(plant: Plant, level: float) -> Callable[[int, float, dict[str, float]], float]:
    """Return a PI current loop that follows steps from `level` and back with dither, eq. (20)."""
    integral = 0.0

    def controller(k: int, t: float, state: dict[str, float]) -> float:
        nonlocal integral
        amplitude = plant.k_brk_p * (plant.T_pr + plant.f_cfr_p * state["p_f"]) / plant.K_e
        i_set = level + (0.0, 4.0, 0.0, -3.0)[k // 100 % 4]
        error = i_set + amplitude * math.sin(2.0 * math.pi * 50.0 * t) - state["i_f"]
        integral += 10.39 * PERIOD * error
        return min(max(0.00522 * error + integral, -1.0), 1.0)

    return controller


@gears
@pytest.mark.parametrize("sigma", [1, -1])
def test_block_decelerates_to_rest_and_sticks(gear: Gear, sigma: int) -> None:
    """Coulomb and viscous friction: omega decays exponentially to exactly zero, and stays."""
    plant = replace(BLOCK, gear=gear, mu_T=1e-4)
    x0 = balanced(plant, 1.5 * BAR, sigma * 20.0)
    out = simulate(plant, lambda k, t, s: x0["i"], 0.4, PERIOD, x0, 1e-3, "current")

    k_t, loss, inertia, _, _ = plant.direction(sigma)
    factor = 1.0 + sigma * loss  # the load exceeds the seal friction, whatever the direction
    viscous = factor * plant.mu_T
    load = plant.k_g * plant.A_mc * 1.5 * BAR
    coulomb = factor * (sigma * load + plant.T_pr) - sigma * k_t * x0["i"]
    t_stop = inertia / viscous * math.log1p(viscous * 20.0 / coulomb)
    t = np.minimum(out["t"], t_stop)
    decay = np.exp(-viscous * t / inertia)
    drift = coulomb / viscous
    omega = sigma * ((20.0 + drift) * decay - drift)
    turned = sigma * ((20.0 + drift) * inertia / viscous * (1.0 - decay) - drift * t)

    assert 0.05 < t_stop < 0.35
    np.testing.assert_allclose(out["omega"], omega, atol=1e-9)
    np.testing.assert_allclose(out["theta"] - x0["theta"], turned, atol=1e-10)
    np.testing.assert_array_equal(out["stuck"], out["t"] >= t_stop)
    assert np.all(out["omega"][out["stuck"]] == 0.0)
    assert out["mode_changes"] == 1


def test_load_through_the_gear_reverses_within_a_step() -> None:
    """Fast backward motion: damping exceeds the pressure's load, then not; two exponentials."""
    plant = replace(BLOCK, gear="directional", k_damp=2e4, mu_T=0.0)
    x0 = balanced(plant, 8.0 * BAR, -30.0)
    out = simulate(plant, lambda k, t, s: x0["i"], 0.06, PERIOD, x0, 1e-3, "current")

    _, loss, inertia, _, _ = plant.direction(-1)
    load, damping = plant.k_g * plant.A_mc * 8.0 * BAR, plant.k_damp * plant.k_g**2
    kink = (load - plant.T_pr) / damping  # the speed at which the torque through the gear is zero
    rates = [(1.0 + loss) * damping / inertia, (1.0 - loss) * damping / inertia]
    limits = [kink - load / (inertia * rate) for rate in rates]
    times = [
        math.log((start - limit) / (end - limit)) / rate
        for start, end, limit, rate in zip((30.0, kink), (kink, 0.0), limits, rates, strict=True)
    ]
    first = limits[0] + (30.0 - limits[0]) * np.exp(-rates[0] * out["t"])
    second = limits[1] + (kink - limits[1]) * np.exp(-rates[1] * (out["t"] - times[0]))
    speed = np.where(out["t"] < times[0], first, np.maximum(second, 0.0))
    assert 0.005 < times[0] < times[0] + times[1] < 0.06
    np.testing.assert_allclose(-out["omega"], speed, atol=1e-9)


def test_oscillator_with_coulomb_friction() -> None:
    """A closed volume is a spring: each half cycle loses 2 T_pr / stiffness, then it sticks."""
    plant = replace(BLOCK, s_mc=1e9, beta=1e18, nu=1e15, mu_T=0.0)
    inertia = plant.direction(1)[2]
    per_turn = plant.beta * plant.k_g / plant.s_mc
    stiffness = plant.k_g * plant.A_mc * per_turn
    rate, dead = math.sqrt(stiffness / inertia), plant.T_pr / stiffness
    x0 = balanced(plant, 20.0 * BAR)
    held, rest = x0["i"], x0["theta"]
    x0 |= {"theta": rest + 7.5 * dead, "p_mc": x0["p_mc"] + 7.5 * dead * per_turn}
    out = simulate(plant, lambda k, t, s: held, 1.0, PERIOD, x0, 1e-3, "current")

    phase = np.minimum(out["t"] * rate, 4.0 * math.pi * (1.0 - 1e-15))
    half = np.floor(phase / math.pi)
    swing = dead + (7.5 - 2.0 * half - 1.0) * dead * np.cos(phase - half * math.pi)
    np.testing.assert_allclose(out["theta"] - rest, (-1.0) ** half * swing, atol=1e-9)
    assert out["theta"][-1] - rest == pytest.approx(-0.5 * dead, abs=1e-9)
    assert out["mode_changes"] == 8  # breakaway, three reversals of two changes each, stick


@long_gears
def test_halving_the_step_changes_nothing(gear: Gear) -> None:
    """The solution in braking with dither is converged far below 1e-4 bar."""
    plant = replace(BRAKE, gear=gear)
    x0 = balanced(plant, 20.0 * BAR)
    coarse, fine = (
        simulate(plant, dithered(plant, x0["i"]), 0.3, PERIOD, x0, step) for step in (2e-4, 1e-4)
    )
    assert 0.05 < fine["stuck"].mean() < 0.95
    assert np.ptp(fine["p_mc"]) > 8.0 * BAR
    assert fine["mode_changes"] == coarse["mode_changes"] >= 20
    assert np.abs(fine["p_mc"] - coarse["p_mc"]).max() < 1e-5 * BAR


@long_gears
@pytest.mark.parametrize("sigma", [1, -1])
def test_sticks_below_breakaway_and_slips_above(gear: Gear, sigma: int) -> None:
    """At 0.9 of breakaway nothing ever moves; just above, it does, eqs. (18), (19)."""
    plant = replace(BRAKE, gear=gear)
    x0 = balanced(plant, 10.0 * BAR)
    breakaway = -excess(plant, sigma, x0["i"], x0["p_mc"]) / plant.direction(sigma)[0]

    def at(factor: float, t_end: float) -> dict[str, np.ndarray]:
        i = x0["i"] + sigma * factor * breakaway
        duty = i * plant.R_m / plant.V_bat
        for _ in range(20):  # the battery's resistance makes the steady duty implicit
            duty = i * (plant.R_m + plant.R_bat * duty**2) / plant.V_bat
        return simulate(plant, lambda k, t, s: duty, t_end, PERIOD, x0, 1e-4)

    below, above = at(0.9, 10.0), at(1.001, 0.4)
    assert below["mode_changes"] == 0
    assert np.all(below["stuck"])
    assert np.ptp(below["theta"]) == 0.0
    assert np.ptp(below["p_mc"]) < 1e-6
    assert above["mode_changes"] > 0
    assert sigma * (above["theta"][-1] - x0["theta"]) > 0.5


def test_order_of_the_smooth_integrator() -> None:
    """Radau IIA with three stages is of order 5 where the problem is not stiff."""
    plant = replace(BRAKE, gear="directional", beta=3e6, L_m=1e-3, c=0.05)
    start = list(balanced(plant, 10.0 * BAR, omega=20.0).values())
    field = slip_field(plant, "duty", 0.1, 1, start)

    def end(count: int) -> np.ndarray:
        y = start
        for _ in range(count):
            y = radau_step(field, y, 8e-3 / count)[-1]
        return np.array(y)

    exact = end(256)
    errors = [np.abs((end(n) - exact) / exact).max() for n in (8, 16, 32)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 5.0, atol=0.15)


@gears
@pytest.mark.parametrize("sigma", [1, -1])
def test_jacobian_against_differences(gear: Gear, sigma: int) -> None:
    """The Newton matrix is the derivative of the right-hand side, at full speed and at low."""
    for omega in (0.1, 30.0):
        y = list(balanced(BRAKE, 15.0 * BAR, omega=sigma * omega).values())
        y[4] *= 0.99
        field = slip_field(replace(BRAKE, gear=gear), "duty", 0.3, sigma, y)
        jacobian = np.array(field(y)[1])
        for k, h in enumerate((1e-3, 1e-3, 1e-4, 1e2, 1e2, 1e2, 1e-3)):
            up, down = ([*y[:k], y[k] + s * h, *y[k + 1 :]] for s in (1, -1))
            slope = (np.array(field(up)[0]) - np.array(field(down)[0])) / (2.0 * h)
            scale = np.abs(jacobian).max(axis=1)
            np.testing.assert_allclose(slope / scale, jacobian[:, k] / scale, atol=2e-7)


def test_poles_of_the_linear_plant() -> None:
    """Without friction, eq. (14) at 20 bar and 7 mm has the poles of Table 2, in Hz."""
    plant = replace(BRAKE, T_pr=0.0, f_cfr_p=0.0)
    y = list(balanced(plant, 20.0 * BAR).values())
    mechanics = np.array(slip_field(plant, "current", y[0], 1, y)(y)[1])[2:5, 2:5]
    poles = np.sort(np.abs(np.linalg.eigvals(mechanics))) / (2.0 * math.pi)
    np.testing.assert_allclose(poles, [0.866, 9.75, 4.7e4], rtol=3e-3)


def test_stuck_phase_against_the_matrix_exponential() -> None:
    """The closed form of the stuck, linear plant, its filters included."""
    y = [4.0, 7e-3 / BRAKE.k_g, 0.0, 20.0 * BAR, 19.9 * BAR, 18.0 * BAR, 3.0]
    u, (b, c), w = 0.12, BRAKE.pressure_rates(y[1]), 2.0 * math.pi * BRAKE.f_aa
    generator = np.zeros((8, 8))
    generator[0, [0, 7]] = -(BRAKE.R_m + BRAKE.R_bat * u**2) / BRAKE.L_m, u * 12.0 / BRAKE.L_m
    generator[3, [3, 4]] = -b, b
    generator[4, [3, 4]] = c, -c
    generator[5, [3, 5]] = generator[6, [0, 6]] = w, -w
    for end in (1e-6, 1e-4, 1e-2):
        t, state, mode = stick(BRAKE, "duty", u, y, end)
        assert (t, mode) == (end, 0)
        exact = (expm(generator * end) @ [*y, 1.0])[:7]
        np.testing.assert_allclose(state, exact, rtol=1e-11)


def test_time_of_breakaway() -> None:
    """The current rises exponentially; it breaks away at the current of eq. (19)."""
    y = [0.0, 7e-3 / BLOCK.k_g, 0.0, 0.0, 0.0, 0.0, 0.0]
    resistance, needed = BLOCK.R_m + BLOCK.R_bat * 0.01, BLOCK.T_pr / BLOCK.direction(1)[0]
    t, state, mode = stick(BLOCK, "duty", 0.1, y, 1e-3)
    exact = -BLOCK.L_m / resistance * math.log1p(-needed * resistance / 1.2)
    assert mode == 1
    assert t == pytest.approx(exact, rel=1e-8)
    assert state[0] == pytest.approx(needed, rel=1e-8)


def test_breakaway_between_two_times_at_which_it_sticks() -> None:
    """The pressure's load falls within microseconds, before the current has decayed."""
    x0 = balanced(BRAKE, 20.0 * BAR)
    needed = x0["i"] - excess(BRAKE, 1, x0["i"], x0["p_mc"]) / BRAKE.direction(1)[0]
    y = list((x0 | {"i": needed * 1.08, "p_mc": 23.0 * BAR}).values())
    t, state, mode = stick(BRAKE, "duty", 0.0, y, 1e-3)
    assert excess(BRAKE, 1, y[0], y[3]) < -1e-3
    assert mode == 1
    assert 1e-6 < t < 1e-5
    assert abs(excess(BRAKE, 1, state[0], state[3])) < 1e-11


@pytest.mark.parametrize("current", [-10.0, 19.0])
def test_refuses_to_leave_its_range(current: float) -> None:
    """Neither a negative pressure nor the end of the stroke is modeled."""
    with pytest.raises(ValueError, match="outside the model's range"):
        simulate(BRAKE, lambda k, t, s: current, 2.0, PERIOD, balanced(BRAKE, BAR), 2e-4, "current")
