"""Linear models: matrices with names and units, and transfer functions of single paths."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from bywire.core.errors import ParameterError, unknown_name
from bywire.core.typing import Array, Complex

_ON_BORDER = 1e-6  # poles this close to the stability limit are integrators
_COUPLED = 1e-9  # of the largest entry of A: below it, a dropped state does not act on the others


@dataclass(frozen=True, eq=False)
class LinearModel:
    r"""Linear model of deviations from an operating point.

    .. math:: \dot x = A x + B u, \quad y = C x + D u

    or, with a sample time, :math:`x_{k+1} = A x_k + B u_k`. Units are SI.

    Parameters
    ----------
    name
        Name in figures and messages.
    A, B, C, D
        Matrices, shapes (n, n), (n, nu), (ny, n), (ny, nu).
    states, inputs, outputs
        Names, in the order of rows and columns.
    state_units, input_units, output_units
        Their SI units.
    rate
        dx/dt at the operating point, shape (n,); zero in equilibrium.
    period
        Sample time [s]; 0 for a continuous model.
    corners
        Side of an operation's kink for which the model is valid, if the operating point is on one;
        see `bywire.analysis.linear.corners`.
    """

    name: str
    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    state_units: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    rate: Array
    period: float = 0.0
    corners: tuple[str, ...] = ()

    def state_space(self) -> Any:
        """Return the model as ``control.StateSpace`` with named signals, for all of its methods.

        Uncontrollable and unobservable states are removed, since integrators among them would
        distort margins and steady gains. Each state is scaled by a power of two, so that entries
        have similar magnitudes.
        """
        import control

        k = self.effective()
        A, B, C = self.A[np.ix_(k, k)], self.B[k], self.C[:, k]
        scale = state_scale(A, B, C)
        return control.ss(
            A * scale / scale[:, None],
            B / scale[:, None],
            C * scale,
            self.D,
            self.period,
            states=[self.states[j] for j in k],
            inputs=list(self.inputs),
            outputs=list(self.outputs),
            name=self.name,
        )

    def transfer_function(self, input: str = "", output: str = "") -> Any:
        """Return one path as ``control.TransferFunction`` with named signals.

        Exact cancellations are removed. `transfer` returns zeros, poles and gain, without the
        rounding errors of polynomials.

        Parameters
        ----------
        input, output
            Names of the signals; the first ones if empty.

        Raises
        ------
        UnknownNameError
            When a name is unknown.
        ParameterError
            When polynomials cannot represent the model to within 0.1 %.
        """
        return self.transfer(input, output).transfer_function()

    def transfer(self, input: str = "", output: str = "") -> Transfer:
        """Return the transfer function of one path, without exact cancellations.

        Parameters
        ----------
        input, output
            Names of the signals; the first ones if empty.

        Raises
        ------
        UnknownNameError
            When a name is unknown.
        """
        j = _places("input", [input or self.inputs[0]], self.inputs)[0]
        i = _places("output", [output or self.outputs[0]], self.outputs)[0]
        kept = replace(self, B=self.B[:, j : j + 1], C=self.C[i : i + 1]).effective()
        path = Realization(
            self.A[np.ix_(kept, kept)], self.B[kept, j], self.C[i, kept], float(self.D[i, j])
        )
        return Transfer.of_path(
            path,
            f"{self.name}: {self.outputs[i]} by {self.inputs[j]}",
            (self.inputs[j], self.input_units[j]),
            (self.outputs[i], self.output_units[i]),
            self.period,
        )

    def poles(self) -> Complex:
        """Return the eigenvalues of A, the slowest first; [rad/s] for a continuous model."""
        eigenvalues = np.linalg.eigvals(self.A).astype(np.complex128)
        return eigenvalues[np.argsort(np.abs(eigenvalues))]

    @property
    def nyquist(self) -> float:
        """Half the sampling frequency [Hz]; infinite for a continuous model."""
        return 0.5 / self.period if self.period else math.inf

    @property
    def is_stable(self) -> bool:
        """Whether no pole lies outside the unit circle, or right of the imaginary axis.

        Integrators that a loop does not move (a disc's angle, memory that is only recorded) have
        poles on the stability limit and do not count.
        """
        poles = self.poles()
        if self.period:
            return bool(np.abs(poles).max(initial=0.0) < 1.0 + _ON_BORDER)
        if not poles.size:
            return True
        return bool(poles.real.max() < _ON_BORDER * np.abs(poles).max())

    @property
    def live(self) -> tuple[str, ...]:
        """States that are coupled to others, for example no temperatures while heat is off."""
        A, B, C = (values != 0.0 for values in (self.A, self.B, self.C))
        felt = A.any(axis=0) | A.any(axis=1) | B.any(axis=1) | C.any(axis=0) | (self.rate != 0.0)
        return tuple(name for name, kept in zip(self.states, felt, strict=True) if kept)

    def reduced(self, states: Sequence[str], *, held: bool = False) -> LinearModel:
        """Return the model with only some of its states.

        Parameters
        ----------
        states
            States to keep.
        held
            Whether the others are held at the operating point, like a locked rotor. Otherwise they
            must not act on the kept states or on the outputs.

        Raises
        ------
        UnknownNameError
            When a state is unknown.
        ParameterError
            When a dropped state acts on a kept one.
        """
        kept = _places("state", states, self.states)
        dropped = [k for k in range(len(self.states)) if k not in kept]
        coupled = (
            np.max(np.abs(self.A[np.ix_(kept, dropped)]), initial=0.0)
            > _COUPLED * np.max(np.abs(self.A), initial=0.0)
        ) or bool(np.any(self.C[:, dropped]))
        if coupled and not held:
            names = ", ".join(self.states[k] for k in dropped)
            raise ParameterError(
                f"{self.name}: the dropped states ({names}) affect the remaining states. Keep "
                "them, or hold them with held=True",
                name="states",
                value=names,
            )
        return replace(
            self,
            A=self.A[np.ix_(kept, kept)],
            B=self.B[kept],
            C=self.C[:, kept],
            states=tuple(states),
            state_units=tuple(self.state_units[k] for k in kept),
            rate=self.rate[kept],
        )

    def channels(self, *, inputs: Sequence[str] = (), outputs: Sequence[str] = ()) -> LinearModel:
        """Return the model with some of its inputs and outputs, in the specified order.

        Parameters
        ----------
        inputs, outputs
            Names; all by default.

        Raises
        ------
        UnknownNameError
            When a name is unknown.
        """
        columns = _places("input", inputs or self.inputs, self.inputs)
        rows = _places("output", outputs or self.outputs, self.outputs)
        return replace(
            self,
            B=self.B[:, columns],
            C=self.C[rows],
            D=self.D[rows][:, columns],
            inputs=tuple(self.inputs[k] for k in columns),
            outputs=tuple(self.outputs[k] for k in rows),
            input_units=tuple(self.input_units[k] for k in columns),
            output_units=tuple(self.output_units[k] for k in rows),
        )

    def together(self, inputs: Sequence[str]) -> LinearModel:
        """Return the model with some inputs combined into one, named after the first of them."""
        columns = [self.inputs.index(name) for name in inputs]
        first = columns[0]
        return replace(
            self,
            B=self.B[:, columns].sum(axis=1, keepdims=True),
            D=self.D[:, columns].sum(axis=1, keepdims=True),
            inputs=(self.inputs[first],),
            input_units=(self.input_units[first],),
        )

    def sampled(self, period: float) -> LinearModel:
        r"""Return the exact model at the sample times, for inputs that are held between them.

        .. math:: A_d = e^{A T}, \quad B_d = \int_0^T e^{A t} dt \, B

        Parameters
        ----------
        period
            Sample time T [s].

        Raises
        ------
        ParameterError
            When the sample time is so long that the model's numbers overflow.
        """
        from scipy.linalg import expm

        n = len(self.A)
        acting = np.flatnonzero(self.B.any(axis=0))  # the cost of expm grows with all columns
        size = n + acting.size
        whole = np.zeros((size, size))
        # Van Loan: the exponential of [[A, B], [0, 0]] contains both integrals, for any A.
        whole[:n, :n], whole[:n, n:] = self.A, self.B[:, acting]
        with np.errstate(all="ignore"):
            step = expm(whole * period)
        if not np.isfinite(step).all():
            raise ParameterError(
                f"the model's numbers overflow with a sample time of {period:g} s. Use a shorter "
                "sample time",
                name="sample time",
                value=f"{period:g} s",
            )
        B = np.zeros_like(self.B)
        B[:, acting] = step[:n, n:]
        return replace(self, A=step[:n, :n], B=B, period=period)

    def response(self, frequencies: Array) -> Complex:
        """Return the frequency response.

        Parameters
        ----------
        frequencies
            Frequencies [Hz], shape (m,).

        Returns
        -------
        numpy.ndarray
            Shape (m, ny, nu).
        """
        s = 2j * np.pi * np.asarray(frequencies, dtype=float)
        z = np.exp(s * self.period) if self.period else s
        k = self.effective()
        eye, A, B = np.eye(len(k)), self.A[np.ix_(k, k)], self.B[k].astype(complex)
        inner = np.linalg.solve(z[:, None, None] * eye - A, B)
        return np.asarray(self.C[:, k] @ inner + self.D)

    def effective(self) -> list[int]:
        """Return the states that inputs affect and that affect outputs."""
        return list(self._effective)

    @cached_property
    def _effective(self) -> tuple[int, ...]:
        forward, backward = self.B.any(axis=1), self.C.any(axis=0)
        coupled = self.A != 0
        for _ in range(len(self.states)):
            reached = np.count_nonzero(forward) + np.count_nonzero(backward)
            forward = forward | coupled[:, forward].any(axis=1)
            backward = backward | coupled[backward].any(axis=0)
            if np.count_nonzero(forward) + np.count_nonzero(backward) == reached:
                break
        return tuple(np.flatnonzero(forward & backward).tolist())


def _places(kind: str, names: Sequence[str], known: tuple[str, ...]) -> list[int]:
    for name in names:
        if name not in known:
            raise unknown_name(kind, name, known)
    return [known.index(name) for name in names]


# --- Poles of sampled models as rates of continuous motions

DEAD = 1e-9
"""poles below this magnitude are deadbeat: their response ends within a sample"""
STILL = 1e-6
"""rates below this magnitude [1/s] are treated as zero: integrators at rest"""


def rates(model: LinearModel) -> Complex:
    r"""Return the poles as rates [1/s] of continuous motions, slowest first.

    .. math:: s = \ln(z) / T

    for sampled models; the poles of a continuous model are already rates. Deadbeat poles are
    removed. The imaginary part is ambiguous by multiples of the sampling frequency; the smallest
    one is returned.

    Parameters
    ----------
    model
        Model with n states.

    Returns
    -------
    numpy.ndarray
        Shape (at most n,).
    """
    poles = model.poles()
    if not model.period:
        return poles
    continuous = np.log(poles[np.abs(poles) > DEAD]) / model.period
    return np.asarray(continuous[np.argsort(np.abs(continuous))])


# --- Transfer functions

_ROUNDING = 100.0 * float(np.finfo(float).eps)  # of the largest entry; smaller values are zero


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
        """Return the model with input and output exchanged, and the same transfer function."""
        return Realization(self.A.T, self.c, self.b, self.d)


def minimal(system: Realization) -> Realization:
    """Return a realization whose states are all controllable and observable.

    Parameters
    ----------
    system
        Any realization.

    Notes
    -----
    The system is first balanced by a diagonal scaling, then brought to staircase form from the
    input, and the rest from the output. All steps are orthogonal, so errors are rounding times the
    largest entry. Cancellations are found without comparing poles and zeros.

    References
    ----------
    P. M. Van Dooren, "The generalized eigenstructure problem in linear system theory", IEEE
    Transactions on Automatic Control 26 (1981): staircase form.
    """
    return _reached(_reached(scaled(system)).dual()).dual()


def scaled(system: Realization) -> Realization:
    """Return the system with states of similar weight, scaled by powers of two without rounding."""
    size = state_scale(system.A, system.b[:, None], system.c[None])
    A = system.A * size / size[:, None]
    return Realization(A, system.b / size, system.c * size, system.d)


def state_scale(A: Array, B: Array, C: Array) -> Array:
    """Return powers of two that scale the states so that entries of A, B, C are similar.

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
    r"""Return the finite zeros, and the factor k before the products.

    .. math:: c (sI - A)^{-1} b + d = k \prod_j (s - z_j) / \prod_i (s - \lambda_i)

    Parameters
    ----------
    system
        A minimal realization; otherwise, each uncontrollable state adds a zero.

    Notes
    -----
    Without direct feedthrough, the output can stay zero only within the null space of c, where the
    output's rate replaces it. Each step removes a state and preserves the zeros, until there is a
    feedthrough. The zeros are then the eigenvalues of A - b c / d.

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
    """Return the controllable part: each step adds the direction of A times the last one."""
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
        for _ in range(2):  # twice, since the rest after the first time may be only rounding
            step -= basis[:, :count] @ (basis[:, :count].T @ step)
        size = float(np.linalg.norm(step))
        if size <= least:
            break
        basis[:, count] = step / size
        count += 1
    Q = basis[:, :count]
    return Realization(Q.T @ A @ Q, Q.T @ b, Q.T @ c, system.d)


def _complement(row: Array) -> Array:
    """Return an orthonormal basis of the complement of a unit vector, by a reflection."""
    v = row.copy()
    v[0] += np.copysign(1.0, row[0])
    reflection = np.eye(len(row)) - 2.0 * np.outer(v, v) / float(v @ v)
    return np.asarray(reflection[:, 1:])


# --- Transfer functions

_AT_REST = 1e-11  # of the largest pole: maximum magnitude of an integrator


@dataclass(frozen=True, eq=False)
class Transfer:
    r"""Transfer function from one input to one output.

    .. math:: G(s) = k \prod_j (s - z_j) / \prod_i (s - \lambda_i)

    or the same in z, with a sample time.

    Parameters
    ----------
    name
        Name in figures and messages.
    input, output
        Names of the signals.
    input_unit, output_unit
        Their SI units.
    zeros, poles
        Smallest first [rad/s; without unit if sampled].
    factor
        k, SI.
    period
        Sample time [s]; 0 for a continuous transfer function.
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
        """Unit of the values."""
        return f"({self.output_unit})/({self.input_unit})"

    @property
    def static_gain(self) -> float:
        """Value at rest; infinite for an integrator."""
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
        """Return the transfer function as ``control.TransferFunction`` with named signals.

        Parameters
        ----------
        tolerance
            Maximum relative error of its response, from a thousandth of the slowest corner
            frequency to the fastest, or from a thousandth to half of the sampling frequency.

        Raises
        ------
        ParameterError
            When the coefficients, as doubles, are not that accurate. This affects sampled models
            of high order, whose poles crowd at z = 1. `response` and ``state_space`` keep all
            digits.
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
                f"{self.name}: polynomials of degree {len(self.poles)} in z would have an error of "
                f"{error:.1g}, above {tolerance:g}. Use zeros, poles and factor, or state_space()",
                name="tolerance",
                value=f"{error:.1g}",
                valid=f"<= {tolerance:g}",
            )
        return system

    def _range(self) -> Array:
        """Return the frequencies [Hz] at which polynomials are compared."""
        if self.period:
            return np.geomspace(5e-4, 0.49, 200) / self.period
        corners = np.abs(np.concatenate([self.zeros, self.poles]))
        corners = corners[corners > _AT_REST * np.max(corners, initial=0.0)]
        if not corners.size:
            return np.ones(1)
        return np.asarray(np.geomspace(1e-3 * corners.min(), corners.max(), 200) / 2.0 / np.pi)

    def _at(self, s: Complex) -> Complex:
        """Return the values; poles and zeros alternate, so that nothing overflows."""
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
        """Return the transfer function of a path, without exact cancellations.

        Parameters
        ----------
        path
            Realization from the input to the output, continuous or sampled.
        name
            Name in figures and messages.
        input, output
            Name and SI unit of each.
        period
            Sample time [s]; 0 for a continuous path.
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
