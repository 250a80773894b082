"""Pressure control of a relay valve: the control pressure is the set point plus an integral.

The relay valve is itself a fast pressure controller, so the law only removes its static errors:
crack pressure, hysteresis and overlap. A brake chamber needs several times more air per pressure
while its rod moves than after the pads touch, which slows the relay valve. The law therefore has
two integral gains.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Gt
from pydantic import Field

from bywire.authoring import ParameterSet, Pressure, Signal, Unit
from bywire.core import ops

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
IntegralGain = Annotated[float, Unit("1/s", 5.0), Field(ge=0, allow_inf_nan=False)]
DeadZone = Annotated[float, Unit("Pa", 5e3), Field(ge=0, allow_inf_nan=False)]


class Gains(ParameterSet):
    """Gain in a pressure region."""

    k_i: IntegralGain
    """integral gain in this region"""


class Parameters(ParameterSet):
    """Gains from the pressure error to the control pressure, and limits of the integral."""

    touching: Gains
    gap: Gains
    p_touch: Pressure
    """pressure at which the pads touch, as assumed by the controller"""
    p_blend: Pressure
    """width of the blend of both gains around this pressure"""
    p_dead: DeadZone
    """error that the controller ignores, so that the valve can rest"""
    p_wait: Pressure
    """error above which the integral term is held, because the valve is fully open"""
    p_trim: Pressure
    """maximum of the integral term"""


class State(NamedTuple):
    """Integral term."""

    integral: Annotated[float, Signal("Pa", "integral term of the pressure control", 1e4)]


class Input(NamedTuple):
    """Set point and measurement."""

    p_ref: Annotated[float, Signal("Pa", "pressure set point", 4e5)]
    p_meas: Annotated[float, Signal("Pa", "measured pressure", 4e5)]


class Output(NamedTuple):
    """Pressure demanded from the pilot valve, >= 0."""

    p: Annotated[float, Signal("Pa", "pressure demanded from the pilot valve", 4e5)]


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    r"""Advance the controller by one sample.

    .. math:: p = p_{ref} + I, \quad I_{k+1} = I_k + T k_i e_d, \quad
        e_d = e - \mathrm{sat}_{p_{dead}}(e)

    Without a demand, the valve exhausts the chamber, and the integral is zero.
    """
    e = u.p_ref - u.p_meas
    counted = e - ops.clip(e, -par.p_dead, par.p_dead)
    touches = ops.clip((u.p_meas - par.p_touch) / par.p_blend + 0.5, 0.0, 1.0)
    gain = par.gap.k_i + touches * (par.touching.k_i - par.gap.k_i)
    growth = ops.where(ops.fabs(e) < par.p_wait, gain * counted, 0.0)
    integral = ops.clip(x.integral + T * growth, -par.p_trim, par.p_trim)
    integral = ops.where(u.p_ref > 0, integral, 0.0)
    p = ops.where(u.p_ref > 0, u.p_ref + x.integral, 0.0)
    return State(integral), Output(ops.fmax(p, 0.0))
