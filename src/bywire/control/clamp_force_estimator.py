r"""Clamp force without a sensor, from motor angle and motor torque.

Two sources complement each other. The *curve* of the caliper gives the force from the angle since
contact, also at rest, but its scale is uncertain. The *balance* of torques gives the force from the
motor torque while the shaft turns, but friction hides it at rest, by :math:`\pm (C + G F)/\gamma`.
A Kalman filter combines both.

.. math::
    F_1 = s f(\gamma (\theta - \theta_0)), \quad
    F_2 = \frac{T_L - \mathrm{sgn}(\omega)\, C}{\gamma + \mathrm{sgn}(\omega)\, G}

Load torque. With the filter :math:`L = (k/(\sigma + k))^2` and :math:`H = 1 - k/(\sigma + k)`, the
torque balance :math:`J \dot\omega = T - D \omega - T_L` gives the filtered load torque without a
derivative of the quantized angle,

.. math:: L[T_L] = L[T] - D k\, L_1[H \theta] - J k^2 H^2 \theta

The force that is compared with the balance goes through the same filter.

Notes
-----
A momentum observer with one pole needs a measured speed. A second pole makes the acceleration a
proper function of the angle, so the law needs neither a speed nor a speed observer, whose lag would
act like an inertia.

The estimate has corners where the pads touch, where the shaft comes to rest, and where the balance
becomes valid.

References
----------
S. Saric, A. Bab-Hadiashar, A Kalman filtering approach to estimate clamp force, 2007 (abstract):
fusion of stiffness curve and torque balance. G. Park, S. B. Choi, Proc. IMechE D 232(14), 2018
(abstract): contact angle.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Ge, Gt
from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import (
    Duration,
    Factor,
    GearRatio,
    Inertia,
    Length,
    RotaryDamping,
    Stiffness,
    Torque,
    Unit,
)
from bywire.core.signals import Signal

Corner = Annotated[float, Unit("1/s", 200.0), Field(gt=0, allow_inf_nan=False)]
Quadratic = Annotated[float, Unit("N/m**2", 3e10), Field(ge=0, allow_inf_nan=False)]
Cubic = Annotated[float, Unit("N/m**3", 7e12), Field(allow_inf_nan=False)]
ContactAngle = Annotated[float, Unit("rad", 10.0), Field(allow_inf_nan=False)]
TorquePerForce = Annotated[float, Unit("N*m/N", 1e-5), Field(ge=0, allow_inf_nan=False)]
AnglePlay = Annotated[float, Unit("rad", 3e-3), Field(ge=0, allow_inf_nan=False)]
Speed = Annotated[float, Unit("rad/s", 3.0), Field(gt=0, allow_inf_nan=False)]
TorqueError = Annotated[float, Unit("N*m", 3e-3), Field(gt=0, allow_inf_nan=False)]
Spread = Annotated[float, Unit("1", 0.1), Field(ge=0, le=1, allow_inf_nan=False)]

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
Angle = Annotated[float, Signal("rad", "motor angle", 30.0)]
TorqueSignal = Annotated[float, Signal("N*m", "torque", 0.5)]
ForceSignal = Annotated[float, Signal("N", "clamp force", 1e4)]
Direction = Annotated[float, Signal("1", "direction of motion: 1, -1, or 0 at rest", 1.0)]

LEAST_SHARE = 0.15
"""the balance is void if force per torque exceeds that without friction by more than 1/0.15"""
SETTLED = 4.75
"""filter times after which 5 % of a step of the friction torque remain, (1 + x) exp(-x)"""


class Parameters(ParameterSet):
    """The law's model of the brake, its filter, and the uncertainties that weight both sources."""

    theta_0: ContactAngle
    """angle at which the pads touch"""
    s: Factor
    """scale of the stiffness curve"""
    C_hat: Torque
    """friction torque without load"""
    G_hat: TorquePerForce
    """friction torque per clamp force"""
    gamma: GearRatio
    """travel per radian of the motor, and load torque per clamp force"""
    J_hat: Inertia
    """inertia at the motor shaft"""
    D_hat: RotaryDamping
    """viscous friction at the motor shaft"""
    k_1: Stiffness
    """stiffness of the curve at contact"""
    k_2: Quadratic
    """coefficient of the overlap squared"""
    k_3: Cubic
    """coefficient of the overlap cubed"""
    n_max: Length
    """overlap up to which the curve rises; beyond it, the force is constant"""
    k: Corner
    """rate of each of the two poles of the torque filter"""
    play: AnglePlay
    """minimum motion that determines the direction, above the sensor's resolution"""
    t_rest: Duration
    """time without such a motion after which the shaft is considered to be at rest"""
    omega_min: Speed
    """speed below which breakaway friction makes the balance uncertain"""
    spread_s: Spread
    """relative uncertainty of the curve"""
    spread_friction: Spread
    """relative uncertainty of the friction"""
    spread_J: Spread
    """relative uncertainty of the accelerating torque"""
    sigma_T: TorqueError
    """uncertainty of the torque at constant speed without friction"""
    tau: Duration
    """time for which errors of the balance persist"""


