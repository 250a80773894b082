"""Commercial motor drive: analog current loop with filters, limit and averaged PWM stage."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import (
    Current,
    Duration,
    DutyPerCurrent,
    DutyPerCurrentTime,
    Factor,
    Frequency,
    Resistance,
    Voltage,
)
from bywire.core.signals import Signal


class Parameters(ParameterSet):
    """Continuous current controller with the PWM ripple (40 kHz) averaged out."""

    f_demand: Frequency
    """cutoff frequency of the demand filter"""
    f_sense: Frequency
    """cutoff frequency of the current measurement filter"""
    G_sense: Factor
    """scale of the current measurement; 1 if calibrated"""
    i_max: Current
    """magnitude limit of the filtered demand"""
    k_p: DutyPerCurrent
    """proportional gain, duty cycle per current"""
    k_i: DutyPerCurrentTime
    """integral gain"""
    T_t: Duration
    """tracking time of the anti-windup"""
    V_dc: Voltage
    """supply voltage: gain and limit of the PWM stage"""
    R_off: Resistance
    """resistance of the diodes, which makes the current decay while the stage is off"""


FAULTS = (
    ParameterFault("under-voltage", "reduced voltage at the power stage", ("V_dc",), 0.5),
    ParameterFault("scale", "gain error of the current measurement", ("G_sense",), 0.5),
    ParameterFault("derated", "reduced current limit", ("i_max",), 0.5),
)


class State(NamedTuple):
    """Filtered demand, filtered measurement, integral term."""

    demand: Annotated[float, Signal("A", "filtered current demand", 5.0)]
    sensed: Annotated[float, Signal("A", "sensed current", 5.0)]
    integral: Annotated[float, Signal("1", "integral term of the current loop of drive", 0.1)]


class Rate(NamedTuple):
    """Derivatives of the states."""

    demand: Annotated[float, Signal("A/s", "rate of the demand", 1e3)]
    sensed: Annotated[float, Signal("A/s", "rate of the sensed current", 1e3)]
    integral: Annotated[float, Signal("1/s", "rate of the integral term", 100.0)]


class Input(NamedTuple):
    """Current demand, motor current, back-EMF, and whether the stage is on."""

    i_ref: Annotated[float, Signal("A", "current demand", 5.0)]
    i: Annotated[float, Signal("A", "motor current", 5.0)]
    emf: Annotated[float, Signal("V", "back-EMF", 5.0)]
    on: Annotated[float, Signal("1", "power stage on")]


class Output(NamedTuple):
    """Voltage at the motor."""

    v: Annotated[float, Signal("V", "motor voltage", 10.0)]


def error(x: State, par: Parameters) -> Annotated[float, Signal("A", "current error", 1.0)]:
    """Return the limited demand minus the sensed current."""
    return ops.clip(x.demand, -par.i_max, par.i_max) - x.sensed


def output(x: State, u: Input, par: Parameters) -> Output:
    r"""Return the motor voltage.

    .. math:: V = V_{dc}\, \mathrm{sat}(k_p e + I), \quad |\mathrm{sat}| \le 1

    While the stage is off, the voltage is back-EMF minus R_off i. The current then decays to zero.

    References
    ----------
    Roberts et al. (2003), section "Current controller". The supply determines PWM gain and limit.
    """
    duty = ops.clip(par.k_p * error(x, par) + x.integral, -1.0, 1.0)
    return Output(v=ops.where(u.on > 0.5, par.V_dc * duty, u.emf - par.R_off * u.i))


def rate(x: State, u: Input, par: Parameters) -> Rate:
    r"""Return the derivatives of filters and integral term.

    .. math:: \dot I = k_i e + (\mathrm{sat}(k_p e + I) - k_p e - I)/T_t

    The last term is the anti-windup, which is ours and not in the paper. While the stage is off,
    the integral term decays with T_t.
    """
    e = error(x, par)
    unlimited = par.k_p * e + x.integral
    growth = par.k_i * e + (ops.clip(unlimited, -1.0, 1.0) - unlimited) / par.T_t
    return Rate(
        demand=2.0 * math.pi * par.f_demand * (u.i_ref - x.demand),
        sensed=2.0 * math.pi * par.f_sense * (par.G_sense * u.i - x.sensed),
        integral=ops.where(u.on > 0.5, growth, -x.integral / par.T_t),
    )
