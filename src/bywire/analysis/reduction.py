"""Reduced linear models with a known error: balanced, modal, or with selected states."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel, rates
from bywire.core.errors import ParameterError, not_valid, unknown_name
from bywire.core.typing import Array

Matrices = tuple[Array, Array, Array]
Choice = Callable[[complex], bool]

_BORDER = 1e-6  # of a pole's magnitude: maximum distance of a pole on the stability limit
_STILL = 1e-10  # of the largest pole: maximum magnitude of an integrator
_LEAST = 1e-13  # of the largest Hankel singular value: smaller ones are rounding


@dataclass(frozen=True, eq=False)
class Parts:
    """Model as the sum of two uncoupled parts.

    Parameters
    ----------
    first, second
        (A, B, C) of each.
    """

    first: Matrices
    second: Matrices


@dataclass(frozen=True, eq=False)
class Balanced:
    """Stable part whose controllability and observability Gramians are equal and diagonal.

    Parameters
    ----------
    A, B, C
        Matrices, with states in the order of decreasing singular value.
    hankel
        Hankel singular values of the scaled signals, shape (n,).
    """

    A: Array
    B: Array
    C: Array
    hankel: Array


def split(model: LinearModel, first: Choice) -> Parts:
    """Return a model in two parts, separated by their poles.

    Parameters
    ----------
    model
        Continuous or sampled model.
    first
        ``first(pole) -> bool``: whether a pole belongs to the first part.

    Notes
    -----
    An ordered real Schur form A = Q T Q^T puts the first part on top; a Sylvester equation then
    removes the effect of the second part on it.
    """
    from scipy.linalg import matrix_balance, schur, solve_sylvester

    A, (scale, _) = matrix_balance(model.A, permute=False, separate=True)
    B, C = model.B / scale[:, None], model.C * scale
    ordered: Any = schur  # its stubs lack a function of real and imaginary part
    T, Q, count = ordered(A, output="real", sort=lambda x, y=0.0: first(complex(x, y)))
    B, C = Q.T @ B, C @ Q
    n = len(T)
    X = np.zeros((count, n - count))  # T_11 X - X T_22 = -T_12 separates both parts
    if 0 < count < n:
        X = solve_sylvester(T[:count, :count], -T[count:, count:], -T[:count, count:])
    return Parts(
        first=(T[:count, :count], B[:count] - X @ B[count:], C[:, :count]),
        second=(T[count:, count:], B[count:], C[:, :count] @ X + C[:, count:]),
    )


def lasting(model: LinearModel) -> Choice:
    """Return a function that tests whether a pole is unstable or on the stability limit."""
    largest = float(np.max(np.abs(model.poles()), initial=0.0))

    def test(pole: complex) -> bool:
        if model.period:
            return bool(abs(pole) >= 1.0 - _BORDER)
        return bool(pole.real >= -max(_BORDER * abs(pole), _STILL * largest))

    return test


def balanced(part: Matrices, period: float) -> Balanced:
    """Return a balanced realization of a stable part, without negligible states.

    Parameters
    ----------
    part
        (A, B, C), stable.
    period
        Sample time [s]; 0 for a continuous part.

    Notes
    -----
    This is the square-root method, which multiplies only factors of the Gramians.

    References
    ----------
    M. S. Tombs, I. Postlethwaite, "Truncated balanced realization of a stable non-minimal
    state-space system", International Journal of Control 46 (1987).
    """
    A, B, C = part
    if not len(A):
        return Balanced(A, B, C, np.zeros(0))
    R, S = _factor(A, B, period), _factor(A.T, C.T, period)
    U, hankel, Vt = np.linalg.svd(S.T @ R)
    count = int(np.sum(hankel > _LEAST * hankel[0])) if hankel[0] > 0.0 else 0
    root = np.sqrt(hankel[:count])
    left, right = U[:, :count].T @ S.T / root[:, None], R @ Vt[:count].T / root
    return Balanced(left @ A @ right, left @ B, C @ right, hankel[:count])


def _factor(A: Array, B: Array, period: float) -> Array:
    """Return L, where L L^T is the controllability Gramian."""
    from scipy.linalg import solve_continuous_lyapunov, solve_discrete_lyapunov

    Q = B @ B.T
    X = solve_discrete_lyapunov(A, Q) if period else solve_continuous_lyapunov(A, -Q)
    values, vectors = np.linalg.eigh(0.5 * (X + X.T))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


# --- Maximum error of a reduced model over a band, channel by channel

_POINTS = 300
_DECADES = 4.0  # below the band's end: start of the search
_NOTHING = 1e-12  # of the largest response: maximum response of a channel without gain


@dataclass(frozen=True)
class ReductionError:
    r"""Maximum differences of two models over a band, in the worst of all channels.

    Parameters
    ----------
    low, high
        The band [Hz].
    relative
        Maximum :math:`|\hat G - G| / |G|`.
    gain
        Maximum difference of magnitude [dB].
    phase
        Maximum difference of phase [degree].
    at
        Frequency of the maximum relative error [Hz].
    channel
        Output and input of the maximum relative error.
    poles
        Maximum distance of a pole within the band from the full model's nearest pole, relative to
        its magnitude; NaN if there is no pole in the band.
    """

    low: float
    high: float
    relative: float
    gain: float
    phase: float
    at: float
    channel: tuple[str, str]
    poles: float


def reduction_error(full: LinearModel, reduced: LinearModel, high: float) -> ReductionError:
    """Return the error of a model relative to another one, over four decades up to a frequency.

    Parameters
    ----------
    full, reduced
        Models with the same inputs, outputs and sample time.
    high
        End of the band [Hz].

    Raises
    ------
    ParameterError
        When the signals differ, or the band does not exist.

    Notes
    -----
    The frequencies are a logarithmic grid and the frequencies of all poles, where peaks occur.
    Channels without gain do not count.
    """
    f = frequencies(full, reduced, high)
    exact, other = full.response(f), reduced.response(f)
    size = np.abs(exact)
    peak = np.max(size, axis=0)
    # Channels have different units: their inputs and outputs determine the scale of zero gain.
    seen = peak > _NOTHING * np.sqrt(np.outer(np.max(peak, axis=1), np.max(peak, axis=0)))
    if not seen.any():
        return ReductionError(
            float(f[0]), float(f[-1]), 0.0, 0.0, 0.0, float(f[0]), ("", ""), math.nan
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(seen[None], other / exact, 1.0)
        relative = np.abs(ratio - 1.0)
        gain = np.abs(20.0 * np.log10(np.abs(ratio)))
        phase = np.abs(np.degrees(np.angle(ratio)))
    k, i, j = np.unravel_index(int(np.argmax(relative)), relative.shape)
    return ReductionError(
        float(f[0]),
        float(f[-1]),
        float(relative[k, i, j]),
        float(np.max(gain)),
        float(np.max(phase)),
        float(f[k]),
        (full.outputs[i], full.inputs[j]),
        _pole_error(full, reduced, float(f[0]), high),
    )


def frequencies(full: LinearModel, reduced: LinearModel, high: float) -> Array:
    """Return the frequencies [Hz] at which two models are compared, ascending."""
    same = ("inputs", "outputs", "period")
    if any(getattr(full, name) != getattr(reduced, name) for name in same):
        raise ParameterError(
            f"{full.name} and {reduced.name} cannot be compared because their inputs, outputs or "
            "sample times differ",
            name=reduced.name,
        )
    nyquist = 0.5 / full.period if full.period else math.inf
    if not 0.0 < high < math.inf:
        raise not_valid("band", f"{high:g} Hz", "> 0 Hz and finite")
    if high > nyquist:
        half = "half the sampling frequency"
        raise not_valid("band", f"{high:g} Hz", f"<= {nyquist:g} Hz", half)
    low = high * 10.0**-_DECADES
    corners = np.concatenate([natural(full), natural(reduced)])
    inside = corners[(corners > low) & (corners < high)]
    return np.unique(np.concatenate([np.geomspace(low, high, _POINTS), inside]))


def _pole_error(full: LinearModel, reduced: LinearModel, low: float, high: float) -> float:
    """Return the maximum relative distance of the poles in a band [Hz]."""
    known, kept = rates(full), rates(reduced)
    inside = kept[np.abs(kept) <= 2.0 * math.pi * high]
    if not inside.size or not known.size:
        return math.nan
    distance = np.abs(inside[:, None] - known).min(axis=1)
    return float(np.max(distance / np.maximum(np.abs(inside), 2.0 * math.pi * low)))


def natural(model: LinearModel) -> Array:
    """Return the frequencies of a model's poles [Hz]; 0 for deadbeat poles and integrators."""
    poles = model.poles()
    if not model.period:
        return np.asarray(np.abs(poles) / 2.0 / math.pi)
    live = poles[np.abs(poles) > np.finfo(float).tiny]
    return np.asarray(np.abs(np.log(live)) / 2.0 / math.pi / model.period)


