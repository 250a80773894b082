"""Figures of one linear sampled loop that requirements speak about."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.design.requirement import Requirement
from bywire.analysis.linear.linear_model import LinearModel

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_LOWEST = 1e-2  # lower end of the frequencies looked at, Hz
_REST = 1e-6  # where a response counts as that at rest, Hz
_BAND = 0.02  # of the step: half the settling band
_MOST = 2**15  # samples of a step response: 33 s of a loop of 1 kHz
_NOISE_POINTS = 1000  # frequencies, evenly spaced
_LEFT_AFTER = 10.0  # periods of the bandwidth: when an error counts as steady
_SETTLED = 1e-4  # share of the slowest mode that may be left where a step response ends


@dataclass(frozen=True, eq=False)
class LoopFigures:
    """Figures of a loop, each computed when it is asked for.

    Between the points of a logarithmic grid of frequencies the responses are interpolated:
    400 points are good for 0.1 % of a frequency, 4000 for 0.001 %.

    Parameters
    ----------
    gain
        Loop gain L, one input and one output; the closed loop has 1 + L.
    closed
        From set point to output, of the same sample time.
    points
        Points of the grid.
    """

    gain: LinearModel
    closed: LinearModel
    points: int = 400

    @cached_property
    def frequencies(self) -> Array:
        """The grid [Hz], up to half the sampling frequency."""
        highest = 0.998 * min(self.gain.nyquist, self.closed.nyquist)
        return np.geomspace(_LOWEST, highest, self.points)

    @cached_property
    def growth(self) -> float:
        """Largest magnitude of the closed loop's poles, integrators without effect left out."""
        kept = self.closed.effective()
        poles = np.linalg.eigvals(self.closed.A[np.ix_(kept, kept)])
        return float(np.max(np.abs(poles), initial=0.0))

    @property
    def is_stable(self) -> bool:
        """Whether the closed loop is stable."""
        return self.closed.is_stable

    @cached_property
    def bandwidth(self) -> float:
        """Lowest frequency at which the closed loop has fallen to -3 dB of its gain at rest [Hz].

        The end of the grid where it stays above.
        """
        f, size, level = self.frequencies, np.abs(self._T), self._level
        if size[0] < level:  # a slow integrator: it falls below the grid
            f = np.geomspace(_REST, _LOWEST, self.points)
            size = np.abs(self.closed.response(f)[:, 0, 0])
            size[-1] = min(size[-1], math.nextafter(level, 0.0))
        below = np.flatnonzero(size < level)
        if below.size == 0:
            return float(f[-1])
        return _between(f, np.log(size / level), int(below[0]) - 1)

    def room(self, one: Requirement) -> float:
        """Return the distance of a figure from its limit, as a share of it."""
        return one.slack(float(getattr(self, one.figure)))

    def slack(self, one: Requirement) -> float:
        """Return how far a requirement is met, as a share of its limit: what a search climbs.

        For a bandwidth it is the room of the closed loop's magnitude above -3 dB up to the limit:
        the frequency itself jumps where a dip touches that level.
        """
        if one.figure != "bandwidth" or one.sense < 0:
            return self.room(one)
        f = np.append(self.frequencies[self.frequencies < one.limit], one.limit)
        size = np.append(self._T[: f.size - 1], self.closed.response(f[-1:])[:, 0, 0])
        return float(np.min(np.abs(size))) / self._level - 1.0

    @cached_property
    def crossover(self) -> float:
        """Highest frequency at which the loop gain falls to 1 [Hz]; 0 where it never does."""
        falls = np.flatnonzero((self._size[:-1] >= 0.0) & (self._size[1:] < 0.0))
        return _between(self.frequencies, self._size, int(falls[-1])) if falls.size else 0.0

    @cached_property
    def phase_margin(self) -> float:
        """Smallest phase margin of all gain crossovers [degree]; 180 where there is none."""
        return min((abs(margin) for _, margin in self._crossings), default=180.0)

    @cached_property
    def delay_margin(self) -> float:
        """Additional dead time that the loop can take [s]."""
        return min((margin % 360.0 / 360.0 / f for f, margin in self._crossings), default=math.inf)

    @cached_property
    def gain_margin(self) -> float:
        """Factor above 1 by which the loop gain may grow; inf where any may."""
        L = self._L
        sizes = []
        for k in np.flatnonzero(np.diff(np.signbit(L.imag)) & (L.real[:-1] < 0)):
            share = L.imag[k] / (L.imag[k] - L.imag[k + 1])
            sizes.append(abs(L.real[k] + share * (L.real[k + 1] - L.real[k])))
        # Half the sampling frequency, where L is real, lies beyond the grid.
        if self.gain.period:
            last = float(self.gain.response(np.array([self.gain.nyquist]))[0, 0, 0].real)
            sizes.append(max(-last, 0.0))
        return min((1.0 / float(size) for size in sizes if 0.0 < size < 1.0), default=math.inf)

    @property
    def disk_margin(self) -> float:
        """Symmetric disk margin, 0 to 2."""
        return 2.0 / float(np.max(np.abs((1.0 - self._L) / (1.0 + self._L))))

    @property
    def sensitivity_peak(self) -> float:
        """Largest magnitude of 1/(1 + L)."""
        return float(np.max(1.0 / np.abs(1.0 + self._L)))

    @property
    def complementary_peak(self) -> float:
        """Largest magnitude of L/(1 + L)."""
        return float(np.max(np.abs(self._L / (1.0 + self._L))))

    @cached_property
    def noise_gain(self) -> float:
        """Rms of the output over that of white noise of each measured sample; NaN if analog.

        The root mean square of L/(1 + L) up to half the sampling frequency.
        """
        if not self.gain.period:
            return math.nan
        f = (np.arange(_NOISE_POINTS) + 0.5) / _NOISE_POINTS * self.gain.nyquist
        L = self.gain.response(f)[:, 0, 0]
        return float(np.sqrt(np.mean(np.abs(L / (1.0 + L)) ** 2)))

    @cached_property
    def step(self) -> Array:
        """Response to a unit step at the sampling instants, until it has come to rest.

        By doubling, A^n B for n < 2m follows from those for n < m with one product of matrices.
        """
        rate = max(1.0 - self.growth, 1e-12)
        count = min(max(-math.log(_SETTLED) / rate, 64.0), _MOST)
        kept = self.closed.effective()
        A, power = self.closed.A[np.ix_(kept, kept)], self.closed.B[kept]
        while power.shape[1] < count:
            power, A = np.hstack([power, A @ power]), A @ A
        pulses = (self.closed.C[:, kept] @ power)[0]
        D = self.closed.D[0, 0]
        return np.asarray(D + np.concatenate([[0.0], np.cumsum(pulses)]))

    @property
    def overshoot(self) -> float:
        """Excess of the step's response over its end, at the sampling instants [%]."""
        return 100.0 * max(float(self.step.max()) - 1.0, 0.0)

    @property
    def settling_time(self) -> float:
        """Time after which the response stays within 2 % of the step [s], interpolated."""
        z = np.abs(self.step - 1.0)
        outside = np.flatnonzero(z > _BAND)
        if outside.size == 0:
            return 0.0
        k = int(outside[-1])
        if k == z.size - 1:
            return math.inf
        share = (z[k] - _BAND) / (z[k] - z[k + 1])
        return float((k + share) * self.closed.period)

    @property
    def steady_state_error(self) -> float:
        """What a unit step leaves after ten periods of the bandwidth [%].

        Not for ever: with an integrator nothing would be left, however slow it is.
        """
        last = math.ceil(_LEFT_AFTER / (self.bandwidth * self.closed.period))
        kept = self.closed.effective()
        n = len(kept)
        whole = np.eye(n + 1)  # the step is a state of its own: its power sums the pulses
        whole[:n, :n] = self.closed.A[np.ix_(kept, kept)]
        whole[:n, n] = self.closed.B[kept, 0]
        state = np.linalg.matrix_power(whole, last)[:n, n]
        return 100.0 * abs(1.0 - float(self.closed.C[0, kept] @ state + self.closed.D[0, 0]))

    @cached_property
    def _level(self) -> float:
        """-3 dB below the closed loop's gain at rest."""
        rest = self.closed.response(np.array([_REST]))[0, 0, 0]
        return math.sqrt(0.5) * float(abs(rest))

    @cached_property
    def _L(self) -> Complex:
        return np.asarray(self.gain.response(self.frequencies)[:, 0, 0])

    @cached_property
    def _T(self) -> Complex:
        return np.asarray(self.closed.response(self.frequencies)[:, 0, 0])

    @cached_property
    def _size(self) -> Array:
        return np.log(np.abs(self._L))

    @cached_property
    def _crossings(self) -> list[tuple[float, float]]:
        """Frequency [Hz] and phase margin [degree, -180 to 180] of every gain crossover."""
        phase = np.unwrap(np.angle(-self._L))
        found = []
        for k in np.flatnonzero(np.diff(np.signbit(self._size))):
            share = self._size[k] / (self._size[k] - self._size[k + 1])
            margin = math.degrees(phase[k] + share * (phase[k + 1] - phase[k]))
            f = _between(self.frequencies, self._size, int(k))
            found.append((f, (margin + 180.0) % 360.0 - 180.0))
        return found


def _between(frequencies: Array, values: Array, k: int) -> float:
    """Return the frequency at which logarithms pass zero between points k and k + 1."""
    share = values[k] / (values[k] - values[k + 1])
    low, high = frequencies[k], frequencies[k + 1]
    return float(low * (high / low) ** share)
