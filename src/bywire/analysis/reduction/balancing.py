"""Linear models in two parts, and balanced: what can be left out of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel
from bywire.core.typing import Array

Matrices = tuple[Array, Array, Array]
Choice = Callable[[complex], bool]

_BORDER = 1e-6  # of a pole's own size: this near to the border of stability it counts as on it
_STILL = 1e-10  # of the largest pole: an integrator
_LEAST = 1e-13  # of the largest Hankel singular value: below it there is rounding alone


@dataclass(frozen=True, eq=False)
class Parts:
    """A model in two parts that do not act on each other, and add up.

    Parameters
    ----------
    first, second
        (A, B, C) of each.
    """

    first: Matrices
    second: Matrices


@dataclass(frozen=True, eq=False)
class Balanced:
    """A stable part whose controllability and observability Gramians are equal and diagonal.

    Parameters
    ----------
    A, B, C
        Matrices; states by falling singular value.
    hankel
        Hankel singular values of the scaled signals, shape (n,).
    """

    A: Array
    B: Array
    C: Array
    hankel: Array


def split(model: LinearModel, first: Choice) -> Parts:
    """Return a model in two parts, told apart by their poles.

    Parameters
    ----------
    model
        Continuous or sampled.
    first
        ``first(pole) -> bool``: whether a pole belongs to the first part.

    Notes
    -----
    An ordered real Schur form A = Q T Q^T puts the first part on top; a Sylvester equation then
    removes what the second does to it.
    """
    from scipy.linalg import matrix_balance, schur, solve_sylvester

    A, (scale, _) = matrix_balance(model.A, permute=False, separate=True)
    B, C = model.B / scale[:, None], model.C * scale
    ordered: Any = schur  # its stubs know no function of real and imaginary part
    T, Q, count = ordered(A, output="real", sort=lambda x, y=0.0: first(complex(x, y)))
    B, C = Q.T @ B, C @ Q
    n = len(T)
    X = np.zeros((count, n - count))  # T_11 X - X T_22 = -T_12: then both parts are apart
    if 0 < count < n:
        X = solve_sylvester(T[:count, :count], -T[count:, count:], -T[:count, count:])
    return Parts(
        first=(T[:count, :count], B[:count] - X @ B[count:], C[:, :count]),
        second=(T[count:, count:], B[count:], C[:, :count] @ X + C[:, count:]),
    )


def lasting(model: LinearModel) -> Choice:
    """Return the test whether a pole is unstable or on the border of stability."""
    largest = float(np.max(np.abs(model.poles()), initial=0.0))

    def test(pole: complex) -> bool:
        if model.period:
            return bool(abs(pole) >= 1.0 - _BORDER)
        return bool(pole.real >= -max(_BORDER * abs(pole), _STILL * largest))

    return test


def balanced(part: Matrices, period: float) -> Balanced:
    """Return a balanced realization of a stable part, what does not show left out.

    Parameters
    ----------
    part
        (A, B, C), stable.
    period
        Sample time [s]; 0 for a continuous one.

    Notes
    -----
    Square-root method: only factors of the Gramians are multiplied.

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
    """Return L with L L^T the controllability Gramian."""
    from scipy.linalg import solve_continuous_lyapunov, solve_discrete_lyapunov

    Q = B @ B.T
    X = solve_discrete_lyapunov(A, Q) if period else solve_continuous_lyapunov(A, -Q)
    values, vectors = np.linalg.eigh(0.5 * (X + X.T))
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
