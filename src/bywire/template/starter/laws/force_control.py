"""Clamp force control: proportional from force to speed, then PI from speed to voltage."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.authoring import ParameterSet, Signal, Speed, Unit, Voltage
from bywire.core import ops


class Parameters(ParameterSet):
    """Gains and limits. Measurements have no delay or noise."""

    k_F: Annotated[float, Unit("rad/(s*N)", 0.05), Field(ge=0, allow_inf_nan=False)]
    """speed per unit force error"""
    omega_max: Annotated[float, Unit("rad/s", 200.0), Field(gt=0, allow_inf_nan=False)]
    """maximum speed demand"""
    k_p: Annotated[float, Unit("V*s/rad", 0.05), Field(ge=0, allow_inf_nan=False)]
    """voltage per unit speed error"""
    k_i: Annotated[float, Unit("V/rad", 2.0), Field(ge=0, allow_inf_nan=False)]
    """voltage per unit integrated speed error"""
    v_max: Voltage
    """maximum magnitude of the voltage"""


class State(NamedTuple):
    """Integral term of the speed control."""

    v_i: Annotated[float, Signal("V", "integral term", 1.0)]


class Input(NamedTuple):
    """Demanded force, measured force and speed."""

    F_set: Annotated[float, Signal("N", "demanded clamp force", 1e4)]
    F: Annotated[float, Signal("N", "clamp force", 1e4)]
    omega: Speed


class Output(NamedTuple):
    """Voltage of the motor."""

    v: Annotated[float, Signal("V", "motor voltage", 6.0)]


SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Field(gt=0)]


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    """Advance the controller by one sample. The integral stops while the voltage is limited."""
    omega_ref = ops.clip(par.k_F * (u.F_set - u.F), -par.omega_max, par.omega_max)
    error = omega_ref - u.omega
    v = par.k_p * error + x.v_i
    growth = ops.where(ops.fabs(v) < par.v_max, par.k_i * error, 0.0)
    return State(x.v_i + T * growth), Output(ops.clip(v, -par.v_max, par.v_max))
