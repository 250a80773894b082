r"""Phase margin of a loop with friction and dither on, from its measured closed response.

Controller and sensor are linear between their limits. What the closed loop G, measured with a sine
of one amplitude, leaves for the rest P (actuator, friction, dither) follows from the loop's laws
C_r (set point) and C_y (output, sensor included):

.. math:: G = \frac{C_r P}{1 + C_y P}, \quad L = C_y P = \frac{C_y G}{C_r - C_y G}

P is the describing function at that amplitude of the set point, so the margin is one of small and
middle-sized motion, not a proof of stability in the large. Scheduled gains count as those at the
operating point: within a blend that is exact for small sines only.
"""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.analysis.loop import Loop
from bywire.core.parameters import ParameterSet

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def loop_gain(
    loop: Loop, par: ParameterSet, value: float, closed: Complex, frequencies: Array
) -> Complex | None:
    """Return the loop gain behind a measured closed response.

    Parameters
    ----------
    loop, par, value
        Loop, and the parameters and operating point it was measured with.
    closed, frequencies
        Response and frequencies [Hz], shape (n,).

    Returns
    -------
    numpy.ndarray or None
        Shape (n,); None for a loop whose laws are not known.
    """
    if loop.laws is None:
        return None
    demand, feedback = loop.laws(par, value, frequencies)
    return np.asarray(feedback * closed / (demand - feedback * closed))


def phase_margin(gain: Complex, frequencies: Array) -> tuple[float, float]:
    """Return phase margin [degree] and crossover [Hz] of a measured loop gain.

    The smallest margin of all passes through 1, and the highest frequency at which the gain falls
    to it, interpolated on logarithmic axes. NaN where the measured frequencies hold no fall, with
    a crossover of infinity where the gain ends above 1: then it falls only beyond them.
    """
    size, phase = np.log(np.abs(gain)), np.unwrap(np.angle(-gain))
    if size[-1] >= 0.0:
        return math.nan, math.inf
    above = size >= 0.0
    margins, crossover = [math.nan], math.nan
    for k in np.flatnonzero(above[:-1] != above[1:]):
        share = size[k] / (size[k] - size[k + 1])
        margin = math.degrees(phase[k] + share * (phase[k + 1] - phase[k]))
        margins.append(abs((margin + 180.0) % 360.0 - 180.0))
        if above[k]:
            step = frequencies[k + 1] / frequencies[k]
            crossover = float(frequencies[k] * step**share)
    if math.isnan(crossover):
        return math.nan, math.nan
    return min(margins[1:]), crossover


def response_of(one: xr.Dataset) -> tuple[Complex, Array]:
    """Return the response of one variant and amplitude, and its frequencies [Hz].

    Frequencies at which the output stuck are left out.
    """
    known = np.isfinite(one["gain"].values)
    value = one["gain"].values * np.exp(1j * np.radians(one["phase"].values))
    return np.asarray(value[known]), np.asarray(one["frequency"].values[known])
