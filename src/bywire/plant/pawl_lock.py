r"""Pawl lock: a solenoid moves a pawl into a ratchet, which then turns only toward clamping.

The ratchet's teeth have the pitch :math:`\delta`. An engaged pawl stops the shaft at the tooth
:math:`k = \lfloor \theta / \delta \rfloor` that it passed last, so the shaft turns back by less
than one tooth. A tooth under load holds the pawl by friction. The solenoid releases it only if

.. math:: F_{sol} > F_{spring} + \mu N

Otherwise, the motor must first turn the shaft a little toward clamping, which unloads the tooth.

Whether the pawl is engaged, and its tooth, are memory of a task (`latch`). The angle at which the
pawl stops the shaft is a state. It follows the memory within the time that the pawl takes, so the
overlap of pawl and tooth is affine in the states. A pawl that is not engaged follows the ratchet at
a distance.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Force, Length, Unit
from bywire.core.signals import Angle, Energy, Role, Signal, Speed

Pitch = Annotated[float, Unit("rad", 0.2), Field(gt=0, allow_inf_nan=False)]
ToothStiffness = Annotated[float, Unit("N*m/rad", 100.0), Field(gt=0, allow_inf_nan=False)]
Friction = Annotated[float, Unit("1", 0.15), Field(ge=0, lt=1, allow_inf_nan=False)]
Compliance = Annotated[float, Signal("rad/(N*m)", "compliance of the tooth", 1e-2)]
Overlap = Annotated[float, Signal("rad", "overlap of pawl and tooth", 1e-2)]
Torque = Annotated[float, Signal("N*m", "torque of the pawl", 1.0)]
Flag = Annotated[float, Signal("1", "flag", 0.5, low=0.0, high=1.0)]
Work = Annotated[float, Signal("W", "work on the pawl")]
Loss = Annotated[float, Signal("W", "loss at the pawl", role=Role("sink", "pawl", returns="any"))]

_FAR = 100.0
"""distance of a pawl that is not engaged, in teeth"""
_ARRIVED = 6.0
"""time in which a pawl approaches its tooth to within a quarter of a pitch, in time constants"""


class Parameters(ParameterSet):
    """Massless pawl, and elastic teeth without damping.

    ``law``: with ``"mono-stable"``, a spring engages the pawl and the solenoid releases it while it
    has current. Without power, the pawl engages. With ``"bi-stable"``, each pulse of current
    toggles the pawl, which otherwise stays where it is. The spring then holds both positions.
    """

    law: Literal["off", "mono-stable", "bi-stable"]
    """position of the pawl without current; "off": no pawl"""
    delta: Pitch
    """tooth pitch"""
    r: Length
    """radius at which the pawl acts"""
    k: ToothStiffness
    """stiffness of pawl and tooth"""
    tau: Duration
    """time constant of the pawl's motion"""
    mu: Friction
    """friction coefficient between pawl and tooth"""
    F_spring: Force
    """spring force against the solenoid"""
    F_sol: Force
    """solenoid force"""


FAULTS = (
    ParameterFault("weak", "weak solenoid (value: factor)", ("F_sol",), 0.5),
    ParameterFault("worn", "rough teeth (value: factor)", ("mu",), 2.0),
    ParameterFault("broken", "broken tooth (value: factor)", ("k",), 1e-6),
)


def exists(par: Parameters) -> bool:
    """Return whether there is a pawl."""
    return par.law != "off"


class State(NamedTuple):
    """Angle at which the pawl stops the shaft."""

    theta_stop: Annotated[float, Signal("rad", "angle of the pawl's tooth", 20.0)]


class Factors(NamedTuple):
    """Factor of the derivative."""

    theta_stop: Annotated[float, Signal("s", "time constant", 1e-3)]


class Balance(NamedTuple):
    """Distance to the new angle."""

    theta_stop: Annotated[float, Signal("rad", "distance to the new angle", 0.1)]


class Input(NamedTuple):
    """Motion of the shaft, and the angle that the pawl approaches."""

    theta: Angle
    omega: Speed
    target: Annotated[float, Signal("rad", "angle of the tooth in memory", 20.0)]


class InputRate(NamedTuple):
    """Derivatives of the inputs that affect the stored energy."""

    theta: Speed