# --- Selected states, with the others quasi-static

_NO_REST = 1e14  # maximum condition number of the equation for the steady state


def residualized(
    model: LinearModel, keep: Sequence[str], *, corrected: bool = False
) -> LinearModel:
    r"""Return a model with some of its states; the others are always in quasi-static balance.

    .. math:: A_{11} - A_{12} A_{22}^{-1} A_{21}, \quad \text{and so on for } B, C, D

    The model is exact at rest, and accurate if the dropped states are faster than the response of
    interest. With the correction,

    .. math:: x_2 = -A_{22}^{-1} (A_{21} x_1 + B_2 u) - A_{22}^{-2} A_{21} \dot x_1

    the dropped states follow the kept states with a first-order lag. The poles are then more
    accurate by one order in the ratio of both speeds. The lag behind the inputs is still neglected.

    Parameters
    ----------
    model
        Continuous, or sampled (where :math:`I - A_{22}` replaces :math:`-A_{22}`).
    keep
        Names of the states to keep.
    corrected
        Whether to include the first-order lag behind the kept states; continuous models only.

    Raises
    ------
    UnknownNameError
        When a state is unknown.
    ParameterError
        When the dropped states have no steady state, for example an integrator.

    References
    ----------
    P. Kokotovic, H. K. Khalil, J. O'Reilly, "Singular Perturbation Methods in Control" (1986):
    slow manifold, to zeroth and first order.
    """
    for name in keep:
        if name not in model.states:
            raise unknown_name("state", name, model.states)
    first = [model.states.index(name) for name in keep]
    second = [k for k in range(len(model.states)) if k not in first]
    inner = np.eye(len(second)) * (1.0 if model.period else 0.0) - model.A[np.ix_(second, second)]
    size = np.abs(inner).max(axis=1, initial=0.0)
    if second and (np.any(size == 0.0) or np.linalg.cond(inner / size[:, None]) > _NO_REST):
        names = ", ".join(model.states[k] for k in second)
        raise ParameterError(
            f"{model.name}: the omitted states ({names}) have no steady state because one of them "
            "integrates. Keep the integrating state",
            name="states",
            value=names,
        )
    if corrected and model.period:
        raise ParameterError(
            f"{model.name} is a sampled model, but the correction is valid only for continuous "
            "models. Use corrected=False",
            name=model.name,
        )
    A21, A12 = model.A[np.ix_(second, first)], model.A[np.ix_(first, second)]
    C2 = model.C[:, second]
    drift = model.rate[second, None]
    rest = np.linalg.solve(inner, np.hstack([A21, model.B[second], drift]))
    by_x, by_u, by_1 = np.split(rest, [len(first), len(first) + model.B.shape[1]], axis=1)
    A, B = model.A[np.ix_(first, first)] + A12 @ by_x, model.B[first] + A12 @ by_u
    rate = model.rate[first] + (A12 @ by_1)[:, 0]
    C, D = model.C[:, first] + C2 @ by_x, model.D + C2 @ by_u
    if corrected:
        lag = np.linalg.solve(inner, by_x)
        body = np.eye(len(first)) + A12 @ lag
        A, B, rate = (np.linalg.solve(body, M) for M in (A, B, rate))
        C, D = C - C2 @ lag @ A, D - C2 @ lag @ B
    return replace(
        model,
        A=A,
        B=B,
        C=C,
        D=D,
        rate=rate,
        states=tuple(keep),
        state_units=tuple(model.state_units[k] for k in first),
    )


