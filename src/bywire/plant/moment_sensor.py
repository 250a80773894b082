"""Sensor of the braking moment at the caliper's mount."""

from __future__ import annotations

import math
from typing import Annotated

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Frequency
from bywire.core.signals import Signal

Moment = Annotated[float, Signal("N*m", "braking moment", 300.0)]


class Parameters(ParameterSet):
    """First-order lag of the mount and its amplifier, calibrated."""

    f_M: Frequency
    """corner frequency"""


def rate(
    shown: Moment, moment: Moment, par: Parameters
) -> Annotated[float, Signal("N*m/s", "rate of the shown moment", 1e4)]:
    r"""Return the derivative of the shown moment, :math:`2 \pi f_M (M_B - M)`."""
    return 2.0 * math.pi * par.f_M * (moment - shown)
