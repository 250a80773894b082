"""A sine around a mean value."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from bywire.bench.stimulus import Amplitude, Level, reached
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Frequency, TimeConstant, Unit

Phase = Annotated[float, Unit("rad"), Field(allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Mean, amplitude, frequency and phase."""

    mean: Level
    """mean value, and the value before ``t_start``"""
    amplitude: Amplitude
    """amplitude: half the peak-to-peak value"""
    f: Frequency
    """frequency"""
    phase: Phase = 0.0
    """phase at ``t_start``; the signal jumps there unless the phase is a multiple of pi"""
    t_start: TimeConstant = 0.0
    """time at which the oscillation begins"""


def sample(t: NDArray[np.float64], par: Parameters) -> NDArray[np.float64]:
    r"""Return the sine.

    .. math:: u = \bar u + \hat u \sin(2 \pi f (t - t_0) + \varphi), \quad t \ge t_0
    """
    wave = np.sin(2.0 * math.pi * par.f * (t - par.t_start) + par.phase)
    return par.mean + par.amplitude * np.where(reached(t, par.t_start), wave, 0.0)
