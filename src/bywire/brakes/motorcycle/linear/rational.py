"""Transfer functions as plain numbers: gain, zeros and poles, SI inside, Hz and bar at the edge."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from bywire.core.typing import Array, Complex

_BAR = 1e5


@dataclass(frozen=True)
class Rational:
    """A transfer function from current to pressure, SI.

    ``name``: what figures and messages call it; ``num``, ``den``: coefficients of numerator [Pa/A]
    and denominator, highest power of s first.
    """

    name: str
    num: tuple[float, ...]
    den: tuple[float, ...]

    @property
    def gain(self) -> float:
        """Static gain [Pa/A]."""
        return self.num[-1] / self.den[-1]

    @property
    def gain_bar(self) -> float:
        """Static gain [bar/A]."""
        return self.gain / _BAR

    @property
    def zeros(self) -> Complex:
        """Zeros [rad/s], the slowest first."""
        return _sorted_roots(self.num)

    @property
    def poles(self) -> Complex:
        """Poles [rad/s], the slowest first."""
        return _sorted_roots(self.den)

    @property
    def zeros_hz(self) -> Array:
        """Frequencies of the zeros [Hz], the slowest first."""
        return np.abs(self.zeros) / (2.0 * math.pi)

    @property
    def poles_hz(self) -> Array:
        """Frequencies of the poles [Hz], the slowest first."""
        return np.abs(self.poles) / (2.0 * math.pi)

    def response(self, frequencies: Array) -> Complex:
        """Return the frequency response [Pa/A] at frequencies [Hz], shape (n,)."""
        s = 2j * math.pi * np.asarray(frequencies, dtype=float)
        return np.asarray(np.polyval(self.num, s) / np.polyval(self.den, s))

    def step(self, t: Array) -> Array:
        r"""Return the response to a unit step at t = 0 [Pa/A], by partial fractions.

        .. math:: y = K + \sum_k \frac{b(\lambda_k)}{\lambda_k a'(\lambda_k)} e^{\lambda_k t}

        Parameters
        ----------
        t
            Times [s]; the response is 0 before 0.

        Notes
        -----
        Valid for simple poles, none at zero, and more poles than zeros.
        """
        slope = np.polyder(np.array(self.den))
        after = np.maximum(np.asarray(t, dtype=float), 0.0)
        y = np.full(after.shape, self.gain, dtype=complex)
        for pole in self.poles:
            share = np.polyval(self.num, pole) / (pole * np.polyval(slope, pole))
            y += share * np.exp(pole * after)
        return np.where(np.asarray(t) >= 0.0, y.real, 0.0)

    def transfer_function(self) -> Any:
        """Return it as ``control.TransferFunction`` [Pa/A]."""
        import control

        return control.tf(list(self.num), list(self.den), name=self.name)


def first_orders(
    name: str, gain: float, zeros_hz: tuple[float, ...], poles_hz: tuple[float, ...]
) -> Rational:
    r"""Return the transfer function of eqs. (21) and (22).

    .. math:: G = K \prod (1 + s \tau_j) / \prod (1 + s T_k)

    ``name``: what figures and messages call it; ``gain``: static gain K [Pa/A]; ``zeros_hz``,
    ``poles_hz``: corner frequencies 1/(2 pi tau_j) and 1/(2 pi T_k) [Hz].
    """

    def product(corners: tuple[float, ...]) -> Array:
        coefficients: Array = np.ones(1)
        for hertz in corners:
            factor = [1.0 / (2.0 * math.pi * hertz), 1.0]
            coefficients = np.asarray(np.polymul(coefficients, factor))
        return coefficients

    return Rational(
        name, tuple(float(v) for v in gain * product(zeros_hz)), tuple(product(poles_hz).tolist())
    )


def _sorted_roots(coefficients: tuple[float, ...]) -> Complex:
    roots = np.roots(coefficients).astype(np.complex128)
    return roots[np.argsort(np.abs(roots))]
