r"""Proportional inlet valve, open without current, whose current sets a pressure difference.

The pressure difference lifts a needle from its seat against a solenoid. The needle opens where the
pressure difference exceeds

.. math:: \Delta p = G i - F_{s0}/A_s \pm F_h/A_s

and closes below. The valve therefore regulates the pressure difference. The hysteresis,
:math:`2 F_h/A_s`, comes from a set-valued friction on ``v``, with the bounds of `friction`. Seat
and stop are an `end_stop` from 0 to ``lift``, whose load on the needle is an input.

Without damping, the needle oscillates with the pressure behind the valve, in a limit cycle between
seat and stop. While fluid flows, a small oscillation decays if

.. math:: d^2 c\, q_p + d\, (k_s c^2 + m q_p^2) > m\, c\, A_s q_x

with the volume c per pressure behind the valve, the slope :math:`q_x` of the flow by lift, and the
slope :math:`-q_p` of the net inflow by the pressure behind the valve. Friction also stops small
oscillations.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Unit
from bywire.core.signals import Energy, Power, Pressure, Role, Signal
from bywire.core.typing import Array
from bywire.core.validity import first, outside, within_limits
from bywire.plant import brake_fluid, orifice

ValveLift = Annotated[float, Unit("m", 2e-4), Field(gt=0, allow_inf_nan=False)]
NeedleMass = Annotated[float, Unit("kg", 5e-3), Field(gt=0, allow_inf_nan=False)]
SpringRate = Annotated[float, Unit("N/m", 1e3), Field(gt=0, allow_inf_nan=False)]
Preload = Annotated[float, Unit("N", 3.0), Field(gt=0, allow_inf_nan=False)]
NeedleFriction = Annotated[float, Unit("N", 0.05), Field(ge=0, allow_inf_nan=False)]
NeedleDamping = Annotated[float, Unit("N*s/m", 1.0), Field(ge=0, allow_inf_nan=False)]
PressurePerCurrent = Annotated[float, Unit("Pa/A", 1e7), Field(gt=0, allow_inf_nan=False)]
Loss = Annotated[
    float, Signal("W", "damping loss of the needle", role=Role("sink", "valve needle"))
]


class Parameters(ParameterSet):
    """Conical needle, and a solenoid whose force does not depend on the lift."""

    seat: orifice.Parameters
    """orifice of the open valve, whose diameter is that of the seat"""
    alpha: orifice.HalfAngle
    """half of the cone's angle at the seat"""
    lift: ValveLift
    """lift of the needle at its stop"""
    m: NeedleMass
    """mass of needle and armature"""
    k_s: SpringRate
    """stiffness of the spring that opens the valve"""
    F_s0: Preload
    """force of the spring on the closed needle"""
    d: NeedleDamping
    """viscous damping of the needle"""
    F_h: NeedleFriction
    """dry friction of the needle"""
    G: PressurePerCurrent
    """pressure difference per current"""

    @model_validator(mode="after")
    def _opens(self) -> Parameters:
        left = self.F_s0 - self.k_s * self.lift
        if left <= self.F_h:
            raise RuleError(
                "F_s0",
                f"{self.F_s0:g} N",
                f"> F_h + k_s lift = {self.F_h + self.k_s * self.lift:g} N",
                "otherwise the valve does not open fully without current",
            )
        return self


FAULTS = (
    ParameterFault("sticking", "more friction of the needle (value: factor)", ("F_h",), 10.0),
    ParameterFault("weak-coil", "smaller force of the solenoid (value: factor)", ("G",), 0.7),
    ParameterFault("clogged", "narrower seat (value: factor)", ("seat.d",), 0.5),
)


class State(NamedTuple):
    """Lift and speed of the needle."""

    x: Annotated[float, Signal("m", "lift of the needle", 1e-4)]
    v: Annotated[float, Signal("m/s", "speed of the needle", 0.01)]


class Factors(NamedTuple):
    """Factors of the derivatives."""

    x: Annotated[float, Signal("1", "unity")]
    v: Annotated[float, Signal("kg", "mass", 5e-3)]


