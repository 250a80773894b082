"""Harmonics of one base frequency with Schroeder phases, for a flat spectrum and a low peak."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from bywire.bench.stimulus import Amplitude, Level, reached
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Frequency, TimeConstant, Unit

Count = Annotated[int, Unit("1", 16.0), Field(ge=1, le=10_000)]


class Parameters(ParameterSet):
    """Mean, amplitude and number of harmonics."""

    mean: Level
    """mean value, and the value before ``t_start``"""
    amplitude: Amplitude
    """amplitude of each harmonic"""
    f_base: Frequency
    """base frequency: first harmonic and spacing; its inverse is the period"""
    n: Count
    """number n of harmonics: 1, 2, ..., n times the base frequency"""
    t_start: TimeConstant = 0.0
    """time at which the first period begins; the signal jumps there"""

    @model_validator(mode="before")
    @classmethod
    def _counts_harmonics(cls, data: Any) -> Any:
        n = data.get("n") if isinstance(data, dict) else None
        if isinstance(n, float) and not n.is_integer():
            raise ValueError(f"n = {n:g} is not valid: it must be a whole number")
        return data


def sample(t: NDArray[np.float64], par: Parameters) -> NDArray[np.float64]:
    r"""Return the multisine.

    .. math:: u = \bar u + \hat u \sum_{k=1}^{n} \cos(2 \pi k f_b (t - t_0) - \pi k (k - 1) / n)

    The same parameters always give the same signal, because it contains no random numbers. The RMS
    value is :math:`\hat u \sqrt{n / 2}`. For many harmonics, the peak is about 1.7 times the RMS
    value.

    References
    ----------
    M. R. Schroeder, "Synthesis of low-peak-factor signals and binary sequences with low
    autocorrelation", IEEE Transactions on Information Theory 16 (1970).
    """
    angle = 2.0 * math.pi * par.f_base * (t - par.t_start)
    wave = np.zeros_like(angle)
    for k in range(1, par.n + 1):
        wave += np.cos(k * angle - math.pi * k * (k - 1) / par.n)
    return par.mean + par.amplitude * np.where(reached(t, par.t_start), wave, 0.0)