# --- Reduction

Method = Literal["balanced", "modal"]

_DEAD = 1e-12  # maximum magnitude of deadbeat poles of sampled models
_NEAR_REST = 1e-6  # frequency that represents rest [Hz]

TOLERANCE = 0.01
"""default of the maximum relative error over the band"""
_FAR = 1e3  # times the fastest corner frequency: beyond it, a response is rounding


@dataclass(frozen=True, eq=False)
class Reduced:
    """Reduced model with its error.

    Parameters
    ----------
    model
        Model with the same signals and fewer states.
    error
        Error over a band.
    kept
        Number of its states that are unstable or on the stability limit, which are always kept.
    hankel
        Hankel singular values of the rest of the full model, with every signal relative to its
        maximum response; shape (n,). Empty if they were not needed.
    bound
        Bound of each response's error at any frequency, in SI units, shape (outputs, inputs):
        twice the sum of the dropped singular values. NaN if the method has no such bound.
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
    """Return a model with fewer states, with a specified order or error over a band.

    Parameters
    ----------
    model
        Continuous or sampled model, stable or not: integrators, undamped oscillations and unstable
        poles are separated first and kept.
    order
        Number of states; by default the minimum that `tolerance` allows.
    band
        Frequency [Hz] up to which the error counts; by default that of the fastest pole, or 0.4
        of the sampling frequency (many sampled models have a zero at half of it).
    tolerance
        Maximum relative error over the band, if no order is specified.
    method
        ``"balanced"``: the least observable and controllable states are always in steady state
        (singular perturbation of the balanced realization: exact at rest, with a bound at every
        frequency). ``"modal"``: the fastest modes are always in steady state; the kept poles are
        those of the model.

    Raises
    ------
    ParameterError
        When order, band or tolerance is out of range, or no order meets the tolerance.

    References
    ----------
    Y. Liu, B. D. O. Anderson, "Singular perturbation approximation of balanced systems",
    International Journal of Control 50 (1989): bound and exactness at rest.
    """
    # States that no input moves stay at the operating point; unobservable states have no effect.
    acting = [model.states[k] for k in model.effective()]
    full = model.reduced(acting, held=True)
    high, n = _band(full, band), len(acting)
    if not acting:
        raise ParameterError(
            f"{full.name} cannot be reduced because no input affects an output, for example "
            "because of stiction",
            name=full.name,
        )
    lasts = lasting(full)
    kept = sum(lasts(pole) for pole in full.poles())
    least = max(kept, 1)
    if order is not None and not least <= order <= n:
        states = f"because {full.name} has {n} effective states, {kept} of them not stable"
        raise not_valid("order", str(order), f">= {least} and <= {n}", states)
    if not 0.0 < tolerance < 1.0:
        raise not_valid("tolerance", f"{tolerance:g}", "> 0 and < 1")
    rungs = _balanced(full) if method == "balanced" else _modal(full)
    best = math.inf
    for size in range(least, n + 1) if order is None else (order,):
        rung = rungs(size)
        error = reduction_error(full, rung.model, high)
        if order is not None or error.relative <= tolerance:
            return Reduced(rung.model, error, kept, rung.hankel, rung.bound)
        best = min(best, error.relative)
    raise ParameterError(
        f"{full.name}: no reduced model has an error below {100.0 * tolerance:g} % up to "
        f"{high:g} Hz (the "
        f"minimum error is {100.0 * best:.2g} %). Increase the tolerance, or use a lower band",
        name="tolerance",
        value=f"{100.0 * tolerance:g} %",
        valid=f">= {100.0 * best:.2g} %",
    )


@dataclass(frozen=True, eq=False)
class _Rung:
    """Model of one order, with properties that do not depend on its response."""

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
    """Return the reduction to the slowest modes with complete pairs; the others are at rest."""
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
    """Return the rate of a mode [1/s]; 0 for a mode that must be kept."""
    if lasts(pole):
        return 0.0
    if not full.period:
        return abs(pole)
    return abs(np.log(complex(pole))) / full.period if abs(pole) > _DEAD else math.inf


def _peaks(part: Matrices, full: LinearModel) -> tuple[Array, Array]:
    """Return units of outputs and inputs in which the maximum response of each is about 1."""
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
    """Return the sum of both parts, with states that have no physical meaning."""
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
            far = f"{_FAR:g} times the fastest corner frequency of {model.name}"
            raise not_valid("band", f"{band:g} Hz", f"<= {most:.3g} Hz", far)
        return band
    if model.period:
        return 0.4 / model.period
    return float(natural(model).max(initial=0.0)) or 1.0
