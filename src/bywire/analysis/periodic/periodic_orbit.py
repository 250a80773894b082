"""Operating points that are periodic: what a dithered brake settles to."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bywire.core.errors import ParameterError, SolverError
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.simulation.run import Run
from bywire.simulation.stroboscope import Stroboscope

TOLERANCE = 1e-5
"""distance from the orbit that counts as none, over the usual magnitude of each signal; steps of
time leave motions with stick and slip a play of their own"""
DRIFT = 1e-5
"""drift per period along directions without restoring action, in the same measure"""
_SETTLE, _ROUNDS, _NEWTON = 50, 12, 8  # periods simulated between trials of Newton's iteration
_NEUTRAL = 1e-7  # of the largest singular value: directions along which orbits lie side by side


@dataclass(frozen=True, eq=False)
class PeriodicOrbit:
    """A motion that repeats itself.

    Parameters
    ----------
    stroboscope
        The map from period to period.
    start
        What the engine carries at the beginning of a period, shape (n,).
    rows
        Recorded signals over the period, its end left out, shape (rows, signals).
    distance
        Estimated distance of ``start`` from the orbit, over the usual magnitude of each signal:
        Newton's next step.
    drift
        Change over a period that no step undoes, in the same measure: directions along which
        nothing is restored, such as the amount of fluid enclosed.
    stuck
        Share of the time in which every dry friction sticks; 0 where there is none.
    periods
        Periods that were simulated to find it.
    """

    stroboscope: Stroboscope
    start: Array
    rows: Array
    distance: float
    drift: float
    stuck: float
    periods: int


def period_of(frequencies: Sequence[float], intervals: Sequence[float], step: float) -> float:
    """Return the shortest time [s] that holds whole sample times and whole periods.

    Parameters
    ----------
    frequencies
        Of what is periodic [Hz]; may be none.
    intervals
        Sample times [s].
    step
        Substep [s].

    Raises
    ------
    ParameterError
        When a frequency's period is no whole number of substeps.
    """
    wanted = [*intervals, *(1.0 / f for f in frequencies)]
    counts = [round(interval / step) for interval in wanted]
    for f in frequencies:
        count = 1.0 / (f * step)
        if abs(count - round(count)) > 1e-6 * count:
            raise ParameterError(
                f"a period of 1/({f:g} Hz) = {1e3 / f:.6g} ms is no whole number of substeps of "
                f"{step * 1e6:g} us, and never repeats with them: take a frequency that divides "
                "the sample rate"
            )
    return math.lcm(*counts) * step


def find_orbit(stroboscope: Stroboscope, run: Run) -> PeriodicOrbit:
    r"""Return the orbit that the system settles to.

    Period after period is simulated. In between Newton's iteration with the exact derivative A of
    the map P tries

    .. math:: (I - A) \Delta z = P(z) - z

    and is kept where it brings the motion closer to a repetition: a slow loop needs minutes to
    settle to what that finds in a few periods. Directions without restoring action (the amount
    of fluid enclosed, for instance) stay where the simulation brought them.

    Parameters
    ----------
    stroboscope
        The map.
    run
        What the map was made of: its signals' usual magnitudes scale all changes.

    Raises
    ------
    SolverError
        When no motion repeats itself: it hunts, drifts, or sticks and slips out of step.
    """
    scale = magnitudes(run)
    z, periods = stroboscope.start, 0
    for _ in range(_ROUNDS):
        for _ in range(_SETTLE):
            z = stroboscope.advance(z).end
        candidate = _polished(stroboscope, z, scale)
        periods += _SETTLE + candidate.periods
        z = candidate.start
        if candidate.distance <= TOLERANCE and candidate.drift <= DRIFT:
            rows = stroboscope.advance(z).rows
            v = stroboscope.velocities(z)
            stuck = float(np.mean((v == 0.0).all(axis=1))) if v.size else 0.0
            return PeriodicOrbit(
                stroboscope, z, rows, candidate.distance, candidate.drift, stuck, periods
            )
    apart = np.abs((stroboscope.advance(z).end - z) / scale)
    raise SolverError(
        f"{run.model.name}: no motion repeats itself with the period {run.duration * 1e3:g} ms: "
        f"after {periods} periods {stroboscope.names[int(np.argmax(apart))]} still changes by "
        f"{apart.max():.2g} of its usual magnitude per period; it hunts or drifts, as a loop does "
        "whose dither is too weak to keep it moving: raise the dither's gain, or move the "
        "operating point"
    )


@dataclass(frozen=True)
class _Tried:
    """A candidate: its distance from the orbit, its drift over a period, periods that it took."""

    start: Array
    distance: float
    drift: float
    periods: int


def _polished(stroboscope: Stroboscope, z: Array, scale: Array) -> _Tried:
    """Return where Newton's iteration ends, as far as it comes closer to a repetition."""
    distance, drift, step = _judged(stroboscope, z, scale)
    for taken in range(_NEWTON):
        if distance <= 1e-2 * TOLERANCE:
            return _Tried(z, distance, drift, taken)
        moved = _judged(stroboscope, z + step, scale)
        if not moved[0] < 0.5 * distance:  # no number fails, too
            return _Tried(z, distance, drift, taken + 1)
        z = z + step
        distance, drift, step = moved
    return _Tried(z, distance, drift, _NEWTON)


def _judged(stroboscope: Stroboscope, z: Array, scale: Array) -> tuple[float, float, Array]:
    """Return the distance from the orbit, the drift that no step undoes, and Newton's step."""
    residual = stroboscope.advance(z).end - z
    A = stroboscope.derivatives(z).A
    step = restored(A, residual, scale)
    drift = residual - (step - A @ step)
    return float(np.max(np.abs(step / scale))), float(np.max(np.abs(drift / scale))), step


def restored(A: Array, residual: Array, scale: Array) -> Array:
    """Return the smallest x for which (I - A) x is the residual, carried values left alone.

    Parameters
    ----------
    A
        Derivative of a map over one period, shape (n, n).
    residual
        Shape (n,).
    scale
        Usual magnitudes, shape (n,).
    """
    n = len(A)
    eye = np.eye(n)
    moving = np.flatnonzero((eye != A).any(axis=1))  # the others keep their value for ever
    gap = (eye - A)[np.ix_(moving, moving)] * scale[moving] / scale[moving, None]
    step = np.zeros(n)
    scaled = np.linalg.lstsq(gap, residual[moving] / scale[moving], rcond=_NEUTRAL)[0]
    step[moving] = scaled * scale[moving]
    return step


def magnitudes(run: Run) -> Array:
    """Return the usual magnitudes of states, their increments, and memory, shape (n,)."""
    states = [signal.nominal for signal in signals_of(run.model.State).values()]
    held = [signal.nominal for signal in signals_of(run.model.Memory).values()]
    return np.array([*states, *states, *held])
