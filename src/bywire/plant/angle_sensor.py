"""Rotor angle sensor with offset, harmonics due to eccentricity, and quantization."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import Signal

Angle = Annotated[float, Signal("rad", "motor angle", 3.0)]
AngleError = Annotated[float, Unit("rad", 0.01), Field(ge=-1, le=1, allow_inf_nan=False)]
Phase = Annotated[float, Unit("rad", 1.0), Field(ge=-7, le=7, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Sensor of the mechanical angle, without delay.

    ``law``: with ``"real"``, the reading has the errors below, and is rounded to whole counts.
    """

    law: Literal["ideal", "real"]
    """whether the sensor has errors"""
    eps_0: AngleError
    """offset"""
    eps_1: AngleError
    """amplitude of the first-order error (once per revolution)"""
    phi_1: Phase
    """phase of the first-order error"""
    eps_2: AngleError
    """amplitude of the second-order error (twice per revolution)"""
    phi_2: Phase
    """phase of the second-order error"""
    counts: Annotated[float, Unit("1", 4096.0), Field(gt=0, allow_inf_nan=False)]
    """counts per revolution"""


FAULTS = (
    ParameterFault(
        "turned",
        "sensor turned on the shaft (value: offset)",
        replaced="eps_0",
        value=0.0175,
        with_it={"law": "real"},
    ),
)


def reading(theta: Angle, par: Parameters) -> Angle:
    r"""Return the angle that the sensor reads.

    .. math:: \theta + \epsilon_0 + \epsilon_1 \sin(\theta + \varphi_1)
        + \epsilon_2 \sin(2 \theta + \varphi_2)

    The reading is rounded to the nearest count.
    """
    if par.law == "ideal":
        return theta
    once = par.eps_1 * ops.sin(theta + par.phi_1)
    twice = par.eps_2 * ops.sin(2.0 * theta + par.phi_2)
    count = 2.0 * math.pi / par.counts
    return count * ops.floor((theta + par.eps_0 + once + twice) / count + 0.5)
