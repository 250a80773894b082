"""Moment control of a wedge brake, with modes for parking, gap crossing, moment and retracting.

The control uses the angle toward clamping, so both directions of rotation are the same. Its output
is the speed of the common angle reference, which the faster position task integrates.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from annotated_types import Gt
from pydantic import Field

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Frequency, Unit
from bywire.core.signals import Signal

PARKED, GAP, MOMENT, RETRACTING = 0.0, 1.0, 2.0, 3.0

SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
Speed = Annotated[float, Signal("rad/s", "speed of the reference", 50.0)]
Angle = Annotated[float, Signal("rad", "angle", 3.0)]
Moment = Annotated[float, Signal("N*m", "moment", 300.0)]
Flag = Annotated[float, Signal("1", "flag")]
SpeedLimit = Annotated[float, Unit("rad/s", 60.0), Field(gt=0, allow_inf_nan=False)]
Acceleration = Annotated[float, Unit("rad/s**2", 6e3), Field(gt=0, allow_inf_nan=False)]
SomeMoment = Annotated[float, Unit("N*m", 10.0), Field(gt=0, allow_inf_nan=False)]
MomentSlope = Annotated[float, Unit("N*m/rad", 300.0), Field(gt=0, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Gap crossing with limited acceleration toward the contact position, then integral control."""

    f_c: Frequency
    """crossover frequency of the moment loop"""
    slope_hat: MomentSlope
    """moment per angle in contact, assumed by the controller"""
    rate_max: SpeedLimit
    """software rate limit of the moment mode"""
    omega_gap: SpeedLimit
    """maximum speed while crossing the gap"""
    a_gap: Acceleration
    """acceleration while crossing the gap"""
    omega_creep: SpeedLimit
    """speed from the estimated contact position until contact is detected"""
    M_on: SomeMoment
    """minimum moment demand at which the brake leaves its parking position"""
    M_contact: SomeMoment
    """minimum measured moment that indicates contact, the threshold of the gap mode"""
    Omega_still: SpeedLimit
    """disc speed below which the control does not use the moment sensor"""


class State(NamedTuple):
    """Mode, speed of the reference, and the angle at which the pads touch."""

    mode: Annotated[float, Signal("1", "mode of the moment control", 3.0)]
    rate: Annotated[float, Signal("rad/s", "speed of the reference", 50.0)]
    theta_c: Annotated[float, Signal("rad", "contact position, estimated", 1.7)]


class Input(NamedTuple):
    """Demand, measurements, and reference, all positive toward clamping."""

    M_set: Annotated[float, Signal("N*m", "moment demand", 300.0)]
    M_meas: Annotated[float, Signal("N*m", "measured moment", 300.0)]
    theta: Annotated[float, Signal("rad", "measured angle, mean of both", 3.0)]
    theta_ref: Annotated[float, Signal("rad", "angle reference", 3.0)]
    Omega: Annotated[float, Signal("rad/s", "disc speed", 60.0)]


def observed(x: State, u: Input, par: Parameters) -> Moment:
    """Return the moment to control: measured, or from the angle while the disc is at rest.

    Notes
    -----
    The standstill logic is our choice. With the disc at rest, the sensor reads zero and an integral
    law would wind up. The control uses the assumed stiffness instead.
    """
    still = ops.fabs(u.Omega) < par.Omega_still
    believed = ops.fmax(par.slope_hat * (u.theta - x.theta_c), 0.0)
    return ops.where(still, believed, u.M_meas)


def next_mode(mode: Flag, braking: Flag, touching: Flag, home: Flag) -> Flag:
    """Return the next mode from flags of 0 or 1.

    ``braking``, ``touching``, ``home``: flags for a braking demand, pad contact, and a reference at
    its parking position.
    """
    from_parked = ops.where(braking > 0.5, GAP, PARKED)
    from_gap = ops.where(braking > 0.5, ops.where(touching > 0.5, MOMENT, GAP), RETRACTING)
    done = (1.0 - braking) * (1.0 - touching)
    from_moment = ops.where(done > 0.5, RETRACTING, MOMENT)
    from_retracting = ops.where(braking > 0.5, GAP, ops.where(home > 0.5, PARKED, RETRACTING))
    lower = ops.where(mode < 0.5, from_parked, from_gap)
    upper = ops.where(mode < 2.5, from_moment, from_retracting)
    return ops.where(mode < 1.5, lower, upper)


def crossing_speed(distance: Angle, rate: Speed, T: SampleTime, par: Parameters) -> Speed:
    r"""Return the speed toward a position, with limited acceleration, and creeping at the end.

    .. math:: \omega = \min(\omega_{gap}, |\omega_{k-1}| + a T, \sqrt{\omega_{creep}^2 + 2 a d})
    """
    left = ops.fmax(distance, 0.0)
    braking = ops.sqrt(par.omega_creep * par.omega_creep + 2.0 * par.a_gap * left)
    return ops.fmin(ops.fmin(par.omega_gap, ops.fabs(rate) + par.a_gap * T), braking)


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> State:
    r"""Advance the controller by one sample. Its output is the state's ``rate``.

    .. math:: \omega_{ref} = \mathrm{sat}\left(2 \pi f_c (M_{set} - M) / S\right)

    in mode "moment" with the assumed slope S. Whenever the moment mode begins, the controller
    updates the contact position from angle and moment.

    References
    ----------
    Roberts et al. (2003), section "Moment tests", for the gap crossing mode and the software rate
    limit. The law itself is ours.
    """
    M = observed(x, u, par)
    braking = ops.where(u.M_set > par.M_on, 1.0, 0.0)
    touching = ops.where(par.M_contact < M, 1.0, 0.0)
    home = ops.where(u.theta_ref <= 1e-3 * par.omega_creep * T, 1.0, 0.0)
    mode = next_mode(x.mode, braking, touching, home)
    begins = ops.where(
        x.mode < 1.5, ops.where(mode > 1.5, ops.where(mode < 2.5, 1.0, 0.0), 0.0), 0.0
    )
    theta_c = ops.where(begins > 0.5, u.theta - M / par.slope_hat, x.theta_c)
    law = 2.0 * math.pi * par.f_c * (u.M_set - M) / par.slope_hat
    moment = ops.clip(law, -par.rate_max, par.rate_max)
    gap = crossing_speed(theta_c - u.theta_ref, ops.fmax(x.rate, 0.0), T, par)
    back = crossing_speed(u.theta_ref, ops.fmin(x.rate, 0.0), T, par)
    retract = -ops.fmin(back, ops.fmax(u.theta_ref, 0.0) / T)
    lower = ops.where(mode < 0.5, 0.0 * gap, gap)
    upper = ops.where(mode < 2.5, moment, retract)
    return State(mode=mode, rate=ops.where(mode < 1.5, lower, upper), theta_c=theta_c)
