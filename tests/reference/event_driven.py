"""Event-driven reference for the plant of the electro-mechanical motorcycle brake.

Stick, slip+ and slip- are explicit modes; every change of mode is located to round-off. Stuck,
the plant is linear and is propagated in closed form. Slipping, it is smooth and is integrated by
the three-stage Radau IIA method (order 5, L-stable) with a full Newton iteration. It shares no
code with the package. Valid for p_mc >= 0 and between the end stops.

Equation numbers: A. Dardanelli, G. Alli, S. M. Savaresi, "Modeling and control of an
electro-mechanical brake-by-wire actuator for a sport motorbike", IFAC Mechatronic Systems, 2010.
Radau IIA: E. Hairer, G. Wanner, "Solving Ordinary Differential Equations II", section IV.8.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

STATES = ("i", "theta", "omega", "p_mc", "p_pd", "p_f", "i_f")
Source = Literal["duty", "current"]
Controller = Callable[[int, float, dict[str, float]], float]
# Derivative, Jacobian, and what must stay positive in this mode.
Field = Callable[[list[float]], tuple[list[float], list[list[float]], tuple[float, float]]]

TORQUE_TOL = 1e-12  # N m, far below the friction (2e-3) and far above its round-off (1e-17)
NEWTON_TOL = 1e-6  # of SCALE; the error left after the last iteration is about its square
SCALE = np.array([1.0, 1.0, 1.0, 1e5, 1e5, 1e5, 1.0])
REFINEMENT = 15.0  # how many more steps per time where the Stribeck curve is steep

# Collocation at the nodes c: the inverse of the matrix a_ij of the method.
RADAU_C = np.array([(4.0 - math.sqrt(6.0)) / 10.0, (4.0 + math.sqrt(6.0)) / 10.0, 1.0])
_INTEGRALS = np.stack([RADAU_C, RADAU_C**2 / 2.0, RADAU_C**3 / 3.0], axis=1)
RADAU_INVERSE = np.vander(RADAU_C, increasing=True) @ np.linalg.inv(_INTEGRALS)
RADAU_BLOCKS = np.kron(RADAU_INVERSE, np.eye(len(STATES)))


@dataclass(frozen=True)
class Plant:
    """Parameters of eqs. (1), (8), (9), (11), (12), (16) in SI, named as in the paper.

    `gear`: eq. (8) as printed ("paper"), or a gear that loses power both ways ("directional").
    """

    R_m: float
    L_m: float
    K_e: float
    V_bat: float
    R_bat: float
    eta_g: float
    J_mot: float
    k_g: float
    M_mc: float
    k_damp: float
    A_mc: float
    s_mc: float
    beta: float
    nu: float
    rho: float
    L_pl: float
    d_pl: float
    A_pd: float
    K_pd: float
    f_aa: float
    T_pr: float
    f_cfr_p: float
    f_cfr_n: float
    k_brk_p: float
    k_brk_n: float
    c: float
    mu_T: float
    gear: Literal["paper", "directional"] = "paper"

    @cached_property
    def K_lf(self) -> float:
        """Laminar resistance of the pipeline, eq. (12)."""
        area = math.pi * self.d_pl**2 / 4.0
        return 32.0 * self.nu * self.rho * math.pi * self.L_pl / area**2

    def direction(self, sigma: int) -> tuple[float, float, float, float, float]:
        """Return torque per current, gear loss, M', breakaway factor and Coulomb slope."""
        eta, loss = (self.eta_g, 0.0) if self.gear == "paper" else (1.0, 1.0 / self.eta_g - 1.0)
        k_brk, f_cfr = (self.k_brk_p, self.f_cfr_p) if sigma > 0 else (self.k_brk_n, self.f_cfr_n)
        return eta * self.K_e, loss, eta * self.J_mot + self.k_g**2 * self.M_mc, k_brk, f_cfr

    def pressure_rates(self, theta: float) -> tuple[float, float]:
        """Return beta/(V_mc K_lf) of eq. (9) and K_pd/(A_pd^2 K_lf) of eq. (11)."""
        volume = self.A_mc * (self.s_mc - self.k_g * theta)
        return self.beta / (volume * self.K_lf), self.K_pd / (self.A_pd**2 * self.K_lf)


def excess(plant: Plant, sigma: int, i: float, p: float) -> float:
    """Torque at rest beyond breakaway in direction `sigma`, eqs. (8), (16), (18)."""
    k_t, loss, _, k_brk, f_cfr = plant.direction(sigma)
    load = plant.k_g * plant.A_mc * p
    seal = k_brk * (plant.T_pr + f_cfr * p)
    return sigma * (k_t * i - load) - seal - loss * abs(load + sigma * seal)


def _filtered(w: float, rate: float, limit: float, gap: float, y0: float, t: float) -> float:
    """Return the output of a low-pass of rate w whose input is limit + gap exp(-rate t)."""
    apart = abs(w - rate)
    lag = t if apart * t < 1e-12 else -math.expm1(-apart * t) / apart
    return limit + (y0 - limit) * math.exp(-w * t) + gap * w * math.exp(-min(w, rate) * t) * lag


