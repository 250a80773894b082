"""Transfer functions with named signals, minimal: zeros, poles and gain of one path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from bywire.core.errors import ParameterError
from bywire.core.typing import Array, Complex

_ROUNDING = 100.0 * float(np.finfo(float).eps)  # of the largest entry: what counts as zero


@dataclass(frozen=True, eq=False)
class Realization:
    r"""One input, one output.

    .. math:: \dot x = A x + b u, \quad y = c x + d u

    Parameters
    ----------
    A, b, c, d
        Shapes (n, n), (n,), (n,), and a number.
    """

    A: Array
    b: Array
    c: Array
    d: float

    def dual(self) -> Realization:
        """Return the model with input and output exchanged, of the same transfer function."""
        return Realization(self.A.T, self.c, self.b, self.d)


def minimal(system: Realization) -> Realization:
    """Return a realization without states that the input does not reach or the output not see.

    Parameters
    ----------
    system
        Any realization.

    Notes
    -----
    Balanced by a diagonal scaling first, then brought to staircase form from the input and, of
    what is left, from the output. Orthogonal steps alone: errors stay at rounding times the
    largest entry. Cancellations are found before there are any poles and zeros to compare.

    References
    ----------
    P. M. Van Dooren, "The generalized eigenstructure problem in linear system theory", IEEE
    Transactions on Automatic Control 26 (1981): staircase form.
    """
    return _reached(_reached(scaled(system)).dual()).dual()


def scaled(system: Realization) -> Realization:
    """Return it with its states in units of similar weight: powers of two, no rounding."""
    size = state_scale(system.A, system.b[:, None], system.c[None])
    A = system.A * size / size[:, None]
    return Realization(A, system.b / size, system.c * size, system.d)


def state_scale(A: Array, B: Array, C: Array) -> Array:
    """Return units of the states, powers of two, in which the entries of A, B, C are alike.

    Parameters
    ----------
    A, B, C
        Matrices, shapes (n, n), (n, nu), (ny, n).

    Returns
    -------
    numpy.ndarray
        Shape (n,); the model in these units is A_ij s_j / s_i, B_i / s_i, C_j s_j.
    """
    from scipy.linalg import matrix_balance

    n = len(A)
    if n == 0:
        return np.ones(0)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n], whole[n, :n] = A, np.abs(B).max(axis=1), np.abs(C).max(axis=0)
    scale: Any = matrix_balance(whole, permute=False, separate=True)[1][0]
    return np.asarray(scale[:n] / scale[n])


def zeros(system: Realization) -> tuple[Complex, float]:
    r"""Return the finite zeros, and the factor k in front of the products.

    .. math:: c (sI - A)^{-1} b + d = k \prod_j (s - z_j) / \prod_i (s - \lambda_i)

    Parameters
    ----------
    system
        A minimal realization; a zero for each state that an input does not reach else.

    Notes
    -----
    While no input passes straight to the output, the output can only stay zero within the null
    space of c; there the output's rate takes its place. Each turn loses a state and keeps the
    zeros, until something passes: then they are the eigenvalues of A - b c / d.

    References
    ----------
    A. Emami-Naeini, P. Van Dooren, "Computation of zeros of linear multivariable systems",
    Automatica 18 (1982), for one input and one output.
    """
    A, b, c, d = system.A, system.b, system.c, system.d
    factor = 1.0
    while abs(d) <= _ROUNDING * float(np.linalg.norm(b)):
        size = float(np.linalg.norm(c))
        if not len(A) or size == 0.0:
            return np.zeros(0, dtype=complex), 0.0
        row = c / size
        factor *= size
        Q = _complement(row)
        A, b, c, d = Q.T @ A @ Q, Q.T @ b, row @ A @ Q, float(row @ b)
    roots = np.linalg.eigvals(A - np.outer(b, c) / d) if len(A) else np.zeros(0)
    return np.asarray(roots, dtype=complex), factor * d


def _reached(system: Realization) -> Realization:
    """Return the part that the input reaches: each step adds the direction of A times the last."""
    A, b, c = system.A, system.b, system.c
    n = len(A)
    if n == 0 or not b.any():
        return Realization(np.zeros((0, 0)), np.zeros(0), np.zeros(0), system.d)
    least = _ROUNDING * max(float(np.abs(A).max()), np.finfo(float).tiny)
    basis = np.zeros((n, n))
    basis[:, 0] = b / np.linalg.norm(b)
    count = 1
    while count < n:
        step = A @ basis[:, count - 1]
        for _ in range(2):  # once more: what is left after the first may be rounding alone
            step -= basis[:, :count] @ (basis[:, :count].T @ step)
        size = float(np.linalg.norm(step))
        if size <= least:
            break
        basis[:, count] = step / size
        count += 1
    Q = basis[:, :count]
    return Realization(Q.T @ A @ Q, Q.T @ b, Q.T @ c, system.d)


def _complement(row: Array) -> Array:
    """Return an orthonormal basis of what is perpendicular to a unit vector, by a reflection."""
    v = row.copy()
    v[0] += np.copysign(1.0, row[0])
    reflection = np.eye(len(row)) - 2.0 * np.outer(v, v) / float(v @ v)
    return np.asarray(reflection[:, 1:])


# --- Transfer functions

_AT_REST = 1e-11  # of the largest pole: what counts as an integrator


@dataclass(frozen=True, eq=False)
class Transfer:
    r"""From one input to one output.

    .. math:: G(s) = k \prod_j (s - z_j) / \prod_i (s - \lambda_i)

    or the same of z, with a sample time.

    Parameters
    ----------
    name
        What figures and messages call it.
    input, output
        Names of the signals.
    input_unit, output_unit
        Their SI units.
    zeros, poles
        Smallest first [rad/s; without unit where sampled].
    factor
        k, SI.
    period
        Sample time [s]; 0 for a continuous one.
    """

    name: str
    input: str
    output: str
    input_unit: str
    output_unit: str
    zeros: Complex
    poles: Complex
    factor: float
    period: float = 0.0

    @property
    def unit(self) -> str:
        """Unit of its values."""
        return f"({self.output_unit})/({self.input_unit})"

    @property
    def static_gain(self) -> float:
        """Value at rest; infinite where it integrates."""
        at = 1.0 if self.period else 0.0
        size = _AT_REST * float(np.max(np.abs(self.poles), initial=0.0))
        if np.any(np.abs(self.poles - at) <= size):
            return math.inf
        return float(self._at(np.array([at], dtype=complex))[0].real)

    def response(self, frequencies: Array) -> Complex:
        """Return the frequency response at frequencies [Hz], shape (n,)."""
        s = 2j * np.pi * np.asarray(frequencies, dtype=float)
        return self._at(np.exp(s * self.period) if self.period else s)

    def transfer_function(self, tolerance: float = 1e-3) -> Any:
        """Return it as ``control.TransferFunction`` with named signals.

        Parameters
        ----------
        tolerance
            Largest admissible relative error of its response, from a thousandth of the slowest
            corner up to the fastest, or of the sampling frequency up to half of it.

        Raises
        ------
        ParameterError
            When coefficients of doubles cannot hold it so well: those of a sampled model of high
            order, whose poles crowd at z = 1. `response` and ``state_space`` keep all digits.
        """
        import control

        system = control.tf(
            np.atleast_1d(self.factor * np.real(np.poly(self.zeros))),
            np.atleast_1d(np.real(np.poly(self.poles))),
            self.period,
            inputs=[self.input],
            outputs=[self.output],
            name=self.name,
        )
        f = self._range()
        rounded = control.frequency_response(system, 2.0 * np.pi * f).complex.reshape(-1)
        exact = self.response(f)
        seen = exact != 0.0
        error = float(np.max(np.abs(rounded[seen] / exact[seen] - 1.0), initial=0.0))
        if not error <= tolerance:
            raise ParameterError(
                f"{self.name}: polynomials of degree {len(self.poles)} in z would be {error:.1g} "
                f"off, {tolerance:g} is admissible: use zeros, poles and factor, or state_space()"
            )
        return system

    def _range(self) -> Array:
        """Return frequencies [Hz] at which polynomials are compared."""
        if self.period:
            return np.geomspace(5e-4, 0.49, 200) / self.period
        corners = np.abs(np.concatenate([self.zeros, self.poles]))
        corners = corners[corners > _AT_REST * np.max(corners, initial=0.0)]
        if not corners.size:
            return np.ones(1)
        return np.asarray(np.geomspace(1e-3 * corners.min(), corners.max(), 200) / 2.0 / np.pi)

    def _at(self, s: Complex) -> Complex:
        """Return the values; poles and zeros take turns, so that nothing overflows."""
        values = np.full(s.shape, self.factor, dtype=complex)
        for k in range(max(len(self.zeros), len(self.poles))):
            if k < len(self.zeros):
                values *= s - self.zeros[-1 - k]
            if k < len(self.poles):
                values /= s - self.poles[-1 - k]
        return values

    @classmethod
    def of_path(
        cls,
        path: Realization,
        name: str,
        input: tuple[str, str],
        output: tuple[str, str],
        period: float,
    ) -> Transfer:
        """Return the transfer function of a path, exact cancellations removed.

        Parameters
        ----------
        path
            From the input to the output, continuous or sampled.
        name
            What figures and messages call it.
        input, output
            Name and SI unit of each.
        period
            Sample time [s]; 0 for a continuous one.
        """
        least = minimal(path)
        roots, factor = zeros(least)
        poles = np.linalg.eigvals(least.A) if len(least.A) and factor else np.zeros(0)
        return cls(
            name,
            input[0],
            output[0],
            input[1],
            output[1],
            _sorted(roots),
            _sorted(poles),
            factor,
            period,
        )


def _sorted(roots: Any) -> Complex:
    values = np.asarray(roots, dtype=complex)
    return values[np.lexsort((values.imag, np.abs(values).round(12)))]
