"""The fit of cogging and friction to the torque of a shaft that turns slowly both ways."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bywire.core.typing import Array
from bywire.identification.confidence import uncertainty
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Problem
from bywire.identification.method import Check
from bywire.identification.unknown import Unknown

_LEVEL = 1e-3  # of a false alarm
_OTHER = 0.1  # of the cogging, that the friction's slope may leave to doubt
_FRICTION = ("T_forward", "T_backward", "friction_slope")
_FALSE = 1e-3  # chance that noise alone shows an order
_MOST = 8


@dataclass(frozen=True)
class Turning:
    """A shaft that turns slowly, sample by sample, shapes (n,).

    ``angle``: [rad]; ``way``: 1 forward, -1 backward; ``speed``: magnitude [rad/s]; ``torque``: of
    the motor, less what accelerates the inertia [N m]; ``waves``: ``waves(order) -> (cosine,
    sine)`` of the angle, filtered like the torque.
    """

    angle: Array
    way: Array
    speed: Array
    torque: Array
    waves: Callable[[int], tuple[Array, Array]]

    @cached_property
    def leveled(self) -> Array:
        """Torque less its mean of each way."""
        rest = self.torque.copy()
        for way in (1.0, -1.0):
            rest[self.way == way] -= rest[self.way == way].mean()
        return rest

    @cached_property
    def friction_columns(self) -> Array:
        """Forward, backward, and the speed's deviation from its mean of each way."""
        ways = [self.way == way for way in (1.0, -1.0)]
        ripple = sum(way * (self.speed - self.speed[way].mean()) for way in ways)
        return np.column_stack((1.0 * ways[0], -1.0 * ways[1], self.way * ripple))


@dataclass(frozen=True)
class CoggingFit:
    """What was fitted.

    ``turning``: to what; ``orders``: strongest first; ``estimate``: of ``cogging_problem``.
    """

    turning: Turning
    orders: tuple[int, ...]
    estimate: Estimate

    @property
    def friction(self) -> Array:
        """Friction torque, shape (n,)."""
        values = [self.estimate[n] if n in self.estimate.names else 0.0 for n in _FRICTION]
        return np.asarray(self.turning.friction_columns @ np.array(values))


def cogging_problem(turning: Turning, orders: tuple[int, ...]) -> Problem:
    """Return the fit as a problem of least squares.

    Unknowns are the friction both ways, its slope over speed, and amplitude and phase of every
    order; those of the first are ``motor_1.T_cog`` and ``phase``, else ``amplitude.N``,
    ``phase.N``.
    """
    waves = [turning.waves(order) for order in orders]
    columns = np.column_stack((turning.friction_columns, *(w for pair in waves for w in pair)))
    start = np.linalg.lstsq(columns, turning.torque, rcond=None)[0]
    scatter = float(np.std(turning.torque - columns @ start)) or 1.0
    level = float(np.abs(start[:2]).max())
    unknowns = [
        Unknown(name, float(start[k]), scale=level, unit="N*m")
        for k, name in enumerate(_FRICTION[:2])
    ]
    unknowns.append(Unknown(_FRICTION[2], float(start[2]), scale=level, unit="N*m*s/rad"))
    for k, order in enumerate(orders):
        c, s = start[3 + 2 * k : 5 + 2 * k]
        amplitude, phase = float(np.hypot(c, s)), float(np.arctan2(c, s))
        names = ("motor_1.T_cog", "phase") if k == 0 else (f"amplitude.{order}", f"phase.{order}")
        unknowns.append(Unknown(names[0], amplitude, low=0.0, scale=amplitude, unit="N*m"))
        unknowns.append(Unknown(names[1], phase, scale=1.0, unit="rad"))

    def evaluate(values: Array) -> tuple[Array, Array]:
        e = turning.friction_columns @ values[:3] - turning.torque
        J = [turning.friction_columns]
        for k, (cosine, sine) in enumerate(waves):
            amplitude, phase = values[3 + 2 * k : 5 + 2 * k]
            wave = np.cos(phase) * sine + np.sin(phase) * cosine
            turned = np.cos(phase) * cosine - np.sin(phase) * sine
            e = e + amplitude * wave
            J.append(np.column_stack((wave, amplitude * turned)))
        return e / scatter, np.hstack(J) / scatter

    return Problem(tuple(unknowns), evaluate)


