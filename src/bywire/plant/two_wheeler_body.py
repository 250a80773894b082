"""Body of a two-wheeler on a straight road: braking, load transfer, and rear wheel lift."""

from __future__ import annotations

import math
from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Duration, Length, Unit
from bywire.core.signals import Energy, Power, Role, Signal
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.core.validity import first, highest, within_limits

BodyMass = Annotated[float, Unit("kg", 250.0), Field(gt=0, allow_inf_nan=False)]
BodyInertia = Annotated[float, Unit("kg*m**2", 35.0), Field(ge=0, allow_inf_nan=False)]
Sine = Annotated[float, Signal("1", "sine of the slope", 0.05)]
Cosine = Annotated[float, Signal("1", "cosine of the slope", 1.0)]
Drag = Annotated[float, Signal("W", "air drag", role=Role("sink", "air drag", book="vehicle"))]
_DEGREES = 180.0 / math.pi
_LEAST_FACTOR = 1e-9  # for smaller factors, the load is at one of its limits


class Parameters(ParameterSet):
    """Rigid body with rider, with the front contact on the ground.

    ``load``: ``"lagged"`` transfers load between the wheels with the time constant ``tau_N``, like
    suspensions. ``"rigid"`` transfers load immediately.
    """

    m: BodyMass
    """mass with rider"""
    L: Length
    """wheelbase"""
    l_f: Length
    """distance of the center of gravity behind the front contact"""
    h: Length
    """height of the center of gravity"""
    h_a: Length
    """height at which aerodynamic drag acts"""
    inertia: BodyInertia
    """pitch inertia about the center of gravity"""
    CdA: Annotated[float, Unit("m**2", 0.4), Field(ge=0, allow_inf_nan=False)]
    """drag area"""
    rho: Annotated[float, Unit("kg/m**3", 1.2), Field(ge=0, allow_inf_nan=False)]
    """density of the air"""
    g: Annotated[float, Unit("m/s**2", 9.81), Field(gt=0, allow_inf_nan=False)]
    """gravity"""
    load: Literal["lagged", "rigid"]
    """type of load transfer between the wheels"""
    tau_N: Duration
    """time constant of the load transfer"""

    @model_validator(mode="after")
    def _stands(self) -> Parameters:
        if not self.l_f < self.L:
            reason = "the center of gravity is between the wheels"
            raise RuleError(
                "l_f", shown(self.l_f, "m"), f"< the wheelbase L = {shown(self.L, 'm')}", reason
            )
        return self


class State(NamedTuple):
    """Position and speed of the body, rear wheel load, pitch about the front contact."""

    x: Annotated[float, Signal("m", "distance", 30.0)]
    v: Annotated[float, Signal("m/s", "vehicle speed", 20.0)]
    N_lag: Annotated[float, Signal("N", "rear wheel load, lagged", 1e3)]
    phi: Annotated[float, Signal("rad", "pitch, nose down", 0.05)]
    phi_rate: Annotated[float, Signal("rad/s", "pitch rate", 0.2)]


class Factors(NamedTuple):
    """Factors of the derivatives."""

    x: Annotated[float, Signal("1", "unity")]
    v: Annotated[float, Signal("kg", "mass", 250.0)]
    N_lag: Annotated[float, Signal("s", "time constant", 0.1)]
    phi: Annotated[float, Signal("1", "unity")]
    phi_rate: Annotated[float, Signal("kg*m**2", "inertia", 150.0)]


class Balance(NamedTuple):
    """Right-hand sides of the states."""

    x: Annotated[float, Signal("m/s", "vehicle speed", 20.0)]
    v: Annotated[float, Signal("N", "force", 1e3)]
    N_lag: Annotated[float, Signal("N", "steady-state load", 1e3)]
    phi: Annotated[float, Signal("rad/s", "pitch rate", 0.2)]
    phi_rate: Annotated[float, Signal("N*m", "pitching torque", 500.0)]


class Input(NamedTuple):
    """Total braking force of both tires, slope, and ground force on the rear wheel."""

    F: Annotated[float, Signal("N", "braking force of both tires", 1e3)]
    sine: Sine
    cosine: Cosine
    support: Annotated[float, Signal("N", "force of the ground on the rear wheel", 1e3)]


class Loads(NamedTuple):
    """Wheel loads."""

    front: Annotated[float, Signal("N", "front wheel load", 1e3)]
    rear: Annotated[float, Signal("N", "rear wheel load", 1e3)]


class Place(NamedTuple):
    """Position of the center of gravity relative to the front contact."""

    l_f: Annotated[float, Signal("m", "distance behind the front contact", 0.7)]
    h: Annotated[float, Signal("m", "height", 0.6)]


def drag(x: State, par: Parameters) -> Annotated[float, Signal("N", "air drag", 100.0)]:
    r"""Return the air drag, :math:`\frac12 \rho C_d A\, v |v|`."""
    return 0.5 * par.rho * par.CdA * x.v * ops.fabs(x.v)


def center(x: State, par: Parameters) -> Place:
    """Return the position of the center of gravity at the pitch angle."""
    sine, cosine = ops.sin(x.phi), ops.cos(x.phi)
    return Place(par.l_f * cosine - par.h * sine, par.h * cosine + par.l_f * sine)


def static_load(
    cosine: Cosine, par: Parameters
) -> Annotated[float, Signal("N", "rear load at rest", 1e3)]:
    """Return the rear wheel load without braking force."""
    return par.m * par.g * cosine * par.l_f / par.L


