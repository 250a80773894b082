"""Sampled controllers of the wedge brake: moment at 1 kHz, position at 5 kHz.

A brake may also have an adjuster, which turns between two applications.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Ge, Le

from bywire.brakes.wedge.laws import gap_adjusting, moment_control, screw_offset
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.control import derating, position_pd
from bywire.core import ops
from bywire.core.signals import Limited, Signal

_MOST = Limited("control.position.i_max")


class Stimulus(NamedTuple):
    """External inputs. ``command.mode`` determines which of them act."""

    M_set: Annotated[float, Signal("N*m", "moment demand", 300.0)]
    theta_1_set: Annotated[float, Signal("rad", "angle demand 1", 3.0)]
    theta_2_set: Annotated[float, Signal("rad", "angle demand 2", 3.0)]
    i_1_set: Annotated[float, Signal("A", "current demand 1", 5.0)]
    i_2_set: Annotated[float, Signal("A", "current demand 2", 5.0)]
    power_off: Annotated[float, Signal("1", "power stages switched off"), Ge(0), Le(1)]


class Memory(NamedTuple):
    """Memory of the controllers between their samples."""

    on: Annotated[float, Signal("1", "power stages on")]
    M_set: Annotated[float, Signal("N*m", "moment demand", 300.0)]
    M_meas: Annotated[float, Signal("N*m", "sampled moment", 300.0)]
    mode: Annotated[float, Signal("1", "mode: 0 parked, 1 gap, 2 moment, 3 retracting")]
    direction: Annotated[float, Signal("1", "direction toward clamping, +1 or -1")]
    rate: Annotated[float, Signal("rad/s", "speed of the reference", 50.0)]
    theta_c: Annotated[float, Signal("rad", "contact position, estimated", 1.7)]
    sat_rate: Annotated[float, Signal("1", "software rate limit reached")]
    theta_ref: Annotated[float, Signal("rad", "common angle reference", 3.0)]
    delta: Annotated[float, Signal("m", "offset of each screw", 4e-5)]
    theta_1_ref: Annotated[float, Signal("rad", "angle reference 1", 3.0)]
    theta_2_ref: Annotated[float, Signal("rad", "angle reference 2", 3.0)]
    last_1: Annotated[float, Signal("rad", "encoder 1 at the last sample", 3.0)]
    last_2: Annotated[float, Signal("rad", "encoder 2 at the last sample", 3.0)]
    speed_1: Annotated[float, Signal("rad/s", "measured speed 1", 50.0)]
    speed_2: Annotated[float, Signal("rad/s", "measured speed 2", 50.0)]
    i_1_ref: Annotated[float, Signal("A", "current demand 1", 5.0), _MOST]
    i_2_ref: Annotated[float, Signal("A", "current demand 2", 5.0), _MOST]
    rise_winding_1: derating.Rise
    rise_housing_1: derating.Rise
    rise_winding_2: derating.Rise
    rise_housing_2: derating.Rise
    i_most: Annotated[float, Signal("A", "limit of both current demands", 20.0)]
    derated: Annotated[float, Signal("1", "motors derated")]
    adjusting: Annotated[float, Signal("1", "adjuster: 0 waits, 1 brake applied, 2 turns", 2.0)]
    click_rate: Annotated[float, Signal("1/s", "adjuster speed, in teeth per second", 50.0)]
    meant_rate: Annotated[
        float, Signal("1/s", "commanded adjuster speed, in teeth per second", 50.0)
    ]
    clicks: Annotated[float, Signal("1", "teeth turned by the adjuster", 3.0)]
    gap_hat: Annotated[float, Signal("m", "clearance estimated by the adjuster", 2e-4)]
    applied: Annotated[float, Signal("1", "brake has been applied since it was last parked")]
    wide: Annotated[
        float, Signal("1", "consecutive applications with too large a gap; < 0: too small")
    ]
    teeth: Annotated[float, Signal("1", "teeth turned, as counted by the adjuster", 3.0)]


class Readings(NamedTuple):
    """Sensor readings at one sample."""

    theta_1: Annotated[float, Signal("rad", "encoder 1", 3.0)]
    theta_2: Annotated[float, Signal("rad", "encoder 2", 3.0)]
    M: Annotated[float, Signal("N*m", "moment sensor", 300.0)]
    Omega: Annotated[float, Signal("rad/s", "disc speed", 60.0)]


def moment_tick(r: Readings, m: Memory, u: Stimulus, par: WedgeParameters) -> Memory:
    """Run the moment control once. Its output is the speed of the common angle reference."""
    control, T = par.control.moment, par.control.T_slow
    if par.adjuster.law != "none":
        contact = gap_adjusting.contact(m.theta_c, m.meant_rate, T, par.control.adjuster)
        m = m._replace(theta_c=contact)
    rotation = ops.where(r.Omega < 0, -1.0, 1.0)
    direction = ops.where(m.mode < 0.5, rotation, m.direction)
    measured = rotation * r.M
    law = moment_control.output(
        moment_control.State(m.mode, m.rate, m.theta_c),
        moment_control.Input(
            M_set=u.M_set,
            M_meas=measured,
            theta=direction * 0.5 * (r.theta_1 + r.theta_2),
            theta_ref=direction * m.theta_ref,
            Omega=r.Omega,
        ),
        T,
        control,
    )
    limited = ops.where(ops.fabs(law.rate) >= control.rate_max, 1.0, 0.0)
    in_moment = ops.where((law.mode - moment_control.MOMENT) ** 2 < 0.25, 1.0, 0.0)
    return m._replace(
        M_set=u.M_set,
        M_meas=measured,
        direction=direction,
        mode=law.mode,
        rate=law.rate,
        theta_c=law.theta_c,
        sat_rate=limited * in_moment,
    )


def position_tick(r: Readings, m: Memory, u: Stimulus, par: WedgeParameters) -> Memory:
    """Run the position control of both motors once."""
    on = 1.0 - u.power_off
    m = _references(_derated(m._replace(on=on), par), r, u, par)
    rate = m.direction * m.rate if par.command.mode == "moment" else 0.0 * m.rate
    control, T = _position(m, par), par.control.T_fast
    x_1, out_1 = position_pd.output(
        position_pd.State(m.last_1, m.speed_1),
        position_pd.Input(m.theta_1_ref, rate, r.theta_1),
        T,
        control,
    )
    x_2, out_2 = position_pd.output(
        position_pd.State(m.last_2, m.speed_2),
        position_pd.Input(m.theta_2_ref, rate, r.theta_2),
        T,
        control,
    )
    return m._replace(
        last_1=x_1.last,
        last_2=x_2.last,
        speed_1=x_1.speed,
        speed_2=x_2.speed,
        i_1_ref=on * out_1.i,
        i_2_ref=on * out_2.i,
    )


def adjuster_tick(m: Memory, u: Stimulus, par: WedgeParameters) -> Memory:
    """Run the adjuster once. A turn takes one sample, and the moment control follows."""
    law = par.control.adjuster
    braking = ops.where(u.M_set > par.control.moment.M_on, 1.0, 0.0)
    x, out = gap_adjusting.output(
        gap_adjusting.State(m.applied, m.wide, m.teeth),
        gap_adjusting.Input(m.theta_c, m.mode, braking),
        law,
    )
    return m._replace(
        adjusting=out.mode,
        click_rate=out.turned / law.T_adjust,
        meant_rate=out.teeth / law.T_adjust,
        clicks=m.clicks + out.turned,
        gap_hat=out.gap,
        **x._asdict(),
    )


def current_tick(m: Memory, u: Stimulus, par: WedgeParameters) -> Memory:
    """Pass the limited current demands to the drives."""
    on = 1.0 - u.power_off
    m = _derated(m, par)
    most = par.control.position.i_max if par.control.derating.law == "off" else m.i_most
    i_1, i_2 = (ops.clip(i, -most, most) for i in (u.i_1_set, u.i_2_set))
    return m._replace(on=on, i_1_ref=on * i_1, i_2_ref=on * i_2)


def _derated(m: Memory, par: WedgeParameters) -> Memory:
    """Return the memory with the limit for both currents, from the hotter motor.

    The controllers do not measure the currents. They use the demands, which the drives follow.
    """
    control, T = par.control.derating, par.control.T_fast
    if control.law == "off":
        return m
    most = par.control.position.i_max
    x_1, out_1 = derating.output(
        derating.State(m.rise_winding_1, m.rise_housing_1),
        derating.Input(m.i_1_ref, most),
        T,
        control,
    )
    x_2, out_2 = derating.output(
        derating.State(m.rise_winding_2, m.rise_housing_2),
        derating.Input(m.i_2_ref, most),
        T,
        control,
    )
    return m._replace(
        rise_winding_1=x_1.winding,
        rise_housing_1=x_1.housing,
        rise_winding_2=x_2.winding,
        rise_housing_2=x_2.housing,
        i_most=ops.fmin(out_1.i_max, out_2.i_max),
        derated=ops.fmax(out_1.derated, out_2.derated),
    )


def _position(m: Memory, par: WedgeParameters) -> position_pd.Parameters:
    """Return the position control with the current limit from derating."""
    control = par.control.position
    if par.control.derating.law == "off":
        return control
    # Skip validation, because the limit may be a symbol and can only be smaller.
    return position_pd.Parameters.model_construct(**{**dict(control), "i_max": m.i_most})


def _references(m: Memory, r: Readings, u: Stimulus, par: WedgeParameters) -> Memory:
    """Return the memory with updated references of both shafts."""
    if par.command.mode == "position":
        return m._replace(theta_1_ref=u.theta_1_set, theta_2_ref=u.theta_2_set)
    advanced = m.theta_ref + _allowed(m, par) * par.control.T_fast
    # While the power is off, the reference follows the shafts for a bumpless restart.
    common = ops.where(m.on > 0.5, advanced, 0.5 * (r.theta_1 + r.theta_2))
    position, offset = par.control.position, par.control.offset
    F_M = position.K_hat * (m.i_1_ref + m.i_2_ref) / offset.k_hat
    target = screw_offset.offset(F_M, offset)
    delta = screw_offset.advance(m.delta, target, par.control.T_fast, offset)
    both = screw_offset.output(common, delta, offset)
    return m._replace(
        theta_ref=common, delta=delta, theta_1_ref=both.theta_1, theta_2_ref=both.theta_2
    )


def _allowed(m: Memory, par: WedgeParameters) -> float:
    """Return the speed of the common reference [rad/s], 0 if both motors are at their limit.

    This is the anti-windup. A reference that moved on would have to return first at a release.
    """
    limit, speed = _position(m, par).i_max, m.direction * m.rate
    push = ops.where(speed < 0, -1.0, 1.0)
    least = ops.fmin(push * m.i_1_ref, push * m.i_2_ref)
    return ops.where(least < limit, speed, 0.0 * speed)
