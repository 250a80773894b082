"""Figures of a linear control loop: crossover, margins, peaks of S and T, bandwidth, step."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, wraps

import numpy as np

from bywire.analysis.crossings import (
    DROP,
    Crossing,
    GainFactor,
    disk_margin,
    fall,
    gain_crossings,
    gain_factors,
    lower_factor,
    real_factor,
    upper_factor,
)
from bywire.analysis.linear.linear_model import LinearModel
from bywire.core.typing import Array, Complex

NO_LOOP = 1e-9
"""maximum loop gain of a loop without effective feedback"""
_SLOWEST, _SLOW_POINTS = 1e-6, 40  # below the grid, where the loop gain is real, Hz
_BEYOND = 100.0  # times the fastest pole: end of a grid without sampling
_LOWEST = 1e-2  # lower end of the frequency grid, Hz
_NYQUIST = 0.998  # of half the sampling frequency, where the phase is ambiguous
_REST = 1e-6  # Hz: frequency that represents rest
_BAND = 0.02  # of the step: half the settling band
_MOST = 2**15  # samples of a step response: 33 s for a loop of 1 kHz
_NOISE_POINTS = 1000  # frequencies, evenly spaced
_LEFT_AFTER = 10.0  # periods of the bandwidth after which an error is treated as steady
_SETTLED = 1e-4  # maximum remaining fraction of the slowest mode at the end of a step response


@dataclass(frozen=True)
class LoopFigure:
    """Declaration of a figure of a loop: name, unit and meaning.

    Parameters
    ----------
    name
        Name in requirements, and attribute of `LoopFigures` that computes it.
    unit
        SI unit, ``"deg"`` or ``"%"``.
    meaning
        One line.
    low, high
        Range that a loop can have.
    is_less_better
        Whether a smaller value is better.
    margin
        Its name in `LoopMargins`; empty if it is not one of them.
    title
        Heading of tables; if empty, its name in words.
    in_decibel
        Whether it is a factor that may also be specified in dB.
    """

    name: str
    unit: str
    meaning: str
    low: float = 0.0
    high: float = math.inf
    is_less_better: bool = False
    margin: str = ""
    title: str = ""
    in_decibel: bool = False

    @property
    def heading(self) -> str:
        """Name in tables of margins."""
        return self.title or self.name.replace("_", " ")


LOOP_FIGURES: Mapping[str, LoopFigure] = {
    figure.name: figure
    for figure in (
        LoopFigure(
            "bandwidth",
            "Hz",
            "lowest frequency at which the closed loop's gain has fallen by 3 dB",
            margin="bandwidth",
        ),
        LoopFigure(
            "crossover",
            "Hz",
            "highest frequency at which the loop gain falls to 1",
            margin="crossover",
        ),
        LoopFigure(
            "phase_margin",
            "deg",
            "minimum phase margin at all gain crossovers",
            high=180.0,
            margin="phase",
        ),
        LoopFigure(
            "gain_margin",
            "1",
            "factor by which the loop gain may increase, also accepted in dB",
            low=1.0,
            margin="gain",
            in_decibel=True,
        ),
        LoopFigure(
            "lower_gain_margin",
            "1",
            "factor to which the loop gain may decrease, also accepted in dB (below 0)",
            high=1.0,
            is_less_better=True,
            margin="lower_gain",
            in_decibel=True,
        ),
        LoopFigure(
            "delay_margin", "s", "additional dead time that the loop tolerates", margin="delay"
        ),
        LoopFigure("disk_margin", "1", "symmetric disk margin", high=2.0, margin="disk"),
        LoopFigure(
            "sensitivity_peak",
            "1",
            "maximum magnitude of 1/(1 + L)",
            low=1.0,
            is_less_better=True,
            margin="sensitivity",
            title="max |S|",
        ),
        LoopFigure(
            "complementary_peak",
            "1",
            "maximum magnitude of L/(1 + L)",
            is_less_better=True,
            margin="complementary",
            title="max |T|",
        ),
        LoopFigure(
            "noise_gain",
            "1",
            "rms of the output relative to the rms of white noise in each measured sample",
            is_less_better=True,
        ),
        LoopFigure(
            "overshoot",
            "%",
            "overshoot of the unit step response at the sample times",
            is_less_better=True,
        ),
        LoopFigure(
            "settling_time",
            "s",
            "settling time of the unit step response, to within 2 % of the step height",
            is_less_better=True,
        ),
        LoopFigure(
            "steady_state_error",
            "%",
            "remaining error of the unit step response after ten periods of the bandwidth "
            "frequency",
            is_less_better=True,
        ),
    )
}
"""every figure of a loop by its name, for margins, requirements and documentation"""

Figure = Callable[["LoopFigures"], float]


def _of_a_loop(figure: Figure) -> Figure:
    """Make a figure NaN if there is no loop."""

    @wraps(figure)
    def guarded(figures: LoopFigures) -> float:
        return figure(figures) if figures.has_loop else math.nan

    return guarded


def _of_an_answer(figure: Figure) -> Figure:
    """Make a figure NaN if the output does not respond."""

    @wraps(figure)
    def guarded(figures: LoopFigures) -> float:
        return figure(figures) if figures.answers else math.nan

    return guarded


@dataclass(frozen=True, eq=False)
class LoopFigures:
    """Figures of a linear loop, each computed on demand.

    Responses are interpolated between the points of a logarithmic frequency grid: 400 points have
    an error of 0.1 % of a frequency, 4000 points of 0.001 %.

    Parameters
    ----------
    gain
        Loop gain L, one input and one output; the closed loop has 1 + L.
    closed
        Closed loop from set point to output, with the same sample time.
    points
        Points of the grid.
    exact
        Whether to solve for crossovers and bandwidth between the points (too slow for a search).
    lowest
        Lower end of the grid [Hz].
    """

    gain: LinearModel
    closed: LinearModel
    points: int = 400
    exact: bool = False
    lowest: float = _LOWEST

    @cached_property
    def frequencies(self) -> Array:
        """The grid [Hz], up to half the sampling frequency; without sampling, beyond all poles."""
        highest = _NYQUIST * min(self.gain.nyquist, self.closed.nyquist)
        if math.isinf(highest):
            rates = np.abs(np.concatenate([self.gain.poles(), self.closed.poles()]))
            highest = max(_BEYOND * float(rates.max(initial=0.0)) / (2.0 * math.pi), 1.0)
        return np.geomspace(self.lowest, highest, self.points)

    @cached_property
    def L(self) -> Complex:
        """Loop gain on the grid, shape (points,)."""
        return self._gain_at(self.frequencies)

    @cached_property
    def has_loop(self) -> bool:
        """Whether there is feedback: with gains of 0, or a closed valve, there is no loop."""
        return bool(np.max(np.abs(self.L)) > NO_LOOP)

    @cached_property
    def answers(self) -> bool:
        """Whether the output responds to the set point."""
        return bool(np.max(np.abs(self.T)) > 0.0)

    @cached_property
    def growth(self) -> float:
        """Maximum magnitude of the closed loop's poles, without ineffective integrators."""
        kept = self.closed.effective()
        poles = np.linalg.eigvals(self.closed.A[np.ix_(kept, kept)])
        return float(np.max(np.abs(poles), initial=0.0))

    @property
    def is_stable(self) -> bool:
        """Whether the closed loop is stable."""
        return self.closed.is_stable

    @cached_property
    @_of_an_answer
    def bandwidth(self) -> float:
        """Lowest frequency at which the closed loop has fallen to -3 dB of its gain at rest [Hz].

        The end of the grid if it stays above.
        """
        return min(self.fall, float(self.frequencies[-1]))

    @cached_property
    def rest(self) -> float:
        """Magnitude of the closed loop at rest."""
        return float(abs(self._closed_at(np.array([_REST]))[0]))

    @cached_property
    def T(self) -> Complex:
        """Closed loop on the grid, shape (points,)."""
        return self._closed_at(self.frequencies)

    @property
    @_of_a_loop
    def crossover(self) -> float:
        """Highest frequency at which the loop gain falls to 1 [Hz]; 0 if it never does."""
        return max((at.frequency for at in self.crossings if at.falls), default=0.0)

    @property
    @_of_a_loop
    def phase_margin(self) -> float:
        """Minimum phase margin of all gain crossovers [degree]; 180 if there is none."""
        return min((at.distance for at in self.crossings), default=180.0)

    @property
    @_of_a_loop
    def delay_margin(self) -> float:
        """Additional dead time that the loop tolerates [s]; inf without a crossover."""
        # Angle to -1 in the direction of a delay, which rotates clockwise.
        return min(
            (at.margin % 360.0 / 360.0 / at.frequency for at in self.crossings), default=math.inf
        )

    @cached_property
    def factors(self) -> list[GainFactor]:
        """Factors on the loop gain at the limit of stability, by ascending frequency."""
        solved = self._gain_at if self.exact else None
        slow = np.geomspace(_SLOWEST, self.lowest, _SLOW_POINTS, endpoint=False)
        f = np.concatenate([slow, self.frequencies])
        L = np.concatenate([self._gain_at(slow), self.L])
        # Beyond both ends of the grid, L is real: at rest, and at half the sampling frequency.
        at_rest = real_factor(self._real_at(0.0), 0.0)
        last = self.gain.nyquist
        at_last = real_factor(self._real_at(last), last) if self.gain.period else []
        return [*at_rest, *gain_factors(f, L, solved), *at_last]

    @property
    @_of_a_loop
    def gain_margin(self) -> float:
        """Factor above 1 by which the loop gain may grow; inf if there is no limit."""
        return upper_factor(self.factors).factor

    @property
    @_of_a_loop
    def lower_gain_margin(self) -> float:
        """Factor below 1 to which the loop gain may fall; 0 if there is no limit."""
        return lower_factor(self.factors).factor

    @property
    @_of_a_loop
    def disk_margin(self) -> float:
        """Symmetric disk margin, 0 to 2."""
        return disk_margin(self.L)

    @property
    @_of_a_loop
    def sensitivity_peak(self) -> float:
        """Maximum magnitude of 1/(1 + L)."""
        return float(np.max(1.0 / np.abs(1.0 + self.L)))

    @property
    @_of_a_loop
    def complementary_peak(self) -> float:
        """Maximum magnitude of L/(1 + L)."""
        return float(np.max(np.abs(self.L / (1.0 + self.L))))

    @cached_property
    @_of_a_loop
    def noise_gain(self) -> float:
        """Ratio of the output's rms to that of white noise in each sample; NaN if analog.

        It is the root mean square of L/(1 + L) up to half the sampling frequency.
        """
        if not self.gain.period:
            return math.nan
        # Sampled white noise has a flat spectrum, so midpoints of equal bands integrate it.
        f = (np.arange(_NOISE_POINTS) + 0.5) / _NOISE_POINTS * self.gain.nyquist
        L = self._gain_at(f)
        return float(np.sqrt(np.mean(np.abs(L / (1.0 + L)) ** 2)))

    @cached_property
    def step(self) -> Array:
        """Response to a unit step at the sample times, until it is at rest.

        By doubling, A^n B for n < 2m follows from A^n B for n < m with one product of matrices.
        """
        rate = max(1.0 - self.growth, 1e-12)  # of the slowest mode, per sample
        count = min(max(-math.log(_SETTLED) / rate, 64.0), _MOST)
        kept = self.closed.effective()
        A, power = self.closed.A[np.ix_(kept, kept)], self.closed.B[kept]
        while power.shape[1] < count:
            power, A = np.hstack([power, A @ power]), A @ A
        pulses = (self.closed.C[:, kept] @ power)[0]
        D = self.closed.D[0, 0]
        return np.asarray(D + np.concatenate([[0.0], np.cumsum(pulses)]))

    @property
    @_of_an_answer
    def overshoot(self) -> float:
        """Excess of the step response over its final value, at the sample times [%]."""
        return 100.0 * max(float(self.step.max()) - 1.0, 0.0)

    @property
    @_of_an_answer
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
    @_of_an_answer
    def steady_state_error(self) -> float:
        """Remaining error of a unit step after ten periods of the bandwidth [%].

        The time is finite, because even a slow integrator finally eliminates the error.
        """
        last = math.ceil(_LEFT_AFTER / (self.bandwidth * self.closed.period))
        kept = self.closed.effective()
        n = len(kept)
        whole = np.eye(n + 1)  # the step is an additional state, so a power sums the pulses
        whole[:n, :n] = self.closed.A[np.ix_(kept, kept)]
        whole[:n, n] = self.closed.B[kept, 0]
        state = np.linalg.matrix_power(whole, last)[:n, n]
        return 100.0 * abs(1.0 - float(self.closed.C[0, kept] @ state + self.closed.D[0, 0]))

    @cached_property
    def crossings(self) -> list[Crossing]:
        """Crossovers of the loop gain."""
        return gain_crossings(self.frequencies, self.L, self._gain_at if self.exact else None)

    @cached_property
    def fall(self) -> float:
        """Bandwidth [Hz]; infinite if the closed loop stays above -3 dB."""
        solved = self._closed_at if self.exact else None
        at = fall(np.abs(self.T), self.frequencies, self.rest, solved)
        if at == 0.0:  # a slow integrator, whose gain falls below the grid
            f = np.geomspace(_REST, self.lowest, self.points)
            size = np.abs(self._closed_at(f))
            size[-1] = min(size[-1], math.nextafter(DROP * self.rest, 0.0))
            at = fall(size, f, self.rest, solved)
        return at

    def _real_at(self, frequency: float) -> float:
        """Return the loop gain at a frequency [Hz] at which it is real; NaN if it integrates."""
        try:
            return float(self._gain_at(np.array([frequency]))[0].real)
        except np.linalg.LinAlgError:
            return math.nan

    def _gain_at(self, frequencies: Array) -> Complex:
        return np.asarray(self.gain.response(frequencies)[:, 0, 0])

    def _closed_at(self, frequencies: Array) -> Complex:
        return np.asarray(self.closed.response(frequencies)[:, 0, 0])
