"""Backlash between two shafts: free play with two flanks that push but never pull."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Factor, TimeConstant, Unit
from bywire.core.signals import Angle, Energy, Role, Signal, Speed

Play = Annotated[float, Unit("rad", 2e-3), Field(ge=0, allow_inf_nan=False)]
MeshStiffness = Annotated[float, Unit("N*m/rad", 400.0), Field(gt=0, allow_inf_nan=False)]
Compliance = Annotated[float, Signal("rad/(N*m)", "compliance of the mesh", 2e-3)]
Work = Annotated[float, Signal("W", "work on the mesh")]
Loss = Annotated[
    float, Signal("W", "loss in the mesh, minus its initial energy", role=Role("sink", "mesh"))
]


class Parameters(ParameterSet):
    """Massless gear mesh. Each flank is a spring with damping proportional to stiffness."""

    i: Factor
    """gear ratio, which is the speed of shaft 1 divided by the speed of shaft 2"""
    b: Play
    """free play, as an angle of shaft 1"""
    k: MeshStiffness
    """mesh stiffness at shaft 1"""
    tau: TimeConstant
    """ratio of damping to stiffness"""


FAULTS = (ParameterFault("worn", "increased free play", ("b",), 3.0),)


class Input(NamedTuple):
    """Angles and speeds of both shafts."""

    theta_1: Angle
    omega_1: Speed
    theta_2: Angle
    omega_2: Speed


class InputRate(NamedTuple):
    """Derivatives of the inputs that affect the stored energy."""

    theta_1: Speed
    theta_2: Speed


class Forces(NamedTuple):
    """Contact torques on shaft 1, both >= 0."""

    front: Annotated[float, Signal("N*m", "torque of the front flank", 0.5)]
    back: Annotated[float, Signal("N*m", "torque of the back flank", 0.5)]


class Overlaps(NamedTuple):
    """Overlaps with damping. A torque acts where they are positive."""

    front: Annotated[float, Signal("rad", "overlap of the front flank", 1e-3)]
    back: Annotated[float, Signal("rad", "overlap of the back flank", 1e-3)]


def _twist(u: Input, par: Parameters) -> float:
    return u.theta_1 - par.i * u.theta_2


def _speed(u: Input, par: Parameters) -> float:
    return u.omega_1 - par.i * u.omega_2


def overlaps(u: Input, par: Parameters) -> Overlaps:
    r"""Return the damped overlaps, affine in angles and speeds.

    .. math:: d_\pm = \pm(\theta_1 - i \theta_2) - b/2 \pm \tau (\omega_1 - i \omega_2)

    Notes
    -----
    A flank pushes only while its overlap is positive. A linear damper alone would pull the shafts
    together while they separate. The Modelica Standard Library limits the torque of its
    ``ElastoBacklash`` for the same reason. Linear models have a kink where an overlap is zero.
    """
    twist, speed = _twist(u, par), _speed(u, par)
    return Overlaps(
        front=twist - 0.5 * par.b + par.tau * speed, back=-twist - 0.5 * par.b - par.tau * speed
    )


def compliance(par: Parameters) -> Compliance:
    """Return the compliance of one flank."""
    return 1.0 / par.k


def forces(u: Input, par: Parameters) -> Forces:
    """Return the contact torques on shafts without other contacts."""
    d = overlaps(u, par)
    return Forces(front=par.k * ops.fmax(d.front, 0.0), back=par.k * ops.fmax(d.back, 0.0))


def torque(f: Forces) -> Annotated[float, Signal("N*m", "torque of the mesh", 0.5)]:
    """Return the mesh torque against shaft 1. Shaft 2 receives i times this torque."""
    return f.front - f.back


def _stored_torque(u: Input, par: Parameters) -> float:
    twist = _twist(u, par)
    front, back = ops.fmax(twist - 0.5 * par.b, 0.0), ops.fmax(-twist - 0.5 * par.b, 0.0)
    return par.k * (front - back)


def input_rate(u: Input) -> InputRate:
    """Return the speeds, through which the mesh stores energy."""
    return InputRate(theta_1=u.omega_1, theta_2=u.omega_2)


def energy(u: Input, par: Parameters) -> Energy:
    """Return the elastic energy of the flanks."""
    T = _stored_torque(u, par)
    return 0.5 * T * T / par.k


def power_in(u: Input, f: Forces, par: Parameters) -> Work:
    """Return the work that both shafts do on the mesh."""
    return torque(f) * _speed(u, par)


def power_loss(u: Input, f: Forces, par: Parameters) -> Loss:
    """Return the power that the mesh dissipates, >= 0."""
    return (torque(f) - _stored_torque(u, par)) * _speed(u, par)
