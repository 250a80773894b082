"""First-order anti-alias filter in front of a converter."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Frequency
from bywire.core.signals import Signal


class Parameters(ParameterSet):
    """Analog first-order low-pass filter with unity gain."""

    f_aa: Frequency
    """cutoff frequency (-3 dB)"""


class State(NamedTuple):
    """Filtered signal."""

    y: Annotated[float, Signal("1", "filtered reading", 0.5)]


class Rate(NamedTuple):
    """Derivative of the state."""

    y: Annotated[float, Signal("1/s", "rate of the reading", 500.0)]


class Input(NamedTuple):
    """Signal at the input."""

    raw: Annotated[float, Signal("1", "reading, fraction of the range", 0.5)]


def rate(x: State, u: Input, par: Parameters) -> Rate:
    r"""Return the derivative of the filtered reading, 2 pi f_aa (raw - filtered)."""
    return Rate(y=2.0 * math.pi * par.f_aa * (u.raw - x.y))
