"""Transfer functions with named signals: zeros, poles and gain of one path of a linear model."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from bywire.analysis.linear.minimal import Realization, minimal, zeros
from bywire.core.errors import ParameterError
from bywire.core.typing import Array, Complex

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