def stick(
    plant: Plant, source: Source, u: float, y: list[float], end: float
) -> tuple[float, list[float], int]:
    """Return time (at most `end`), state and mode at the end of a stuck phase from `y`.

    With theta and u held, eqs. (1), (9), (11) give i = i_inf + di exp(-a t) and
    p_mc = p_inf + dp exp(-r t), so that the torque turns at most once.
    """
    resistance, (b, c) = plant.R_m + plant.R_bat * u * u, plant.pressure_rates(y[1])
    duty = source == "duty"
    a, i_inf = (resistance / plant.L_m, u * plant.V_bat / resistance) if duty else (0.0, y[0])
    r, p_inf = b + c, (c * y[3] + b * y[4]) / (b + c)
    di, dp, dp_pd, w = y[0] - i_inf, y[3] - p_inf, y[4] - p_inf, 2.0 * math.pi * plant.f_aa

    def margin(t: float, sigma: int) -> float:
        i, p = i_inf + di * math.exp(-a * t), p_inf + dp * math.exp(-r * t)
        return TORQUE_TOL - excess(plant, sigma, i, p)

    found = [(end, 0)]
    for sigma in (1, -1):
        # The excess is linear in p, so a difference is its slope: exact but for the kink of the
        # directional gear, which would have to lie within dp, the few Pa that a slip leaves.
        by_i = a * di * sigma * plant.direction(sigma)[0]
        by_p = excess(plant, sigma, 0.0, p_inf + 1.0) - excess(plant, sigma, 0.0, p_inf)
        by_p *= r * dp
        times = [0.0, end]
        if by_i * by_p < 0.0 and a != r:
            times.insert(1, min(max(math.log(-by_p / by_i) / (r - a), 0.0), end))
        k = next((k for k, t in enumerate(times) if margin(t, sigma) < 0.0), None)
        if k is not None:
            root = brentq(margin, times[k - 1], times[k], (sigma,), xtol=1e-16) if k else 0.0
            found.append((float(root), sigma))
    t, mode = min(found)
    decay, i = math.exp(-r * t), i_inf + di * math.exp(-a * t)
    p_f, i_f = _filtered(w, r, p_inf, dp, y[5], t), _filtered(w, a, i_inf, di, y[6], t)
    return t, [i, y[1], 0.0, p_inf + dp * decay, p_inf + dp_pd * decay, p_f, i_f], mode


