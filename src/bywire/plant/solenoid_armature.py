r"""Solenoid valve with the equations of its coil and armature.

`solenoid_valve` has a delay and a lag in their place. Here, the current, the magnetic force and the
pressure determine when the armature moves. The state of the coil is its flux linkage,

.. math:: \frac{d\Psi}{dt} = v - R i, \quad \Psi = L(x)\, i, \quad
    L(x) = L_0 + \frac{2 k_m}{g_0 - x}, \quad F_m = \frac{k_m i^2}{(g_0 - x)^2}

so that moving the armature induces the voltage that supplies its mechanical work. The travel x is 0
without current, and the magnetic force increases it. Friction and remanence are together one
set-valued friction on ``v``, with the bounds of `friction`. Seat and stop are an `end_stop` with
the ends `travel_ends`, whose load is an input.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Inductance, Resistance, Unit, Weight
from bywire.core.signals import Energy, Power, Pressure, Role, Signal
from bywire.core.typing import Array
from bywire.core.validity import first, within_limits
from bywire.plant import brake_fluid, orifice

Travel = Annotated[float, Unit("m", 2e-4), Field(gt=0, allow_inf_nan=False)]
AirGap = Annotated[float, Unit("m", 1e-3), Field(gt=0, allow_inf_nan=False)]
MagneticConstant = Annotated[float, Unit("N*m**2/A**2", 2e-7), Field(gt=0, allow_inf_nan=False)]
ArmatureMass = Annotated[float, Unit("kg", 3e-3), Field(gt=0, allow_inf_nan=False)]
SpringRate = Annotated[float, Unit("N/m", 1e3), Field(ge=0, allow_inf_nan=False)]
Preload = Annotated[float, Unit("N", 3.0), Field(gt=0, allow_inf_nan=False)]
ArmatureFriction = Annotated[float, Unit("N", 0.2), Field(ge=0, allow_inf_nan=False)]
ArmatureDamping = Annotated[float, Unit("N*s/m", 1.0), Field(ge=0, allow_inf_nan=False)]
Current = Annotated[float, Signal("A", "current of the coil", 2.0)]
MagneticForce = Annotated[float, Signal("N", "magnetic force", 5.0)]
CopperLoss = Annotated[float, Signal("W", "copper loss of the coil", role=Role("sink", "coil"))]
DampingLoss = Annotated[
    float, Signal("W", "damping loss of the armature", role=Role("sink", "armature"))
]


class Parameters(ParameterSet):
    """Coil without saturation and eddy currents, conical needle.

    ``unpowered``: the position of the valve without current.
    """

    unpowered: Literal["open", "closed"]
    """position without current"""
    seat: orifice.Parameters
    """orifice of the open valve, whose diameter is that of the seat"""
    alpha: orifice.HalfAngle
    """half of the cone's angle at the seat"""
    travel: Travel
    """travel of the armature from end to end"""
    g_0: AirGap
    """air gap without current"""
    k_m: MagneticConstant
    """magnetic force times squared air gap, per squared current"""
    L_0: Inductance
    """inductance of the flux outside the air gap"""
    R: Resistance
    """resistance of the coil"""
    m: ArmatureMass
    """mass of armature and needle"""
    d: ArmatureDamping
    """viscous damping of the armature"""
    k: SpringRate
    """stiffness of the return spring"""
    F_s0: Preload
    """force of the return spring without current"""
    F_h: ArmatureFriction
    """dry friction, including the remanent force"""
    dirt: Weight
    """lift at which dirt stops the closed needle, relative to the travel"""

    @model_validator(mode="after")
    def _keeps_a_gap(self) -> Parameters:
        if not self.travel < self.g_0:
            raise RuleError(
                "travel",
                f"{self.travel:g} m",
                f"< the air gap g_0 = {self.g_0:g} m",
                "without a residual gap, the magnetic force has no limit",
            )
        return self


FAULTS = (
    ParameterFault("stuck", "the armature jams (value: friction)", replaced="F_h", value=200.0),
    ParameterFault("weak-coil", "shorted turns (value: factor)", ("k_m",), 0.2),
    ParameterFault("broken-wire", "high resistance of the coil (value: factor)", ("R",), 1e3),
    ParameterFault("leaking", "dirt on the seat (value: lift)", replaced="dirt", value=0.05),
)


class State(NamedTuple):
    """Flux linkage, travel and speed of the armature."""

    psi: Annotated[float, Signal("V*s", "flux linkage of the coil", 2e-3)]
    x: Annotated[float, Signal("m", "travel of the armature", 1e-4)]
    v: Annotated[float, Signal("m/s", "speed of the armature", 0.1)]


class Factors(NamedTuple):
    """Factors of the derivatives."""

    psi: Annotated[float, Signal("1", "unity")]
    x: Annotated[float, Signal("1", "unity")]
    v: Annotated[float, Signal("kg", "mass", 3e-3)]


class Balance(NamedTuple):
    """Right-hand sides of the states."""

    psi: Annotated[float, Signal("V", "induced voltage", 10.0)]
    x: Annotated[float, Signal("m/s", "speed of the armature", 0.1)]
    v: Annotated[float, Signal("N", "force on the armature", 3.0)]


class Input(NamedTuple):
    """Voltage of the coil, pressures at both ends, and the load of seat and stop."""

    v_coil: Annotated[float, Signal("V", "voltage of the coil", 10.0)]
    p_a: Pressure
    p_b: Pressure
    load: Annotated[float, Signal("N", "load of seat and stop, against the magnetic force", 3.0)]


