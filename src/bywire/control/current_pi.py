"""Current PI with tracking anti-windup: duty cycle from the current error."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Gt, Le

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, DutyPerCurrent, DutyPerCurrentTime, Fraction
from bywire.core.signals import Signal

Limit = Annotated[float, Signal("1", "limit that the power stage reports", 0.9), Gt(0), Le(1)]
SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]


class Parameters(ParameterSet):
    """Gains of the sampled PI (forward Euler)."""

    k_p: DutyPerCurrent
    """proportional gain"""
    k_i: DutyPerCurrentTime
    """integral gain"""
    T_t: Duration
    """tracking time of the anti-windup"""
    D_max: Fraction
    """limit of the duty cycle that the ECU demands"""


class State(NamedTuple):
    """Integral term."""

    integral: Annotated[float, Signal("1", "integral term", 0.3)]


class Input(NamedTuple):
    """Set point, measurement, and limit of the power stage."""

    i_ref: Annotated[float, Signal("A", "current set point", 5.0)]
    i_meas: Annotated[float, Signal("A", "measured current", 5.0)]
    D_lim: Limit = 1.0


class Output(NamedTuple):
    """Duty cycle within its limits."""

    duty: Annotated[float, Signal("1", "duty cycle", 0.3)]


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    r"""Advance the controller by one sample.

    .. math:: D = k_p (i_{ref} - i) + I, \quad
        I_{k+1} = I_k + T (k_i (i_{ref} - i) + (D_{sat} - D) / T_t)

    D_sat is D, limited to the lower of the ECU's and the power stage's limit. The integral term
    follows the realized duty cycle, not the demanded duty cycle.
    """
    error = u.i_ref - u.i_meas
    unlimited = par.k_p * error + x.integral
    limit = ops.fmin(par.D_max, u.D_lim)
    duty = ops.clip(unlimited, -limit, limit)
    growth = par.k_i * error + (duty - unlimited) / par.T_t
    return State(integral=x.integral + T * growth), Output(duty=duty)
