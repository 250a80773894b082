"""A mass on springs that slip, by SciPy: one smooth piece of time after another.

A piece ends at a tick, where a spring begins to slip, and where the mass turns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from systems.maxwell_slip import Parameters

Array = NDArray[np.float64]


def maxwell_slip(
    par: Parameters, force: Callable[[float], float], duration: float, record: Sequence[float]
) -> Array:
    """Return position, velocity, deflections and loss at ticks, shape (times, 7), from rest.

    Parameters
    ----------
    force
        Force in the interval that begins at a tick.
    record
        Times of ticks.
    """
    k = np.array(par.stiffnesses)
    W = np.array(par.slip_forces)
    y, direction = np.zeros(7), 0.0
    slips = np.zeros(len(k), dtype=bool)
    rows = [y.copy()]
    for tick in range(round(duration / par.T_s)):
        t, end, F = tick * par.T_s, (tick + 1) * par.T_s, force(tick * par.T_s)
        while t < end:
            direction = direction or np.sign(F - par.k * y[0] - k @ y[2:6])
            if not direction:  # nothing moves yet
                break
            held = slips.copy()

            def rates(t: float, y: Array, held: Array = held, F: float = F) -> Array:
                moving = np.where(held, 0.0, y[1])
                loss = float(np.sum(W[held])) * abs(y[1])
                acceleration = (F - par.k * y[0] - k @ y[2:6]) / par.m
                return np.array([y[1], acceleration, *moving, loss])

            def turns(t: float, y: Array, direction: float = direction) -> float:
                return float(y[1] * direction)

            turns.terminal, turns.direction = True, -1.0  # type: ignore[attr-defined]
            events = [turns]
            for j in np.flatnonzero(~held):

                def full(t: float, y: Array, j: int = j, direction: float = direction) -> float:
                    return float(direction * y[2 + j] - W[j] / k[j])

                full.terminal, full.direction = True, 1.0  # type: ignore[attr-defined]
                events.append(full)
            part = solve_ivp(
                rates,
                (t, end),
                y,
                "DOP853",
                events=events,
                rtol=1e-12,
                atol=1e-15,
                max_step=par.T_s / 50,
            )
            t, y = part.t[-1], part.y[:, -1]
            if part.t_events[0].size:
                y[1], direction = 0.0, -direction
                slips[:] = False
            elif any(found.size for found in part.t_events):
                # Springs that began to turn together are full together.
                slips |= direction * y[2:6] >= (1.0 - 1e-9) * W / k
                y[2:6] = np.where(slips, direction * W / k, y[2:6])
        rows.append(y.copy())
    at = np.rint(np.asarray(record) / par.T_s).astype(int)
    return np.array(rows)[at]
