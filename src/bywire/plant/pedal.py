"""Brake pedal with feedback spring and potentiometer."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Force, Length, Stiffness, Voltage
from bywire.core.signals import Signal


class Parameters(ParameterSet):
    """Rigid lever against a preloaded spring. The wiper of the potentiometer follows the lever."""

    k_spring: Stiffness
    """stiffness of the feedback spring at the foot"""
    F_preload: Force
    """foot force at which the pedal starts to move"""
    x_max: Length
    """pedal travel at its stop"""
    V_ref: Voltage
    """supply voltage of the potentiometer"""


class Input(NamedTuple):
    """Foot force on the pedal."""

    force: Annotated[float, Signal("N", "foot force", 100.0)]


class Output(NamedTuple):
    """Pedal travel and wiper voltage."""

    x: Annotated[float, Signal("m", "pedal travel", 0.02)]
    V: Annotated[float, Signal("V", "potentiometer voltage", 2.5)]


def output(u: Input, par: Parameters) -> Output:
    """Return travel and voltage for a foot force."""
    x = ops.clip((u.force - par.F_preload) / par.k_spring, 0.0, par.x_max)
    return Output(x=x, V=par.V_ref * x / par.x_max)


def force_at(
    x: Annotated[float, Signal("m", "pedal travel", 0.02)], par: Parameters
) -> Annotated[float, Signal("N", "foot force", 100.0)]:
    """Return the foot force that holds a travel between the stops."""
    return par.F_preload + par.k_spring * x
