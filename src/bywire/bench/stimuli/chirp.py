"""A sine whose frequency sweeps from one value to another, with a continuous phase."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bywire.bench.stimulus import Amplitude, Level
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency, TimeConstant


class Parameters(ParameterSet):
    """Mean, amplitude and frequencies."""

    mean: Level
    """mean value, and the value before ``t_start``"""
    amplitude: Amplitude
    """amplitude: half the peak-to-peak value"""
    f_start: Frequency
    """frequency at the beginning"""
    f_end: Frequency
    """frequency at the end, above or below ``f_start``"""
    t_sweep: Duration
    """duration of the sweep; afterward the sine continues at ``f_end``"""
    t_start: TimeConstant = 0.0
    """time at which the sweep begins, with phase zero"""
    sweep: Literal["linear", "logarithmic"]
    """variation of the frequency: linear in time, or logarithmic"""


def sample(t: NDArray[np.float64], par: Parameters) -> NDArray[np.float64]:
    r"""Return the swept sine.

    .. math:: u = \bar u + \hat u \sin\left(2 \pi \int_{t_0}^{t} f \, d\tau\right)

    with :math:`f = f_0 + (f_1 - f_0) s` (linear) or :math:`f = f_0 (f_1/f_0)^s` (logarithmic),
    where :math:`s` is the elapsed fraction of the sweep. The phase is the exact integral of the
    frequency, so the signal has no jump, either within the sweep or at its end.
    """
    elapsed = np.maximum(t - par.t_start, 0.0)
    within = np.minimum(elapsed, par.t_sweep)
    turns = _turns(within, par) + par.f_end * (elapsed - within)
    return par.mean + par.amplitude * np.sin(2.0 * math.pi * turns)


def _turns(elapsed: NDArray[np.float64], par: Parameters) -> NDArray[np.float64]:
    """Return the integral of the frequency over the elapsed time [s] of the sweep."""
    s = elapsed / par.t_sweep
    if par.sweep == "linear":
        return par.t_sweep * (par.f_start * s + 0.5 * (par.f_end - par.f_start) * s**2)
    k = math.log(par.f_end / par.f_start)
    if k == 0.0:
        return par.f_start * elapsed
    return par.f_start * par.t_sweep * np.expm1(k * s) / k
