"""Solenoid valve for brake fluid, which switches with a delay and a lag."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from annotated_types import Gt
from pydantic import model_validator

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Duration, Length, TimeConstant, Weight
from bywire.core.signals import Pressure, Signal
from bywire.plant import brake_fluid, orifice

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
Switched = Annotated[float, Signal("1", "solenoid energized", 0.5, low=0.0, high=1.0)]


class Parameters(ParameterSet):
    """Conical seat and armature. The switching times are equal in both directions.

    The pressure does not act on the armature. Its force would change the times by direction.
    """

    seat: orifice.Parameters
    """orifice of the open valve"""
    lift: Length
    """lift of the armature from seat to stop"""
    alpha: orifice.HalfAngle
    """half of the cone's angle at the seat"""
    t_delay: TimeConstant
    """time from a command to the first motion of the armature"""
    tau: Duration
    """time constant of the motion"""
    unpowered: Literal["open", "closed"]
    """position without current"""
    low: Weight
    """lift of the closed valve, relative to the full lift"""
    high: Weight
    """lift of the open valve, relative to the full lift"""

    @model_validator(mode="after")
    def _ordered(self) -> Parameters:
        if not self.low <= self.high:
            raise RuleError("low", f"{self.low:g}", f"<= the lift of the open valve {self.high:g}")
        return self


FAULTS = (
    ParameterFault("stuck-open", "valve that does not close", replaced="low", value=1.0),
    ParameterFault("stuck-closed", "valve that does not open", replaced="high", value=0.0),
    ParameterFault(
        "leaking", "dirt on the seat (value: lift of the closed valve)", replaced="low", value=0.02
    ),
    ParameterFault("sluggish", "sticking armature", ("t_delay", "tau"), 4.0),
)


class State(NamedTuple):
    """Lift of the armature, 0 on the seat."""

    x: Annotated[float, Signal("m", "lift", 1e-4, low=0.0)]


class Input(NamedTuple):
    """Position of the switched solenoid, and pressures at both ends."""

    on: Switched
    p_a: Pressure
    p_b: Pressure


class Coil(NamedTuple):
    """Memory of the delay, between the ticks of a task."""

    on: Annotated[float, Signal("1", "solenoid energized")]
    waiting: Annotated[float, Signal("s", "time since the command changed", 1e-3)]


def delayed(
    coil: Coil,
    command: Annotated[float, Signal("1", "valve command")],
    T: SampleTime,
    par: Parameters,
) -> Coil:
    """Advance the delay by one sample of a task, which passes ``on`` to the armature.

    Notes
    -----
    A command acts once it has lasted for the delay, which is rounded to whole samples. A shorter
    pulse does not move the armature. Switching at ticks keeps the simulation second order.
    """
    differs = ops.where(ops.fabs(command - coil.on) > 0.5, 1.0, 0.0)
    due = ops.where(coil.waiting + 0.5 * T > par.t_delay, differs, 0.0)
    return Coil(
        on=ops.where(due > 0.5, command, coil.on),
        waiting=(differs - due) * (coil.waiting + T),
    )


def lift(
    on: Switched, par: Parameters
) -> Annotated[float, Signal("m", "lift at a constant current", 1e-4)]:
    """Return the lift at rest, with the solenoid energized (1) or not (0)."""
    opened = 1.0 - on if par.unpowered == "open" else on
    return par.lift * (par.low + (par.high - par.low) * opened)


def mass(par: Parameters) -> Annotated[float, Signal("s", "time constant", 1e-3)]:
    """Return the factor of the lift's derivative, the time constant."""
    return par.tau


def balance(
    x: State, u: Input, par: Parameters
) -> Annotated[float, Signal("m", "distance to the new lift", 1e-4)]:
    r"""Return the distance of the armature from its new lift, :math:`\tau \dot x = x_{new} - x`."""
    return lift(u.on, par) - x.x


def opening(x: State, par: Parameters) -> orifice.Opening:
    """Return the opened fraction of the orifice (`orifice.conical_opening`)."""
    return orifice.conical_opening(x.x, par.alpha, par.seat)


def flow(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> orifice.Flow:
    """Return the flow from a to b, that of the opened fraction of an `orifice`."""
    return orifice.flow(orifice.Input(u.p_a, u.p_b, opening(x, par)), par.seat, fluid)


def power_loss(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> orifice.Loss:
    """Return the heat from the flow, including released compression energy, >= 0."""
    return orifice.power_loss(orifice.Input(u.p_a, u.p_b, opening(x, par)), par.seat, fluid)
