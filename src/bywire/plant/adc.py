"""Analog-to-digital converter with input noise and finite resolution, sampled at each tick."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import Signal

Reading = Annotated[float, Signal("1", "reading, fraction of the range", 0.5)]
Noise = Annotated[float, Signal("1", "standard normal noise", 1.0)]


class Parameters(ParameterSet):
    """Uniform quantizer over the sensor's span, which rounds to the nearest code.

    N codes, 0 to N - 1, represent the readings 0, 1/N, ..., 1 - 1/N. With 12 bits there are 4096
    distinct codes, the middle of the span is exactly code 2048, and the highest code is one step
    below the end of the span.
    """

    law: Literal["ideal", "quantized"]
    """whether the reading is rounded to whole codes"""
    codes: Annotated[float, Unit("1", 4096.0), Field(ge=2, allow_inf_nan=False)]
    """number of distinct codes over the span, 4096 for 12 bits"""
    noise: Annotated[float, Unit("1", 1e-3), Field(ge=0, le=1, allow_inf_nan=False)]
    """standard deviation of the input noise, as a fraction of the span"""


def sample(reading: Reading, noise: Noise, par: Parameters) -> Reading:
    """Return the converted reading.

    Parameters
    ----------
    reading
        Input as a fraction of the span.
    noise
        A sample of a standard normal variable. The recording contains its seed.
    """
    return rounded(noisy(reading, noise, par), par)


def noisy(reading: Reading, noise: Noise, par: Parameters) -> Reading:
    """Return the reading with the converter's input noise."""
    return reading + par.noise * noise


def rounded(reading: Reading, par: Parameters) -> Reading:
    """Return the reading of the nearest code."""
    if par.law == "ideal":
        return reading
    return ops.clip(ops.floor(reading * par.codes + 0.5), 0.0, par.codes - 1.0) / par.codes