def slip_field(plant: Plant, source: Source, u: float, sigma: int, start: list[float]) -> Field:
    """Return the smooth motion in direction `sigma` from `start`: eqs. (1), (8), (9), (11), (16).

    The torque through the gear, which "directional" takes absolute, keeps its sign. The friction
    is continued smoothly to the other sign of omega, so that events can be bracketed.
    """
    k_t, loss, inertia, k_brk, f_cfr = plant.direction(sigma)
    electric = 1.0 / plant.L_m if source == "duty" else 0.0
    i_i = -electric * (plant.R_m + plant.R_bat * u * u)
    area, damping = plant.k_g * plant.A_mc, plant.k_damp * plant.k_g**2
    w = 2.0 * math.pi * plant.f_aa

    def torques(omega: float, p: float) -> tuple[float, float, float, float]:
        fall = (k_brk - 1.0) * math.exp(-plant.c * sigma * omega)
        coulomb = plant.T_pr + f_cfr * p
        seal = coulomb * (1.0 + fall) + plant.mu_T * sigma * omega
        return area * p + damping * omega, seal, fall, coulomb

    load, seal, _, _ = torques(start[2], start[3])
    branch = 1.0 if load + sigma * seal >= 0.0 else -1.0
    by_load, by_seal = 1.0 + sigma * branch * loss, sigma + branch * loss

    def field(y: list[float]) -> tuple[list[float], list[list[float]], tuple[float, float]]:
        i, theta, omega, p, p_pd, p_f, i_f = y
        load, seal, fall, coulomb = torques(omega, p)
        b, c = plant.pressure_rates(theta)
        swept = b * plant.K_lf * area
        p_dot = swept * omega - b * (p - p_pd)
        f = [
            electric * (u * plant.V_bat - plant.K_e * omega) + i_i * i,  # (1)
            omega,
            (k_t * i - by_load * load - by_seal * seal) / inertia,  # (8), (16)
            p_dot,  # (9)
            c * (p - p_pd),  # (11)
            w * (p - p_f),
            w * (i - i_f),
        ]
        by_omega = by_load * damping + by_seal * sigma * (plant.mu_T - plant.c * coulomb * fall)
        omega_p = -(by_load * area + by_seal * f_cfr * (1.0 + fall)) / inertia
        p_theta = p_dot * plant.k_g / (plant.s_mc - plant.k_g * theta)
        jacobian = [
            [i_i, 0.0, -electric * plant.K_e, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            [k_t / inertia, 0.0, -by_omega / inertia, omega_p, 0.0, 0.0, 0.0],
            [0.0, p_theta, swept, -b, b, 0.0, 0.0],
            [0.0, 0.0, 0.0, c, -c, 0.0, 0.0],
            [0.0, 0.0, 0.0, w, 0.0, -w, 0.0],
            [w, 0.0, 0.0, 0.0, 0.0, 0.0, -w],
        ]
        # An event is where the sign is safely the other, so that the next step starts with it.
        through_gear = branch * (load + sigma * seal) + TORQUE_TOL if loss else 1.0
        return f, jacobian, (sigma * omega, through_gear)

    return field


def radau_step(field: Field, y: list[float], h: float) -> list[list[float]]:
    """Return the states at the three stages of one Radau IIA step; the last is the new state."""
    start, z = np.array(y), np.zeros((3, len(y)))
    for _ in range(20):
        residual, matrix = -RADAU_INVERSE @ z / h, RADAU_BLOCKS / h
        for k, stage in enumerate((start + z).tolist()):
            f, jacobian, _ = field(stage)
            block = slice(k * len(y), (k + 1) * len(y))
            residual[k] += f
            matrix[block, block] -= jacobian
        update = np.linalg.solve(matrix, residual.ravel()).reshape(z.shape)
        z += update
        if np.abs(update / SCALE).max() < NEWTON_TOL:
            stages: list[list[float]] = (start + z).tolist()
            return stages
    raise RuntimeError(f"Radau IIA: no convergence with h = {h} s from {y}")


def slip_step(field: Field, y: list[float], h: float) -> tuple[float, list[float], bool]:
    """Step by `h`, or to the first event before it: time taken, state, whether it is at rest."""
    stages = radau_step(field, y, h)
    hit = next((k for k, stage in enumerate(stages) if min(field(stage)[2]) <= 0.0), None)
    if hit is None:
        return h, stages[-1], False
    h *= float(RADAU_C[hit])

    def margin(x: float, k: int) -> float:
        if x == 0.0:  # margins are positive at 0+, also where omega starts at exactly zero
            return max(field(y)[2][k], 1e-300)
        return field(radau_step(field, y, x)[-1])[2][k]

    # None is left if a stage, which is of lower order, has reported an event falsely.
    roots = [(brentq(margin, 0.0, h, (k,), xtol=1e-15), k) for k in (0, 1) if margin(h, k) <= 0.0]
    t, event = min(roots, default=(h, 1))
    y = radau_step(field, y, t)[-1]
    if event == 0:
        y[2] = 0.0
    return t, y, event == 0


def advance(
    plant: Plant, source: Source, u: float, y: list[float], mode: int, duration: float, step: float
) -> tuple[list[float], int, int]:
    """Hold `u` through as many modes as it takes: state, mode, and number of mode changes."""
    left, changes = duration, 0
    while left > 1e-15:
        before = mode
        if mode == 0:
            t, y, mode = stick(plant, source, u, y, left)
        else:
            field = slip_field(plant, source, u, mode, y)
            # The falling Stribeck branch grows like exp(t / 60 us) and ends within 1/c of rest.
            speed = max(0.0, abs(y[2]) - abs(field(y)[0][2]) * step)
            h = step / (1.0 + REFINEMENT * math.exp(-plant.c * speed))
            t, y, at_rest = slip_step(field, y, left / math.ceil(left / h))
            mode = 0 if at_rest else mode
        left -= t
        changes += mode != before
        x = plant.k_g * y[1]
        if y[3] < -1e-3 or not -1e-12 <= x < plant.s_mc:
            raise ValueError(f"p_mc = {y[3]} Pa, x_mc = {x} m: outside the model's range")
    return y, mode, changes


def simulate(
    plant: Plant,
    controller: Controller,
    t_end: float,
    period: float,
    x0: Mapping[str, float],
    step: float,
    source: Source = "duty",
) -> dict[str, NDArray[Any]]:
    """Simulate the plant under `controller(k, t, state)`, called at t = k period.

    It returns the input to hold for one period: the duty cycle or, if `source` is "current", the
    current itself. `x0` has each of `STATES`, at rest if omega is exactly 0. All steps while
    slipping are proportional to `step`, the largest. The result has `t`, each of `STATES` and
    `stuck` at 0, period, ..., t_end, just before the input changes; `u`, the held inputs (one
    fewer); `mode_changes`, their number (a reversal passes through stick and counts as two).
    """
    y = [float(x0[name]) for name in STATES]
    mode, changes = (y[2] > 0.0) - (y[2] < 0.0), 0
    rows, stuck, held = [y], [mode == 0], []
    for k in range(round(t_end / period)):
        u = float(controller(k, k * period, dict(zip(STATES, y, strict=True))))
        if source == "current":
            y = [u, *y[1:]]
        y, mode, more = advance(plant, source, u, y, mode, period, step)
        changes += more
        rows.append(y)
        stuck.append(mode == 0)
        held.append(u)
    result = dict(zip(STATES, np.array(rows).T, strict=True))
    result |= {"t": period * np.arange(len(rows)), "stuck": np.array(stuck), "u": np.array(held)}
    return result | {"mode_changes": np.array(changes)}
