"""H-bridge as a static gain from duty cycle to motor voltage, averaged over the PWM period."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Fraction, Frequency
from bywire.core.signals import Signal


class Parameters(ParameterSet):
    """Lossless averaged bridge, without carrier ripple and dead times."""

    D_max: Fraction
    """magnitude limit of the duty cycle"""
    f_pwm: Frequency
    """PWM carrier frequency, for information only, because the bridge is averaged"""


class Input(NamedTuple):
    """Duty cycle, bus voltage and motor current."""

    duty: Annotated[float, Signal("1", "duty cycle", 0.5)]
    v_bus: Annotated[float, Signal("V", "bus voltage", 12.0)]
    i: Annotated[float, Signal("A", "motor current", 5.0)]


class Output(NamedTuple):
    """Motor voltage and battery current."""

    v: Annotated[float, Signal("V", "motor voltage", 6.0)]
    i_dc: Annotated[float, Signal("A", "battery current", 5.0)]


def limited(
    duty: Annotated[float, Signal("1", "duty cycle", 0.5)], par: Parameters
) -> Annotated[float, Signal("1", "duty cycle", 0.5)]:
    r"""Return the duty cycle within the limits of the bridge, :math:`|D| \le D_{max}`."""
    return ops.clip(duty, -par.D_max, par.D_max)


def output(u: Input) -> Output:
    r"""Return motor voltage and battery current. Input power equals output power.

    .. math:: v = K_H D, \quad i_{dc} = D i

    with the gain K_H equal to the bus voltage.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eq. (1), second line.
    """
    return Output(v=u.v_bus * u.duty, i_dc=u.duty * u.i)