class Brake(NamedTuple):
    """Properties of the brake that a stroke can identify."""

    theta_0: Annotated[float, Signal("rad", "angle at which the pads touch", 10.0)]
    s: Annotated[float, Signal("1", "scale of the stiffness curve", 1.0), Gt(0)]
    C: Annotated[float, Signal("N*m", "friction torque without load", 0.03), Ge(0)]
    G: Annotated[float, Signal("N*m/N", "friction torque per clamp force", 1e-5), Ge(0)]


class State(NamedTuple):
    """Filters, direction of motion, and the estimate with its variance.

    A memory of zeros is not started, and the first sample sets it.
    """

    started: Annotated[float, Signal("1", "the estimator has started")]
    torque_1: Annotated[float, Signal("N*m", "motor torque after the first pole", 0.5)]
    torque_2: Annotated[float, Signal("N*m", "motor torque after the second pole", 0.5)]
    angle_1: Annotated[float, Signal("rad", "motor angle after the first pole", 30.0)]
    angle_2: Annotated[float, Signal("rad", "motion within the filter time", 1.0)]
    angle_play: Annotated[float, Signal("rad", "motor angle without small motions", 30.0)]
    motion: Direction
    motion_age: Annotated[float, Signal("s", "time since the last motion", 1e-2)]
    motion_time: Annotated[float, Signal("s", "time of motion in one direction", 0.1)]
    F_curve: Annotated[float, Signal("N", "force of the stiffness curve", 1e4)]
    F_hat: Annotated[float, Signal("N", "estimated clamp force", 1e4)]
    F_hat_1: Annotated[float, Signal("N", "estimate after the first pole", 1e4)]
    F_hat_2: Annotated[float, Signal("N", "estimate after the second pole", 1e4)]
    F_variance: Annotated[float, Signal("N**2", "variance of the estimate", 1e6)]


class Input(NamedTuple):
    """Sensor readings."""

    theta: Angle
    torque: Annotated[float, Signal("N*m", "motor torque, mean since the last sample", 0.5)]


class Output(NamedTuple):
    """Load torque, and the force of the torque balance while it is valid."""

    omega: Annotated[float, Signal("rad/s", "filtered motor speed", 100.0)]
    T_L: Annotated[float, Signal("N*m", "filtered load torque", 0.5)]
    T_J: Annotated[float, Signal("N*m", "filtered accelerating torque", 0.5)]
    F_balance: Annotated[float, Signal("N", "clamp force of the torque balance", 1e4)]
    valid: Annotated[float, Signal("1", "the torque balance is valid")]


def brake(par: Parameters) -> Brake:
    """Return the properties of the brake before any training."""
    return Brake(theta_0=par.theta_0, s=par.s, C=par.C_hat, G=par.G_hat)


def force(n: Annotated[float, Signal("m", "overlap", 1e-3)], par: Parameters) -> ForceSignal:
    """Return the force of the curve at an overlap, 0 without contact."""
    pressed = ops.clip(n, 0.0, par.n_max)
    return pressed * (par.k_1 + pressed * (par.k_2 + pressed * par.k_3))


def slope(
    n: Annotated[float, Signal("m", "overlap", 1e-3)], par: Parameters
) -> Annotated[float, Signal("N/m", "stiffness", 2e7)]:
    """Return the stiffness at an overlap; before contact, the stiffness at contact."""
    pressed = ops.clip(n, 0.0, par.n_max)
    return par.k_1 + pressed * (2.0 * par.k_2 + pressed * 3.0 * par.k_3)


def weight(T: SampleTime, par: Parameters) -> Annotated[float, Signal("1", "weight", 0.2), Gt(0)]:
    """Return the weight of a new sample in a pole of the filter (backward Euler)."""
    return par.k * T / (1.0 + par.k * T)


def at_rest(theta: Angle, torque: TorqueSignal, held: Brake, par: Parameters) -> State:
    """Return the state at rest at an angle. The estimate is the force of the curve."""
    F = held.s * force(par.gamma * (theta - held.theta_0), par)
    spread = par.spread_s * F
    return State(
        started=1.0,
        torque_1=torque,
        torque_2=torque,
        angle_1=theta,
        angle_2=0.0,
        angle_play=theta,
        motion=0.0,
        motion_age=0.0,
        motion_time=0.0,
        F_curve=F,
        F_hat=F,
        F_hat_1=F,
        F_hat_2=F,
        F_variance=spread * spread,
    )


