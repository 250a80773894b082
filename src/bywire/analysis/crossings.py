"""Crossings of a level by a response: gain and phase crossovers, margins, bandwidth.

The response may be computed or measured, at ascending frequencies. Between its points, it is
interpolated linearly on logarithmic axes, or evaluated exactly if it is available as a function.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from bywire.core.typing import Array, Complex
from bywire.core.undefined import EqualWhereUndefined

Response = Callable[[Array], Complex]
"""``response(frequencies [Hz]) -> complex``, shape (n,) each"""

DROP = math.sqrt(0.5)
"""fraction of its initial magnitude to which a response has fallen at its bandwidth: -3 dB"""
NEARLY_ZERO = 1.0
"""phase [degree] at the lower end that is still treated as 0: a loop of finite gain"""
_BRACKETS = 4000  # points of the grid that brackets crossings of a function of frequency


class Crossing(NamedTuple):
    """Frequency at which a loop gain is 1.

    Parameters
    ----------
    frequency
        Frequency [Hz].
    margin
        Phase margin there [degree]: 180 plus the phase. The phase is unwrapped from the lowest
        frequency, where it is between -360 and 0: a loop with integral action starts near -90.
    falls
        Whether the gain falls there.
    """

    frequency: float
    margin: float
    falls: bool

    @property
    def distance(self) -> float:
        """Angle between the loop gain and -1, in either direction [degree, 0 to 180]."""
        return abs((self.margin + 180.0) % 360.0 - 180.0)


def gain_crossings(
    frequencies: Array, L: Complex, response: Response | None = None
) -> list[Crossing]:
    """Return the crossovers of a loop gain, falling or rising, by ascending frequency.

    Parameters
    ----------
    frequencies, L
        Frequencies [Hz], ascending, and loop gain there (without the sign of negative feedback),
        shape (n,) each.
    response
        The loop gain as a function, to solve for crossings to rounding error.
    """
    size, phase = np.log(np.abs(L)), np.unwrap(np.angle(-L))
    # L between -360 and 0 degree is -L between -180 and 180.
    turns = math.ceil((math.degrees(phase[0]) - 180.0 - NEARLY_ZERO) / 360.0)
    crossings = []
    for k in map(int, np.flatnonzero(np.diff(np.signbit(size)))):
        if response is None:
            at = _passing(frequencies, size, k)
            share = size[k] / (size[k] - size[k + 1])
            angle = phase[k] + share * (phase[k + 1] - phase[k])
        else:
            at = _solved(response, 1.0, frequencies[k], frequencies[k + 1])
            angle = np.unwrap([phase[k], np.angle(-response(np.array([at]))[0])])[1]
        margin = math.degrees(angle) - 360.0 * turns
        crossings.append(Crossing(at, margin, not np.signbit(size[k])))
    return crossings


@dataclass(frozen=True, eq=False)
class Margin(EqualWhereUndefined):
    """Stability margin of an open loop.

    Parameters
    ----------
    crossover
        Highest frequency at which the loop gain falls to 1 [Hz]; NaN if it never does.
    phase
        Minimum phase margin of all frequencies at which the loop gain is 1 [degree]; NaN likewise.
        The frequency nearest to -1 counts, for falling and rising gain.
    at
        Frequency of the phase margin [Hz]; NaN likewise.
    """

    crossover: float
    phase: float
    at: float = math.nan


def margin_of(crossings: Sequence[Crossing]) -> Margin:
    """Return crossover and phase margin of a loop gain with these crossings of 1."""
    falls = [crossing.frequency for crossing in crossings if crossing.falls]
    if not falls:
        return Margin(math.nan, math.nan)
    nearest = min(crossings, key=lambda crossing: crossing.distance)
    return Margin(falls[-1], nearest.margin, nearest.frequency)


def margin(loop: Response, band: tuple[float, float]) -> Margin:
    """Return crossover and phase margin of a loop gain within a band [Hz]."""
    f = np.geomspace(*band, _BRACKETS)
    return margin_of(gain_crossings(f, loop(f), loop))


def measured_margin(frequencies: Array, L: Complex) -> Margin:
    """Return crossover and phase margin of a loop gain that is known only at some frequencies [Hz].

    The margin is the distance from -1, within 180 degree. It is NaN if the gain does not fall to 1
    within the frequencies. The crossover is then infinite if the gain ends above 1. Without loop
    gain, both are NaN.
    """
    if not (np.isfinite(L).all() and L.all()):
        return Margin(math.nan, math.nan)
    if abs(L[-1]) >= 1.0:
        return Margin(math.inf, math.nan)
    crossings = gain_crossings(frequencies, L)
    distances = [crossing.distance for crossing in crossings]
    return replace(margin_of(crossings), phase=min(distances, default=math.nan))


def fall(
    gain: Array, frequencies: Array, start: float = 1.0, response: Response | None = None
) -> float:
    """Return the lowest frequency at which a gain has fallen to -3 dB.

    Parameters
    ----------
    gain
        Magnitudes, shape (n,); NaN, where the output sticks, is treated as 0.
    frequencies
        Ascending [Hz], shape (n,).
    start
        Reference magnitude, in the gain's unit: that at standstill.
    response
        The response as a function, to solve for the frequency to rounding error.

    Returns
    -------
    float
        Frequency in Hz; 0 if the gain is below -3 dB from the lowest frequency on, infinity if it
        stays above.
    """
    size, level = np.nan_to_num(gain), DROP * start
    below = np.flatnonzero(size < level)
    if below.size == 0:
        return math.inf
    k = int(below[0])
    if k == 0:
        return 0.0
    if size[k] == 0.0:  # the response ends there: the last frequency at which the output moved
        return float(frequencies[k - 1])
    if response is not None:
        return _solved(response, level, frequencies[k - 1], frequencies[k])
    return _passing(frequencies[k - 1 :], np.log(size[k - 1 : k + 1] / level), 0)


def bandwidth(response: Response, band: tuple[float, float]) -> float:
    """Return the frequency of -3 dB relative to the band's lower end [Hz]; NaN if there is none.

    Parameters
    ----------
    response
        Any response.
    band
        Frequencies to search [Hz].
    """
    f = np.geomspace(*band, _BRACKETS)
    size = np.abs(response(f))
    at = fall(size, f, float(size[0]), response)
    return at if math.isfinite(at) else math.nan


def disk_margin(L: Complex) -> float:
    """Return the symmetric disk margin (skew 0) of a loop gain, 0 to 2."""
    return 2.0 / float(np.max(np.abs((1.0 - L) / (1.0 + L))))


class GainFactor(NamedTuple):
    """Factor on the loop gain at the limit of stability.

    Parameters
    ----------
    factor
        Above 1 if the loop gain may grow by this factor, below 1 if it may fall to it.
    frequency
        Frequency at which the loop gain times the factor is -1 [Hz].
    """

    factor: float
    frequency: float


def gain_factors(
    frequencies: Array, L: Complex, response: Response | None = None
) -> list[GainFactor]:
    """Return the factors with which a loop gain passes through -1, by ascending frequency.

    Parameters
    ----------
    frequencies, L
        Frequencies [Hz], ascending, and loop gain there, shape (n,) each.
    response
        The loop gain as a function, to solve for factors to rounding error.
    """
    factors = []
    for k in map(int, np.flatnonzero(np.diff(np.signbit(L.imag)))):
        share = float(L.imag[k] / (L.imag[k] - L.imag[k + 1]))
        at = float(frequencies[k] * (frequencies[k + 1] / frequencies[k]) ** share)
        real = float(L.real[k] + share * (L.real[k + 1] - L.real[k]))
        if response is not None and real < 0.0:
            at = _solved_real(response, frequencies[k], frequencies[k + 1])
            real = float(response(np.array([at]))[0].real)
        factors += real_factor(real, at)
    return factors


def real_factor(real: float, frequency: float) -> list[GainFactor]:
    """Return the factor of a loop gain that is real at a frequency [Hz]; empty if positive."""
    if not (math.isfinite(real) and real < 0.0):
        return []
    return [GainFactor(-1.0 / real, frequency)]


def upper_factor(factors: Sequence[GainFactor]) -> GainFactor:
    """Return the factor by which a stable loop's gain may grow; inf without a limit."""
    return min((each for each in factors if each.factor > 1.0), default=_ANY_GROWTH)


