"""A computed slip moved in time to where it lies best on the measured one."""

from __future__ import annotations

import numpy as np

from bywire.brakes.motorcycle.methods.stick_slip.shots import LEAD, Shot
from bywire.brakes.motorcycle.methods.stick_slip.slips import Slip
from bywire.core.typing import Array

_ROUNDS = 12  # of Newton


def overlaid(shot: Shot, p: Array) -> tuple[Array, Array, float]:
    """Return computed less measured pressure, the computed speed, and the shift between them.

    Parameters
    ----------
    p
        Computed pressure [Pa], shape (n,); moved in time to where it lies best.
    """
    shift = best_shift(shot, p, shot.time.size)
    r, v = _laid_over(shot, p, shift)
    return r, v, shift


def best_shift(shot: Shot, p: Array, rows: int) -> float:
    """Return by how much later the computed slip lies on the measured one [s] (Gauss, Newton).

    Compared are the first rows.
    """
    t = shot.clock
    shift = _half_way(t, shot.pressure, shot.slip) - _half_way(t, p, shot.slip)
    for _ in range(_ROUNDS):
        r, v = (part[:rows] for part in _laid_over(shot, p, shift))
        size = float(v @ v)
        if size == 0.0:
            break
        change = float(v @ r) / size
        shift += float(np.clip(change, -LEAD, LEAD))
        if abs(change) < 1e-9:
            break
    return shift


def _laid_over(shot: Shot, p: Array, shift: float) -> tuple[Array, Array]:
    """Return computed less measured pressure with the computed one later, and its speed."""
    t = shot.clock
    at = t - shift
    v = np.interp(at, t, np.gradient(p, shot.interval))
    v[(at <= 0.0) | (at >= t[-1])] = 0.0
    return np.interp(at, t, p) - shot.pressure, v


def _half_way(t: Array, p: Array, slip: Slip) -> float:
    """Return when a slip has gone half of its way [s]."""
    middle = 0.5 * (p[0] + p[-1])
    beyond = np.flatnonzero(slip.direction * (p - middle) > 0.0)
    return float(t[beyond[0]]) if beyond.size else float(t[-1])