def same_both_ways(cogging: CoggingFit) -> Check:
    r"""Return whether the main order changes with the direction, as cogging does not.

    Two more columns, cosine and sine with the sign of the direction, on what is left over: their
    coefficients c over their covariance C, :math:`c^T C^{-1} c / 2`, is of size one where friction
    does not depend on the angle.
    """
    from scipy import stats

    turning = cogging.turning
    cosine, sine = turning.waves(cogging.orders[0])
    columns = np.column_stack((turning.way * cosine, turning.way * sine))
    e = cogging.estimate.residuals
    c = np.linalg.lstsq(columns, e, rcond=None)[0]
    sure = uncertainty(columns, e - columns @ c)
    value = 0.5 * float(c @ np.linalg.solve(sure.covariance, c))
    limit = float(stats.f.isf(_LEVEL, 2, max(sure.freedom, 1.0)))
    note = "main order that changes its sign with the direction, over its noise: angular friction"
    return Check("cogging_same_both_ways", value, limit=limit, note=note)


def slope_as_known(cogging: CoggingFit, known: float) -> Check:
    """Return how much of the ripple is left to a slope of the friction that is not the known one.

    Friction that depends on the angle, and friction that falls with the speed while cogging makes
    the speed ripple, look alike: what the fit gives to the slope beyond the known one may be
    either.

    ``known``: slope of the friction over speed by its law [N m s/rad].
    """
    fit = cogging.estimate
    slope = fit["friction_slope"] if "friction_slope" in fit.names else known
    ripple = float(np.sqrt(2.0) * np.std(cogging.turning.friction_columns[:, 2]))
    share = abs(slope - known) * ripple / max(fit["motor_1.T_cog"], 1e-300)
    note = "ripple given to the friction's slope beyond its law, over the cogging: angular friction"
    return Check("slope_beyond_law", share, limit=_OTHER, note=note)


def amplitudes(angle: Array, torque: Array, highest: int) -> Array:
    """Return the amplitude of every order 1 .. highest, each fitted alone, shape (highest,).

    Parameters
    ----------
    angle
        [rad], shape (n,); spread evenly over whole revolutions, or nearly so.
    torque
        Its mean taken off, shape (n,).
    """
    sizes = np.empty(highest)
    turn = np.exp(-1j * angle)
    wave = np.ones_like(turn)
    for order in range(highest):
        wave = wave * turn
        sizes[order] = 2.0 * abs(np.mean(wave * torque))
    return sizes


def standing_out(angle: Array, torque: Array, highest: int) -> tuple[int, ...]:
    """Return the orders that stand out of the noise, strongest first.

    The power of noise at an order is distributed exponentially, and its mean is the median over
    all orders by log 2; what exceeds it more than chance lets any order do counts. One after the
    other is taken off, so that a strong one does not leak into others.
    """
    left, orders = torque - torque.mean(), list[int]()
    limit = math.log(highest / _FALSE) / math.log(2.0)
    while len(orders) < _MOST:
        power = amplitudes(angle, left, highest) ** 2
        best = int(np.argmax(power)) + 1
        if best in orders or power[best - 1] <= limit * float(np.median(power)):
            break
        orders.append(best)
        A = np.column_stack([f(n * angle) for n in orders for f in (np.cos, np.sin)])
        A = np.column_stack((np.ones(angle.size), A))
        left = torque - A @ np.linalg.lstsq(A, torque, rcond=None)[0]
    return tuple(orders)
