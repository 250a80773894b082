"""Sampled second-order low-pass filter."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

from annotated_types import Gt

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Factor, Frequency
from bywire.core.signals import Signal

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]


class Parameters(ParameterSet):
    """Filter between pressure and current controller, next to eq. (20) in the signal chain.

    ``place`` determines where the dither is added. ``"after-dither"`` filters demand plus dither
    (the wording of the paper), ``"before-dither"`` filters only the demand.
    """

    f_c: Frequency
    """cutoff frequency"""
    zeta: Factor
    """damping ratio; with 1/sqrt(2), the gain at the cutoff frequency is -3 dB"""
    place: Literal["after-dither", "before-dither"]
    """whether the filter acts on the demand plus the dither, or only on the demand"""


class State(NamedTuple):
    """States of the two integrators (transposed trapezoidal form)."""

    s1: Annotated[float, Signal("A", "first integrator", 1.0)]
    s2: Annotated[float, Signal("A", "second integrator", 5.0)]


class Output(NamedTuple):
    """Filtered signal."""

    y: Annotated[float, Signal("A", "filtered current demand", 5.0)]


def output(
    x: State,
    u: Annotated[float, Signal("A", "current demand", 5.0)],
    T: SampleTime,
    par: Parameters,
) -> tuple[State, Output]:
    r"""Advance the filter by one sample.

    .. math:: \frac{\omega_c^2}{s^2 + 2 \zeta \omega_c s + \omega_c^2}

    with the trapezoidal rule and a prewarped cutoff frequency, so that the cutoff stays at f_c. It
    is valid for f_c T < 0.5.
    """
    angle = math.pi * par.f_c * T
    g = ops.sin(angle) / ops.cos(angle)
    a = 1.0 / (1.0 + 2.0 * par.zeta * g + g * g)
    band = a * (x.s1 + g * (u - x.s2))
    low = x.s2 + g * band
    return State(s1=2.0 * band - x.s1, s2=2.0 * low - x.s2), Output(y=low)


def at_rest(y: Annotated[float, Signal("A", "filtered current demand", 5.0)]) -> State:
    """Return the state that holds a constant signal ``y``."""
    return State(s1=0.0 * y, s2=y)