def output(x: State, u: Input, held: Brake, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    r"""Advance the estimator by one sample.

    Between corrections, the estimate follows the curve, and its variance P grows with the motion:

    .. math:: F \leftarrow F + \Delta F_1, \quad P \leftarrow P + 2 \sigma_s^2 F_1 |\Delta F_1|

    While the balance is valid,

    .. math::
        F \leftarrow F + g (F_2 - L[F]), \quad g = \frac{P}{P + R\, \tau/T}, \quad
        R = \frac{\sigma_T^2 + (\sigma_J T_J)^2 + (\sigma_f (C + G F))^2}
        {(\gamma + \mathrm{sgn}(\omega)\, G)^2}

    Errors of the balance persist for about :math:`\tau`, so its variance counts once per
    :math:`\tau`. The estimate is 0 where the curve is.
    """
    x = _started(x, at_rest(u.theta, u.torque, held, par))
    filtered = _filtered(x, u, T, par)
    moved = _moved(filtered, u.theta, T, par)
    out = _balance(moved, u, held, par)
    F_curve = held.s * force(par.gamma * (u.theta - held.theta_0), par)
    rise = F_curve - x.F_curve
    F = ops.fmax(x.F_hat + rise, 0.0)
    grown = x.F_variance + 2.0 * par.spread_s * par.spread_s * F_curve * ops.fabs(rise)
    uncertain = _variance(F, moved.motion, out.T_J, held, par) * (par.tau / T)
    g = ops.where(out.valid > 0.5, grown / (grown + uncertain), 0.0)
    # A force at a sample is delayed by one sample, like the torque, which is centered there.
    a = weight(T, par)
    F_hat_2 = x.F_hat_2 + a * (x.F_hat_1 - x.F_hat_2)
    corrected = ops.fmax(F + g * (out.F_balance - F_hat_2), 0.0)
    touching = F_curve > 0.0
    F_hat = ops.where(touching, corrected, 0.0)
    state = moved._replace(
        F_curve=F_curve,
        F_hat=F_hat,
        F_hat_1=x.F_hat_1 + a * (F_hat - x.F_hat_1),
        F_hat_2=F_hat_2,
        F_variance=ops.where(touching, (1.0 - g) * grown, 0.0),
    )
    return state, out


def _started(x: State, first: State) -> State:
    """Return the state, or the state of the first sample."""
    old = x.started > 0.5
    return State(*[ops.where(old, a, b) for a, b in zip(x, first, strict=True)])


def _filtered(x: State, u: Input, T: SampleTime, par: Parameters) -> State:
    """Return the state with the filters of torque and angle one sample later.

    The second difference of the angle is centered one sample back, and the mean torque half a
    sample. Therefore, the second pole of the torque reads the mean of the first pole's last two
    values.
    """
    a = weight(T, par)
    torque_1 = x.torque_1 + a * (u.torque - x.torque_1)
    angle_1 = x.angle_1 + a * (u.theta - x.angle_1)
    return x._replace(
        torque_1=torque_1,
        torque_2=x.torque_2 + a * (0.5 * (x.torque_1 + torque_1) - x.torque_2),
        angle_1=angle_1,
        angle_2=x.angle_2 + a * (u.theta - angle_1 - x.angle_2),
    )


def _moved(x: State, theta: Angle, T: SampleTime, par: Parameters) -> State:
    """Return the state with the direction of motion and its duration one sample later."""
    followed = ops.clip(x.angle_play, theta - par.play, theta + par.play)
    up, down = followed > x.angle_play, followed < x.angle_play
    age = ops.where(up, 0.0, ops.where(down, 0.0, x.motion_age + T))
    lasting = ops.where(age < par.t_rest, x.motion, 0.0)
    way = ops.where(up, 1.0, ops.where(down, -1.0, lasting))
    same = ops.where(way * x.motion > 0.5, x.motion_time + T, 0.0)
    fast = par.k * ops.fabs(x.angle_2) > par.omega_min
    since = ops.where(fast, same, 0.0)
    return x._replace(angle_play=followed, motion=way, motion_age=age, motion_time=since)


def _balance(x: State, u: Input, held: Brake, par: Parameters) -> Output:
    """Return load torque and force of the torque balance."""
    T_J = par.J_hat * (par.k * (par.k * (u.theta - x.angle_1 - x.angle_2)))
    omega = par.k * x.angle_2
    T_L = x.torque_2 - par.D_hat * omega - T_J
    per_force = par.gamma + x.motion * held.G
    least = LEAST_SHARE * par.gamma
    F_balance = (T_L - x.motion * held.C) / ops.fmax(per_force, least)
    settled = ops.where(par.k * x.motion_time > SETTLED, ops.fabs(x.motion), 0.0)
    valid = ops.where(per_force > least, settled, 0.0)
    return Output(omega=omega, T_L=T_L, T_J=T_J, F_balance=F_balance, valid=valid)


def _variance(
    F: ForceSignal, way: Direction, T_J: TorqueSignal, held: Brake, par: Parameters
) -> Annotated[float, Signal("N**2", "variance of the torque balance", 1e6)]:
    """Return the variance of the force of the torque balance."""
    friction = par.spread_friction * (held.C + held.G * F)
    inertial = par.spread_J * T_J
    per_force = ops.fmax(par.gamma + way * held.G, LEAST_SHARE * par.gamma)
    square = par.sigma_T * par.sigma_T + friction * friction + inertial * inertial
    return square / (per_force * per_force)