class Balance(NamedTuple):
    """Right-hand sides of lift and speed."""

    x: Annotated[float, Signal("m/s", "speed of the needle", 0.01)]
    v: Annotated[float, Signal("N", "force on the needle", 1.0)]


class Input(NamedTuple):
    """Current, pressures at both ends, and the load of seat and stop."""

    i: Annotated[float, Signal("A", "valve current", 1.0, low=0.0)]
    p_a: Pressure
    p_b: Pressure
    load: Annotated[float, Signal("N", "load of seat and stop, against opening", 1.0)]


class Output(NamedTuple):
    """Flow, and power of the solenoid."""

    q: orifice.Flow
    P_coil: Annotated[float, Signal("W", "mechanical power of the solenoid", 0.01)]


def area(par: Parameters) -> Annotated[float, Signal("m**2", "area", 2e-7)]:
    r"""Return the area of the seat, :math:`A_s = \pi d^2/4`."""
    return orifice.area(par.seat)


def held_pressure(
    i: Annotated[float, Signal("A", "valve current", 1.0)], par: Parameters
) -> Annotated[float, Signal("Pa", "pressure difference", 1e7)]:
    r"""Return the pressure difference at which the needle leaves its seat without friction."""
    return par.G * i - par.F_s0 / area(par)


def friction(par: Parameters) -> Annotated[float, Signal("N", "dry friction", 0.05)]:
    """Return the magnitude of the dry friction, the bound in both directions."""
    return par.F_h


def _through(x: State, u: Input, par: Parameters) -> orifice.Input:
    lifted = orifice.conical_opening(ops.fmax(x.x, 0.0), par.alpha, par.seat)
    return orifice.Input(u.p_a, u.p_b, lifted)


def _difference(u: Input, fluid: brake_fluid.Parameters) -> float:
    h = brake_fluid.flow_energy
    return h(u.p_a, fluid) - h(u.p_b, fluid)


def mass(par: Parameters) -> Factors:
    """Return the factors of the derivatives, 1 and the mass."""
    return Factors(x=1.0, v=par.m)


def output(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Output:
    r"""Return the flow from a to b, :math:`q = q_{orifice}(x) + A_s v`, and the coil's power.

    The needle displaces fluid, whose flow does the work of the pressures on the needle. The opening
    has kinks at the seat and where the conical gap is as large as the orifice.
    """
    through = orifice.flow(_through(x, u, par), par.seat, fluid)
    return Output(q=through + area(par) * x.v, P_coil=-1.0 * par.G * area(par) * u.i * x.v)


def balance(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Balance:
    r"""Return speed and force.

    .. math:: m \dot v = A_s (h_a - h_b) + F_{s0} - k_s x - G A_s i - d\, v - F_{load}

    with the flow energies (`brake_fluid.flow_energy`), which are nearly the pressures.
    """
    driving = area(par) * (_difference(u, fluid) - par.G * u.i)
    spring = par.F_s0 - par.k_s * x.x
    return Balance(x=x.v, v=driving + spring - par.d * x.v - u.load)


def energy(x: State, par: Parameters) -> Energy:
    """Return the kinetic energy, and that of the spring relative to the seat."""
    return 0.5 * par.m * x.v * x.v - (par.F_s0 - 0.5 * par.k_s * x.x) * x.x


def power_in(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Power:
    """Return the power of coil and fluid on the needle, minus that on seat and stop."""
    pressed = area(par) * _difference(u, fluid) * x.v
    return pressed + output(x, u, par, fluid).P_coil - u.load * x.v


def power_loss(x: State, par: Parameters) -> Loss:
    """Return the heat from the needle's damping, >= 0."""
    return par.d * x.v * x.v


def throttling(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> orifice.Loss:
    """Return the heat from the flow through the seat, >= 0."""
    return orifice.power_loss(_through(x, u, par), par.seat, fluid)


@within_limits
def watch(t: Array, x: State, par: Parameters) -> list[str]:
    """Warn if seat or stop are missing or too soft."""
    beyond = outside(x.x, -0.5 * par.lift, 1.5 * par.lift)
    after = ". Connect an end_stop from 0 to lift, or make it stiffer"
    return first(t, beyond, "the needle passes its seat or its stop", after)
