"""Motor position control: the current demand acts like a spring and damper at the encoder angle."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from annotated_types import Gt

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Factor, Frequency, Inertia, TorqueConstant, Weight
from bywire.core.signals import Signal

SampleTime = Annotated[float, Signal("s", "sample time", 2e-4), Gt(0)]


class Parameters(ParameterSet):
    """Second-order position loop without an integral term.

    The brake uses a high bandwidth (60 Hz). A low bandwidth (12 Hz) stays within the current limit.
    """

    f_n: Frequency
    """natural frequency of the loop on a free shaft"""
    zeta: Factor
    """damping ratio"""
    c: Weight
    """fraction of the reference speed that is exempt from damping; 0 damps the whole speed"""
    f_speed: Frequency
    """cutoff frequency of the filter for the encoder differences"""
    i_max: Current
    """limit of the current demand's magnitude"""
    J_hat: Inertia
    """inertia assumed by the controller"""
    K_hat: TorqueConstant
    """torque constant assumed by the controller"""


class State(NamedTuple):
    """Previous angle and filtered speed."""

    last: Annotated[float, Signal("rad", "previous measured angle", 3.0)]
    speed: Annotated[float, Signal("rad/s", "measured speed", 50.0)]


class Input(NamedTuple):
    """Reference, its speed, and the measured angle."""

    theta_ref: Annotated[float, Signal("rad", "angle reference", 3.0)]
    omega_ref: Annotated[float, Signal("rad/s", "speed of the reference", 50.0)]
    theta: Annotated[float, Signal("rad", "measured angle", 3.0)]


class Output(NamedTuple):
    """Current demand."""

    i: Annotated[float, Signal("A", "current demand", 5.0)]


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    r"""Advance the controller by one sample.

    .. math::
        i = \frac{J}{K_T} \left(\omega_n^2 (\theta_{ref} - \theta)
        + 2 \zeta \omega_n (c\, \omega_{ref} - \hat\omega)\right)

    where the speed is computed from encoder differences with a first-order filter.

    References
    ----------
    Roberts et al. (2003), section "Motor & rollerscrew alone", for the two bandwidths; it does not
    state the law.
    """
    angle = 2.0 * math.pi * par.f_speed * T
    difference = (u.theta - x.last) / T
    speed = x.speed + angle / (1.0 + angle) * (difference - x.speed)
    w = 2.0 * math.pi * par.f_n
    stiff = w * w * (u.theta_ref - u.theta)
    damped = 2.0 * par.zeta * w * (par.c * u.omega_ref - speed)
    i = par.J_hat / par.K_hat * (stiff + damped)
    return State(last=u.theta, speed=speed), Output(i=ops.clip(i, -par.i_max, par.i_max))
