"""Spring brake of a truck: a strong spring that air holds back, and that parks without air."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Area, Damping, Force, Length, Mass, Stiffness, Unit
from bywire.core.signals import Energy, Power, Role, Signal

DeadVolume = Annotated[float, Unit("m**3", 2e-4), Field(gt=0, allow_inf_nan=False)]
PistonTravel = Annotated[float, Signal("m", "travel of the spring piston", 0.03)]
PistonSpeed = Annotated[float, Signal("m/s", "speed of the spring piston", 0.5)]
Loss = Annotated[
    float, Signal("W", "damping loss of the spring piston", role=Role("sink", "piston damping"))
]


class Parameters(ParameterSet):
    """Piston between the spring and the air of the park chamber.

    With pressure, the piston is at its retracted stop and the spring is compressed. Without
    pressure, the piston pushes the rod of the service chamber. Stops and the contact with the rod
    are end stops of the assembly.
    """

    A: Area
    """piston area"""
    V_0: DeadVolume
    """air volume with the piston at the end of its travel, including the hose"""
    x_max: Length
    """travel from the retracted to the extended stop"""
    F_s0: Force
    """spring force at the retracted stop"""
    k_s: Stiffness
    """stiffness of the spring"""
    m: Mass
    """mass of piston and rod"""
    d: Damping
    """viscous damping"""
    F_fr: Force
    """dry friction of the seals"""


FAULTS = (
    ParameterFault("broken", "broken spring", ("F_s0", "k_s"), 0.2),
    ParameterFault("stuck", "seized piston (value: friction force)", replaced="F_fr", value=2e4),
)


class State(NamedTuple):
    """Travel and speed of the piston, positive toward clamping; 0 at the retracted stop."""

    x: PistonTravel
    v: PistonSpeed


class Factors(NamedTuple):
    """Factors of the derivatives of travel and speed."""

    x: Annotated[float, Signal("1", "unity")]
    v: Annotated[float, Signal("kg", "mass", 2.0)]


class Balance(NamedTuple):
    """Right-hand sides of travel and speed."""

    x: PistonSpeed
    v: Annotated[float, Signal("N", "accelerating force", 1e3)]


class Input(NamedTuple):
    """Gauge pressure, forces of stops and rod, and dry friction."""

    p: Annotated[float, Signal("Pa", "park pressure", 5e5)]
    load: Annotated[float, Signal("N", "load of rod and stops", 5e3)]
    friction: Annotated[float, Signal("N", "friction force, positive along the motion", 100.0)]


class Output(NamedTuple):
    """Volume of the air, and its rate."""

    V: Annotated[float, Signal("m**3", "volume of the park chamber", 1e-3)]
    V_rate: Annotated[float, Signal("m**3/s", "rate of the volume", 5e-3)]


def spring_force(x: State, par: Parameters) -> Annotated[float, Signal("N", "spring force", 8e3)]:
    r"""Return the spring force, :math:`F_s = F_{s,0} - k_s x`."""
    return par.F_s0 - par.k_s * x.x


def release_pressure(
    par: Parameters,
) -> Annotated[float, Signal("Pa", "release pressure", 5e5)]:
    r"""Return the gauge pressure that fully retracts the piston, :math:`F_{s,0}/A`.

    Friction increases it while the piston retracts, and decreases it while the piston extends.
    """
    return par.F_s0 / par.A


def output(x: State, par: Parameters) -> Output:
    r"""Return the volume of the air, :math:`V = V_0 + A (x_{max} - x)`."""
    return Output(V=par.V_0 + par.A * (par.x_max - x.x), V_rate=-par.A * x.v)


def mass(x: State, par: Parameters) -> Factors:
    """Return the factors of the derivatives: 1 and the mass."""
    return Factors(x=1.0, v=par.m)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return speed and accelerating force.

    .. math:: m \dot v = F_{s,0} - k_s x - A p - d v - F_L + F_{fr}

    Notes
    -----
    The equations have no kinks. If the travel exceeds :math:`F_{s,0}/k_s`, the spring would pull,
    which a real one cannot do; the extended stop must be closer.
    """
    force = spring_force(x, par) - par.A * u.p - par.d * x.v - u.load + u.friction
    return Balance(x=x.v, v=force)


def energy(x: State, par: Parameters) -> Energy:
    r"""Return the energy of spring and motion, :math:`F_s^2/(2 k_s) + m v^2/2`."""
    F = spring_force(x, par)
    return 0.5 * F * F / par.k_s + 0.5 * par.m * x.v * x.v


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the power of friction minus the powers against air, rod and stops."""
    return (u.friction - par.A * u.p - u.load) * x.v


def power_loss(x: State, par: Parameters) -> Loss:
    """Return the power lost in damping, >= 0."""
    return par.d * x.v * x.v
