"""Reduced linear models whose error is stated: balanced or modal."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.reduction.balancing import Choice, Matrices, balanced, lasting, split
from bywire.analysis.reduction.error import ReductionError, natural, reduction_error
from bywire.analysis.reduction.residualized import residualized
from bywire.core.errors import ParameterError
from bywire.core.typing import Array

Method = Literal["balanced", "modal"]

_DEAD = 1e-12  # poles of sampled models below it are dead beats
_NEAR_REST = 1e-6  # frequency that stands for rest [Hz]

TOLERANCE = 0.01
"""relative error over the band that is admissible where nothing else is said"""
_FAR = 1e3  # of the fastest corner: a response so far beyond it is rounding


@dataclass(frozen=True, eq=False)
class Reduced:
    """A reduced model, and what it leaves out.

    Parameters
    ----------
    model
        Same signals, fewer states.
    error
        Measured over a band.
    kept
        Number of its states that are unstable or on the border of stability, and always kept.
    hankel
        Hankel singular values of the rest of the full model, every signal in units of its
        largest response; shape (n,). Empty where they were not needed.
    bound
        What no response of the reduced model is further off at any frequency, in SI units,
        shape (outputs, inputs): twice the sum of the singular values left out. NaN where the
        method has no such bound.
    """

    model: LinearModel
    error: ReductionError
    kept: int
    hankel: Array
    bound: Array


def reduce(
    model: LinearModel,
    *,
    order: int | None = None,
    band: float | None = None,
    tolerance: float = TOLERANCE,
    method: Method = "balanced",
) -> Reduced:
    """Return a model with fewer states, of a given order or as good as a band asks for.

    Parameters
    ----------
    model
        Continuous or sampled, stable or not: integrators, undamped swings and unstable poles
        are split off first and kept.
    order
        Number of states; as few as `tolerance` allows where it is not given.
    band
        Frequency [Hz] up to which the error counts; by default that of the fastest pole, or 0.4
        of the sampling frequency (at half of it many a sampled model has a zero).
    tolerance
        Admissible relative error over the band, where no order is given.
    method
        ``"balanced"``: states that show least are taken as always at rest (singular perturbation
        of the balanced realization: exact at rest, with a bound at every frequency).
        ``"modal"``: the same with the fastest modes; the poles that are kept are those of the
        model.

    Raises
    ------
    ParameterError
        When order, band or tolerance are out of range, or no order meets the tolerance.

    References
    ----------
    Y. Liu, B. D. O. Anderson, "Singular perturbation approximation of balanced systems",
    International Journal of Control 50 (1989): bound and exactness at rest.
    """
    # What no input moves stays at the operating point; what no output sees may go.
    acting = [model.states[k] for k in model.effective()]
    full = model.reduced(acting, held=True)
    high, n = _band(full, band), len(acting)
    if not acting:
        raise ParameterError(
            f"{full.name}: no input reaches an output (what sticks does not move): there is "
            "nothing to reduce"
        )
    lasts = lasting(full)
    kept = sum(lasts(pole) for pole in full.poles())
    least = max(kept, 1)
    if order is not None and not least <= order <= n:
        raise ParameterError(
            f"order = {order} is not admissible: {full.name} has {n} states that act, {kept} of "
            f"them unstable or on the border of stability: it must be >= {least} and <= {n}"
        )
    if not 0.0 < tolerance < 1.0:
        raise ParameterError(f"tolerance = {tolerance:g} is not admissible: it must be > 0 and < 1")
    rungs = _balanced(full) if method == "balanced" else _modal(full)
    best = math.inf
    for size in range(least, n + 1) if order is None else (order,):
        rung = rungs(size)
        error = reduction_error(full, rung.model, high)
        if order is not None or error.relative <= tolerance:
            return Reduced(rung.model, error, kept, rung.hankel, rung.bound)
        best = min(best, error.relative)
    raise ParameterError(
        f"{full.name}: no order is within {100.0 * tolerance:g} % up to {high:g} Hz, the best is "
        f"{100.0 * best:.2g} % off; allow more, or take a lower band"
    )


@dataclass(frozen=True, eq=False)
class _Rung:
    """A model of one order, and what is known of it without looking at its response."""

    model: LinearModel
    hankel: Array
    bound: Array


def _balanced(full: LinearModel) -> Callable[[int], _Rung]:
    """Return the balanced reduction to any order."""
    parts = split(full, lasting(full))
    fixed = len(parts.first[0])
    A, B, C = parts.second
    rows, columns = _peaks(parts.second, full)
    realization = balanced((A, B / columns, C / rows[:, None]), full.period)
    second = (realization.A, realization.B * columns, realization.C * rows[:, None])
    whole = _joined(full, parts.first, second)

    def at(order: int) -> _Rung:
        reduced = residualized(whole, whole.states[:order])
        tail = realization.hankel[max(order - fixed, 0) :]
        bound = 2.0 * float(tail.sum()) * np.outer(rows, columns)
        return _Rung(reduced, realization.hankel, bound)

    return at


def _modal(full: LinearModel) -> Callable[[int], _Rung]:
    """Return the reduction to the slowest modes, pairs whole, the others at rest."""
    lasts = lasting(full)
    sizes = np.sort([_rate(pole, full, lasts) for pole in full.poles()])

    def at(order: int) -> _Rung:
        limit = (1.0 + 1e-9) * sizes[order - 1]
        parts = split(full, lambda pole: _rate(pole, full, lasts) <= limit)
        whole = _joined(full, parts.first, parts.second)
        reduced = residualized(whole, whole.states[: len(parts.first[0])])
        return _Rung(reduced, np.zeros(0), np.full(full.D.shape, np.nan))

    return at


def _rate(pole: complex, full: LinearModel, lasts: Choice) -> float:
    """Return how fast a mode is [1/s]; 0 for what must be kept."""
    if lasts(pole):
        return 0.0
    if not full.period:
        return abs(pole)
    return abs(np.log(complex(pole))) / full.period if abs(pole) > _DEAD else math.inf


def _peaks(part: Matrices, full: LinearModel) -> tuple[Array, Array]:
    """Return units of outputs and inputs in which the largest response of each is about 1."""
    A, B, C = part
    n = len(A)
    labels = tuple(map(str, range(n)))
    stable = replace(
        full, A=A, B=B, C=C, D=0.0 * full.D, states=labels, state_units=labels, rate=np.zeros(n)
    )
    corners = natural(stable)
    nyquist = 0.5 / full.period if full.period else math.inf
    f = np.unique(np.append(corners[(corners > 0.0) & (corners < nyquist)], _NEAR_REST))
    size = np.abs(stable.response(f)).max(axis=0)
    rows = size.max(axis=1)
    rows[rows == 0.0] = 1.0
    columns = (size / rows[:, None]).max(axis=0)
    columns[columns == 0.0] = 1.0
    return rows, columns


def _joined(full: LinearModel, first: Matrices, second: Matrices) -> LinearModel:
    """Return both parts side by side, their states without a meaning of their own."""
    from scipy.linalg import block_diag

    n = len(first[0]) + len(second[0])
    A = block_diag(*(part[0] for part in (first, second) if len(part[0])))
    return replace(
        full,
        A=A,
        B=np.vstack([first[1], second[1]]),
        C=np.hstack([first[2], second[2]]),
        states=tuple(f"z_{k + 1}" for k in range(n)),
        state_units=("1",) * n,
        rate=np.zeros(n),
    )


def _band(model: LinearModel, band: float | None) -> float:
    """Return the end of the band [Hz]."""
    if band is not None:
        most = _FAR * float(natural(model).max(initial=0.0))
        if not model.period and band > most > 0.0:
            raise ParameterError(
                f"band = {band:g} Hz is not admissible: it must be <= {most:.3g} Hz, {_FAR:g} "
                f"times the fastest corner of {model.name}"
            )
        return band
    if model.period:
        return 0.4 / model.period
    return float(natural(model).max(initial=0.0)) or 1.0