def lower_factor(factors: Sequence[GainFactor]) -> GainFactor:
    """Return the factor to which a stable loop's gain may fall; 0 without a limit."""
    lower = (each for each in factors if _LEAST_FACTOR < each.factor < 1.0)
    return max(lower, default=_ANY_FALL)


_ANY_GROWTH, _ANY_FALL = GainFactor(math.inf, math.nan), GainFactor(0.0, math.nan)
_LEAST_FACTOR = 1e-9  # below it, L is infinite, at a pole on the stability limit


def _passing(frequencies: Array, values: Array, k: int) -> float:
    """Return the frequency at which logarithms cross zero between points k and k + 1."""
    share = values[k] / (values[k] - values[k + 1])
    low, high = frequencies[k], frequencies[k + 1]
    return float(low * (high / low) ** share)


def _solved_real(response: Response, low: float, high: float) -> float:
    """Return the frequency between two others at which a response is real."""
    from scipy.optimize import brentq

    return float(brentq(lambda f: float(response(np.array([f]))[0].imag), low, high))


def _solved(response: Response, level: float, low: float, high: float) -> float:
    """Return the frequency between two others at which a magnitude crosses a level."""
    from scipy.optimize import brentq

    def excess(f: float) -> float:
        return float(np.abs(response(np.array([f])))[0]) - level

    return float(brentq(excess, low, high))