class Output(NamedTuple):
    """Current, magnetic force, flow and opened fraction."""

    i: Current
    F_m: MagneticForce
    q: orifice.Flow
    opening: orifice.Opening


class Ends(NamedTuple):
    """Travels at which the armature reaches its ends."""

    near: Annotated[float, Signal("m", "end without current", 1e-5)]
    far: Annotated[float, Signal("m", "end with current", 2e-4)]


def travel_ends(par: Parameters) -> Ends:
    """Return the ends of the travel, one of which is the seat, or dirt on it."""
    blocked = par.dirt * par.travel
    if par.unpowered == "closed":
        return Ends(near=blocked, far=par.travel)
    return Ends(near=0.0 * blocked, far=par.travel - blocked)


def inductance(x: State, par: Parameters) -> Annotated[float, Signal("H", "inductance", 1e-3)]:
    r"""Return the inductance, :math:`L(x) = L_0 + 2 k_m/(g_0 - x)`."""
    return par.L_0 + 2.0 * par.k_m / (par.g_0 - x.x)


def magnetic_force(i: Current, x: State, par: Parameters) -> MagneticForce:
    r"""Return the magnetic force of a current, :math:`F_m = k_m i^2/(g_0 - x)^2`."""
    gap = par.g_0 - x.x
    return par.k_m * i * i / (gap * gap)


def friction(par: Parameters) -> Annotated[float, Signal("N", "dry friction", 0.2)]:
    """Return the magnitude of the dry friction, the bound in both directions."""
    return par.F_h


def _sign(par: Parameters) -> float:
    return 1.0 if par.unpowered == "closed" else -1.0


def _through(x: State, u: Input, par: Parameters) -> orifice.Input:
    lift = x.x if par.unpowered == "closed" else par.travel - x.x
    lifted = orifice.conical_opening(ops.fmax(lift, 0.0), par.alpha, par.seat)
    return orifice.Input(u.p_a, u.p_b, lifted)


def _pressed(x: State, u: Input, par: Parameters) -> float:
    """Return the area on which the pressure difference acts, positive with the magnetic force."""
    return _sign(par) * orifice.area(par.seat) * (1.0 - _through(x, u, par).opening)


def mass(par: Parameters) -> Factors:
    """Return the factors of the derivatives, 1, 1 and the mass."""
    return Factors(psi=1.0, x=1.0, v=par.m)


def output(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Output:
    r"""Return current, force, flow from a to b, and opened fraction.

    The pressure difference acts on the part of the seat's area that is closed,
    :math:`A_s (1 - A(x)/A)`, and opens the valve. The needle displaces fluid, whose flow does the
    work of the pressures on the needle. The opening has kinks at the seat and where the conical gap
    is as large as the orifice.
    """
    i = x.psi / inductance(x, par)
    u_orifice = _through(x, u, par)
    return Output(
        i=i,
        F_m=magnetic_force(i, x, par),
        q=orifice.flow(u_orifice, par.seat, fluid) + _pressed(x, u, par) * x.v,
        opening=u_orifice.opening,
    )


def balance(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Balance:
    r"""Return induced voltage, speed and force.

    .. math:: m \dot v = F_m - F_{s0} - k x - d\, v \pm A_s(x) (h_a - h_b) - F_{load}

    with the flow energies (`brake_fluid.flow_energy`), which are nearly the pressures. The sign is
    positive for a valve that is closed without current.
    """
    y, h = output(x, u, par, fluid), brake_fluid.flow_energy
    pressure = _pressed(x, u, par) * (h(u.p_a, fluid) - h(u.p_b, fluid))
    spring = par.F_s0 + par.k * x.x
    return Balance(
        psi=u.v_coil - par.R * y.i,
        x=x.v,
        v=y.F_m - spring - par.d * x.v + pressure - u.load,
    )


def energy(x: State, par: Parameters) -> Energy:
    r"""Return magnetic, kinetic and spring energy, with :math:`\Psi^2 / (2 L(x))` in the field."""
    field = 0.5 * x.psi * x.psi / inductance(x, par)
    return field + 0.5 * par.m * x.v * x.v + (par.F_s0 + 0.5 * par.k * x.x) * x.x


def power_in(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> Power:
    """Return the power of voltage and fluid, minus that on seat and stop."""
    y, h = output(x, u, par, fluid), brake_fluid.flow_energy
    pressure = _pressed(x, u, par) * (h(u.p_a, fluid) - h(u.p_b, fluid))
    return u.v_coil * y.i + (pressure - u.load) * x.v


def copper_loss(x: State, par: Parameters) -> CopperLoss:
    """Return the heat in the coil, >= 0."""
    i = x.psi / inductance(x, par)
    return par.R * i * i


def damping_loss(x: State, par: Parameters) -> DampingLoss:
    """Return the heat from the armature's damping, >= 0."""
    return par.d * x.v * x.v


def power_loss(x: State, par: Parameters) -> Power:
    """Return the heat from coil and damping, >= 0."""
    return copper_loss(x, par) + damping_loss(x, par)


def throttling(x: State, u: Input, par: Parameters, fluid: brake_fluid.Parameters) -> orifice.Loss:
    """Return the heat from the flow through the seat, >= 0."""
    return orifice.power_loss(_through(x, u, par), par.seat, fluid)


@within_limits
def watch(t: Array, x: State, par: Parameters) -> list[str]:
    """Warn if seat or stop are missing or too soft."""
    after = ". Connect an end_stop from travel_ends.near to .far, or make it stiffer"
    return [
        *first(t, x.x <= -0.5 * par.travel, "the armature leaves its near end", after),
        *first(t, x.x >= par.g_0, "the armature closes its air gap", after),
    ]