class Forces(NamedTuple):
    """Torque of the pawl on the shaft, toward clamping."""

    T_pawl: Torque


class Latch(NamedTuple):
    """Memory of the pawl."""

    engaged: Annotated[float, Signal("1", "pawl engaged", 0.5, low=0.0, high=1.0)]
    tooth: Annotated[float, Signal("1", "tooth of the pawl", 100.0)]
    powered: Annotated[float, Signal("1", "solenoid with current", 0.5, low=0.0, high=1.0)]


class Command(NamedTuple):
    """Motion of the shaft, torque of the pawl, and current of the solenoid (0 or 1)."""

    theta: Angle
    omega: Speed
    torque: Torque
    powered: Flag


def target(x: Latch, par: Parameters) -> Angle:
    """Return the angle that the pawl approaches."""
    away = ops.where(x.engaged > 0.5, 0.0, _FAR)
    return par.delta * (x.tooth - away)


def release_force(
    torque: Torque, par: Parameters
) -> Annotated[float, Signal("N", "force that releases the pawl", 50.0)]:
    r"""Return the solenoid force that releases the pawl, :math:`F_{spring} + \mu T / r`."""
    return par.F_spring + par.mu * torque / par.r


def latch(x: Latch, u: Command, par: Parameters) -> Latch:
    """Move the pawl at a tick.

    While the pawl is engaged, teeth that the shaft passes toward clamping slide below it. It
    engages the tooth that a shaft turning back reaches while the pawl moves in.
    """
    if par.law == "off":
        return x
    here = ops.floor(u.theta / par.delta)
    reached = u.theta + _ARRIVED * par.tau * ops.fmin(u.omega, 0.0 * u.omega)
    first = ops.floor(reached / par.delta)
    is_free = par.F_sol > release_force(u.torque, par)
    released = ops.where(is_free, 0.0, x.engaged)
    if par.law == "mono-stable":
        engaged = ops.where(u.powered > 0.5, released, 1.0)
    else:
        moved = ops.where(par.F_sol > par.F_spring, 1.0, x.engaged)
        toggled = ops.where(x.engaged > 0.5, released, moved)
        pulse = ops.where(u.powered > 0.5, ops.where(x.powered > 0.5, 0.0, 1.0), 0.0)
        engaged = ops.where(pulse > 0.5, toggled, x.engaged)
    last = ops.where(x.engaged > 0.5, ops.fmax(x.tooth, here), first)
    return Latch(engaged, ops.where(engaged > 0.5, last, here), u.powered)


def mass(par: Parameters) -> Factors:
    """Return the time constant."""
    return Factors(theta_stop=par.tau)


def balance(x: State, u: Input) -> Balance:
    r"""Return the distance to the tooth.

    .. math:: \tau \dot\theta_{stop} = k \delta - \theta_{stop}
    """
    return Balance(theta_stop=u.target - x.theta_stop)


def overlaps(x: State, u: Input) -> Overlap:
    r"""Return the overlap, affine in the states, :math:`d = \theta_{stop} - \theta`."""
    return x.theta_stop - u.theta


def compliance(par: Parameters) -> Compliance:
    """Return the compliance of pawl and tooth."""
    return 1.0 / par.k


def forces(x: State, u: Input, par: Parameters) -> Forces:
    """Return the torque on a shaft without other contacts."""
    return Forces(T_pawl=par.k * ops.fmax(overlaps(x, u), 0.0))


def input_rate(u: Input) -> InputRate:
    """Return the speed, through which the tooth stores energy."""
    return InputRate(theta=u.omega)


def energy(x: State, u: Input, par: Parameters) -> Energy:
    """Return the elastic energy of the tooth."""
    depth = ops.fmax(overlaps(x, u), 0.0)
    return 0.5 * par.k * depth * depth


def power_in(u: Input, f: Forces) -> Work:
    """Return the work of the shaft on the tooth."""
    return -f.T_pawl * u.omega


def power_loss(x: State, u: Input, f: Forces, par: Parameters) -> Loss:
    """Return the work on a pawl that leaves a loaded tooth (signed: negative on its way in)."""
    return -f.T_pawl * balance(x, u).theta_stop / par.tau
