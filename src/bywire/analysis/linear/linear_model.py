"""A linear model as plain data: matrices with names and units, continuous or sampled."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bywire.analysis.linear.transfer import Realization, Transfer
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.typing import Array, Complex

_ON_BORDER = 1e-6  # poles this close to the border of stability are integrators
_COUPLED = 1e-9  # of the largest entry of A: below it a dropped state does not act on the others


@dataclass(frozen=True, eq=False)
class LinearModel:
    r"""Deviations from an operating point.

    .. math:: \dot x = A x + B u, \quad y = C x + D u

    or, with a sample time, :math:`x_{k+1} = A x_k + B u_k`. Units are SI.

    Parameters
    ----------
    name
        What figures and messages call it.
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
        On which side of an operation's corner the model is taken, where the operating point lies
        on one; see `bywire.analysis.linear.corners`.
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
        """Return it as ``control.StateSpace`` with named signals, for any of its methods.

        States that no input reaches or no output sees are left out: integrators among them would
        spoil margins and steady gains. Each state is in a unit of its own, a power of two of SI,
        so that entries are of like size.
        """
        import control

        from bywire.analysis.linear.transfer import state_scale

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

        What cancels exactly is left out. `transfer` has its zeros, poles and gain, without the
        rounding of polynomials.

        Parameters
        ----------
        input, output
            Names of the signals; the first ones where empty.

        Raises
        ------
        UnknownNameError
            When a name is unknown.
        ParameterError
            When polynomials cannot hold the model to 0.1 %.
        """
        return self.transfer(input, output).transfer_function()

    def transfer(self, input: str = "", output: str = "") -> Transfer:
        """Return the transfer function of one path, exact cancellations removed.

        Parameters
        ----------
        input, output
            Names of the signals; the first ones where empty.

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
        poles on the border and do not count.
        """
        poles = self.poles()
        if self.period:
            return bool(np.abs(poles).max(initial=0.0) < 1.0 + _ON_BORDER)
        if not poles.size:
            return True
        return bool(poles.real.max() < _ON_BORDER * np.abs(poles).max())

    @property
    def live(self) -> tuple[str, ...]:
        """States that anything moves, or anything feels: no temperatures while heat is off."""
        A, B, C = (values != 0.0 for values in (self.A, self.B, self.C))
        felt = A.any(axis=0) | A.any(axis=1) | B.any(axis=1) | C.any(axis=0) | (self.rate != 0.0)
        return tuple(name for name, kept in zip(self.states, felt, strict=True) if kept)

    def reduced(self, states: Sequence[str], *, held: bool = False) -> LinearModel:
        """Return the model with some of its states only.

        Parameters
        ----------
        states
            States to keep.
        held
            Whether the others are held at the operating point, as a locked rotor; else they
            must not act on the kept ones or on the outputs.

        Raises
        ------
        UnknownNameError
            When a state is unknown.
        ParameterError
            When a dropped state acts on what is kept.
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
                f"{self.name}: the dropped states ({names}) act on what is kept: keep them, or "
                "hold them with held=True"
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
        """Return the model with some of its inputs and outputs, in the order given.

        Parameters
        ----------
        inputs, outputs
            Names; all where none is given.

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
        """Return the model with some inputs moving as one, named after the first of them."""
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
        r"""Return the exact model at sampling instants of inputs that are held between them.

        .. math:: A_d = e^{A T}, \quad B_d = \int_0^T e^{A t} dt \, B

        Parameters
        ----------
        period
            Sample time T [s].

        Raises
        ------
        ParameterError
            When it is so long that the model's numbers overflow.
        """
        from scipy.linalg import expm

        n = len(self.A)
        acting = np.flatnonzero(self.B.any(axis=0))  # an exponential's cost is that of all columns
        size = n + acting.size
        whole = np.zeros((size, size))
        # Van Loan: the exponential of [[A, B], [0, 0]] holds both integrals, A singular or not.
        whole[:n, :n], whole[:n, n:] = self.A, self.B[:, acting]
        with np.errstate(all="ignore"):
            step = expm(whole * period)
        if not np.isfinite(step).all():
            raise ParameterError(
                f"a model that is sampled every {period:g} s has no finite numbers: take a shorter "
                "sample time"
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
        """Return the states that inputs reach and that reach outputs: the others cost time only."""
        forward, backward = self.B.any(axis=1), self.C.any(axis=0)
        coupled = self.A != 0
        for _ in range(len(self.states)):
            reached = np.count_nonzero(forward) + np.count_nonzero(backward)
            forward = forward | coupled[:, forward].any(axis=1)
            backward = backward | coupled[backward].any(axis=0)
            if np.count_nonzero(forward) + np.count_nonzero(backward) == reached:
                break
        return np.flatnonzero(forward & backward).tolist()


def _places(kind: str, names: Sequence[str], known: tuple[str, ...]) -> list[int]:
    for name in names:
        if name not in known:
            raise unknown_name(kind, name, known)
    return [known.index(name) for name in names]


# --- Poles of sampled models as rates of continuous motions

DEAD = 1e-9
"""poles of less than this size are dead beats: their motion is over within a sample"""
STILL = 1e-6
"""rates of less than this size [1/s] are those of what does not move: integrators at rest"""


def rates(model: LinearModel) -> Complex:
    r"""Return the poles as rates [1/s] of continuous motions, slowest first.

    .. math:: s = \ln(z) / T

    for sampled models; a continuous one has them already. Dead beats are left out. The imaginary
    part is known up to multiples of the sampling frequency only; the least is returned.

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
