"""Velocity reversals through dry friction, and what they do to neighboring motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bywire.core.typing import Array


@dataclass(frozen=True)
class Reversal:
    """A velocity passes through zero without resting.

    Parameters
    ----------
    substep
        Number of the substep in which it passes, or stands for this one substep.
    friction
        Number of the friction.
    factor
        Acceleration after over acceleration before.
    """

    substep: int
    friction: int
    factor: float


def reversals(velocities: Array) -> list[Reversal]:
    r"""Return where a periodic motion reverses without resting.

    At a reversal at the time :math:`t_r` the friction turns around, and the acceleration jumps
    from :math:`a^-` to :math:`a^+`. A neighboring motion reverses :math:`\delta t = -\delta v /
    a^-` later: behind it,

    .. math:: \delta v^+ = \frac{a^+}{a^-} \delta v^-

    A motion computed in steps gives that only in the mean: depending on where in a substep it
    passes, it slips through (:math:`\delta v^+ = \delta v^-`) or stands for one substep
    (:math:`\delta v^+ = 0`). Whoever wants derivatives must put the factor in.

    Parameters
    ----------
    velocities
        Velocity of every friction after each substep of one period, shape (substeps, frictions);
        exactly 0 where it sticks.

    Returns
    -------
    list of Reversal
        In the order of time. Who rests for two substeps or more sticks: its velocity forgets what
        was before, in steps as in continuous time.

    References
    ----------
    R. I. Leine, H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems,
    Springer 2004, chapter 7 (saltation matrix).
    """
    found = []
    for f in range(velocities.shape[1]):
        v = velocities[:, f]
        for k in range(v.size):
            before, now, after = v[k - 1], v[k], v[(k + 1) % v.size]
            passes = before * now < 0.0
            stands = now == 0.0 and before * after < 0.0
            if passes or stands:
                factor = _factor(np.take(v, range(k - 3, k + 3), mode="wrap"), passes)
                found += [] if factor is None else [Reversal(k, f, factor)]
    return sorted(found, key=lambda one: one.substep)


def _factor(v: Array, passes: bool) -> float | None:
    """Return acceleration after over before, both carried on straight to the reversal.

    None where the motion rests nearby: then they are not known.

    Parameters
    ----------
    v
        Velocities after six substeps, the reversal in the fourth of them.
    """
    steps = np.diff(v)  # of substeps 1, 2, 3 (the reversal), 4, 5
    if v[0] * v[1] <= 0.0 or v[1] * v[2] <= 0.0 or v[4] * v[5] <= 0.0:
        return None
    early = min(-v[2] / steps[1], 1.0)  # when the velocity passes zero, within its substep
    a_before = steps[1] + (steps[1] - steps[0]) * (0.5 + early)
    a_after = steps[3] - (steps[4] - steps[3]) * (1.5 - early if passes else 0.5)
    return float(a_after / a_before)
