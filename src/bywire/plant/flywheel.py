"""Flywheel and disc of the test stand, coasting or driven, with runout."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import Energy, Power, Signal

BigInertia = Annotated[float, Unit("kg*m**2", 36.0), Field(gt=0, allow_inf_nan=False)]
DiscSpeed = Annotated[float, Unit("rad/s", 60.0), Field(allow_inf_nan=False)]
StillSpeed = Annotated[float, Unit("rad/s", 1e-3), Field(gt=0, allow_inf_nan=False)]
SpeedGain = Annotated[float, Unit("N*m*s/rad", 1e4), Field(gt=0, allow_inf_nan=False)]
RunOut = Annotated[float, Unit("m", 4e-6), Field(ge=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Rigid disc and flywheel. The braking moment is dry friction, so the disc stops completely.

    ``law``: with ``"coasting"``, the brake slows the disc down. With ``"driven"``, a proportional
    speed controller of the AC motor keeps the disc speed near ``Omega_0``.
    """

    law: Literal["coasting", "driven"]
    """whether the AC motor drives the disc during braking"""
    J_F: BigInertia
    """inertia of flywheel and disc"""
    Omega_0: DiscSpeed
    """initial speed, and set point if the disc is driven"""
    K_drive: SpeedGain
    """gain of the speed controller (law "driven")"""
    Omega_still: StillSpeed
    """speed up to which the disc is considered stopped"""
    runout: RunOut
    """amplitude of the runout that the floating caliper does not follow"""


FAULTS = (ParameterFault("run-out", "increased disc runout", ("runout",), 5.0),)


class State(NamedTuple):
    """Speed and angle of the disc."""

    Omega: Annotated[float, Signal("rad/s", "disc speed", 60.0)]
    phi: Annotated[float, Signal("rad", "disc angle", 10.0)]


class Factors(NamedTuple):
    """Factors of the derivatives."""

    Omega: Annotated[float, Signal("kg*m**2", "inertia", 36.0)]
    phi: Annotated[float, Signal("1", "unity")]


class Balance(NamedTuple):
    """Right-hand sides of speed and angle."""

    Omega: Annotated[float, Signal("N*m", "torque", 300.0)]
    phi: Annotated[float, Signal("rad/s", "disc speed", 60.0)]


class Input(NamedTuple):
    """Brake moment as friction on the disc, against its rotation."""

    friction: Annotated[float, Signal("N*m", "moment of the pads on the disc", 300.0)]


def turning(x: State, par: Parameters) -> Annotated[float, Signal("1", "disc direction")]:
    """Return the direction of rotation, +1 or -1, and 0 for a stopped disc."""
    backward = ops.where(x.Omega < -par.Omega_still, -1.0, 0.0)
    return ops.where(x.Omega > par.Omega_still, 1.0, backward)


def drive_torque(x: State, par: Parameters) -> Annotated[float, Signal("N*m", "drive torque")]:
    """Return the AC motor torque."""
    if par.law == "coasting":
        return 0.0 * par.K_drive * x.Omega
    return par.K_drive * (par.Omega_0 - x.Omega)


def mass(par: Parameters) -> Factors:
    """Return the factors of the derivatives: inertia and 1."""
    return Factors(Omega=par.J_F, phi=1.0)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return torque and speed, :math:`J_F \dot\Omega = T_{drive} - M_B`."""
    return Balance(Omega=drive_torque(x, par) + u.friction, phi=x.Omega)


def runout(x: State, par: Parameters) -> Annotated[float, Signal("m", "runout", 4e-6)]:
    """Return the runout at the pads, one wave per revolution."""
    return par.runout * ops.sin(x.phi)


def runout_rate(
    x: State, par: Parameters
) -> Annotated[float, Signal("m/s", "rate of the runout", 2e-4)]:
    """Return the rate of the runout."""
    return par.runout * ops.cos(x.phi) * x.Omega


def energy(x: State, par: Parameters) -> Energy:
    """Return the kinetic energy."""
    return 0.5 * par.J_F * x.Omega * x.Omega


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the power of AC motor and pads on the disc."""
    return (drive_torque(x, par) + u.friction) * x.Omega