def rear_load(
    F: Annotated[float, Signal("N", "braking force of both tires", 1e3)],
    F_d: Annotated[float, Signal("N", "air drag", 100.0)],
    cosine: Cosine,
    par: Parameters,
) -> Annotated[float, Signal("N", "rear wheel load", 1e3)]:
    r"""Return the rear load that keeps the body level, between zero and the total weight.

    .. math:: N_r = (m g l_f \cos\gamma - F h - F_d (h - h_a))/L
    """
    carried = F * par.h + F_d * (par.h - par.h_a)
    return carried_load(static_load(cosine, par) - carried / par.L, cosine, par)


def rigid_rear_load(
    mu_f: Annotated[float, Signal("1", "front braking force relative to the wheel load", 1.0)],
    mu_r: Annotated[float, Signal("1", "rear braking force relative to the wheel load", 1.0)],
    F_d: Annotated[float, Signal("N", "air drag", 100.0)],
    cosine: Cosine,
    par: Parameters,
) -> Annotated[float, Signal("N", "rear wheel load", 1e3)]:
    r"""Return `rear_load` for braking forces that follow the loads immediately.

    .. math::
        N_r \left(1 + (\mu_r - \mu_f) h/L\right)
            = (m g \cos\gamma\, (l_f - \mu_f h) - F_d (h - h_a))/L

    Load on the rear wheel unloads the front wheel, whose force then causes less pitching. If the
    factor on the left is not positive, no load between the limits is stable, because a rear wheel
    that sinks slightly continues to sink. The rear wheel then supports no load if the right-hand
    side is negative, and the total weight if it is positive.
    """
    carried = mu_f * par.m * par.g * cosine * par.h + F_d * (par.h - par.h_a)
    left = static_load(cosine, par) - carried / par.L
    factor = ops.fmax(1.0 + (mu_r - mu_f) * par.h / par.L, _LEAST_FACTOR)
    return carried_load(left / factor, cosine, par)


def carried_load(
    N_r: Annotated[float, Signal("N", "load that holds the body level", 1e3)],
    cosine: Cosine,
    par: Parameters,
) -> Annotated[float, Signal("N", "rear wheel load", 1e3)]:
    """Return the rear wheel load within its limits, so that neither wheel pulls on the road."""
    return ops.clip(N_r, 0.0, par.m * par.g * cosine)


def loads(
    N_r: Annotated[float, Signal("N", "rear wheel load", 1e3)],
    cosine: Cosine,
    par: Parameters,
) -> Loads:
    """Return the loads of both wheels, whose sum is the weight."""
    return Loads(front=par.m * par.g * cosine - N_r, rear=N_r)


def mass(x: State, par: Parameters) -> Factors:
    """Return the factors of the derivatives: mass, time constant, inertia about the contact."""
    l_f = center(x, par).l_f
    return Factors(
        x=1.0, v=par.m, N_lag=par.tau_N, phi=1.0, phi_rate=par.inertia + par.m * l_f * l_f
    )


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return forces and torques.

    .. math::
        m \dot v &= -F - F_d - m g \sin\gamma \\
        \tau_N \dot N &= N_r - N \\
        (I + m l_f'^2) \ddot\varphi &= F h' - m g l_f' \cos\gamma + m l_f' h' \dot\varphi^2 + N L
    """
    F_d, at = drag(x, par), center(x, par)
    weight = par.m * par.g
    pitching = u.F * at.h + F_d * (par.h - par.h_a) - weight * u.cosine * at.l_f
    turning = par.m * at.l_f * at.h * x.phi_rate * x.phi_rate
    return Balance(
        x=x.v,
        v=-u.F - F_d - weight * u.sine,
        N_lag=rear_load(u.F, F_d, u.cosine, par) - x.N_lag,
        phi=x.phi_rate,
        phi_rate=pitching + turning + u.support * par.L,
    )


def energy(x: State, par: Parameters) -> Energy:
    """Return the kinetic energy of travel and pitch, and the energy of the lifted mass."""
    at = center(x, par)
    turning = 0.5 * (par.inertia + par.m * at.l_f * at.l_f) * x.phi_rate * x.phi_rate
    return 0.5 * par.m * x.v * x.v + turning + par.m * par.g * (at.h - par.h)


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the power of tires and slope, and of the torques that pitch the body."""
    travel = -(u.F + par.m * par.g * u.sine) * x.v
    return travel + pitch_power(x, u, par) + u.support * par.L * x.phi_rate


def pitch_power(x: State, u: Input, par: Parameters) -> Power:
    """Return the power of the torque about the front contact, without the ground force."""
    at = center(x, par)
    torque = u.F * at.h + drag(x, par) * (par.h - par.h_a)
    flat = par.m * par.g * (1.0 - u.cosine) * at.l_f
    return (torque + flat) * x.phi_rate


def power_loss(x: State, par: Parameters) -> Drag:
    """Return the power of the air drag, >= 0."""
    return drag(x, par) * x.v


@within_limits
def watch(t: Array, x: State, par: Parameters) -> list[str]:
    r"""Warn if the body falls over its front wheel.

    At the pitch :math:`\arctan(l_f/h)` the center of gravity is above the front contact. Beyond
    this pitch, gravity continues to pitch the body regardless of the brakes.
    """
    limit = _DEGREES * ops.arctan(par.l_f / par.h)
    pitch = _DEGREES * x.phi
    most = f" (pitch up to {highest(pitch):.3g} deg, limit {highest(limit):.3g} deg)"
    text = "the rider goes over the handlebars: the center of gravity passes the front wheel"
    return first(t, pitch > limit, text, f"{most}, so the rest of the run is not a stop")
