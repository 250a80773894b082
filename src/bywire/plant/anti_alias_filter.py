"""First-order anti-alias filter in front of a converter."""

from __future__ import annotations

import math
from typing import Annotated

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Frequency
from bywire.core.signals import Signal

Reading = Annotated[float, Signal("1", "reading, share of the range", 0.5)]


class Parameters(ParameterSet):
    """Analog low-pass of first order and unit gain."""

    f_aa: Frequency
    """cut-off frequency (-3 dB)"""


def rate(
    filtered: Reading, raw: Reading, par: Parameters
) -> Annotated[float, Signal("1/s", "rate of the reading", 500.0)]:
    r"""Return the derivative of the filtered reading, 2 pi f_aa (raw - filtered)."""
    return 2.0 * math.pi * par.f_aa * (raw - filtered)
