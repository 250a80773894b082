"""The brake's ECU with force, speed and current control in a cascade, at their sample times.

Force and speed control, and the ideal source, are the same for every motor. They read and write
the memory's fields by name.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from bywire.authoring import Limited, Signal, joined
from bywire.control import current_pi
from bywire.core import ops
from bywire.plant import adc, current_sensor, floating_caliper, h_bridge
from emb_caliper import estimation
from emb_caliper.elements import ball_screw, planetary_gear
from emb_caliper.laws import limited_pi
from emb_caliper.parameters import CaliperBrakeParameters as Par


class Stimulus(NamedTuple):
    """External inputs. ``drive`` determines which of them acts."""

    F_set: Annotated[float, Signal("N", "force demand", 1e4)]
    omega_set: Annotated[float, Signal("rad/s", "speed demand", 100.0)]
    i_set: Annotated[float, Signal("A", "current demand", 10.0)]
    v_set: Annotated[float, Signal("V", "voltage demand", 10.0)]
    noise_F: Annotated[float, Signal("1", "force channel noise")]
    noise_i: Annotated[float, Signal("1", "current channel noise")]
    noise_i_2: Annotated[float, Signal("1", "noise of the second current channel")]


class DriveMemory(NamedTuple):
    """Memory of the cascade between its ticks."""

    F_meas: Annotated[float, Signal("N", "measured clamp force", 1e4)]
    theta_meas: Annotated[float, Signal("rad", "measured motor angle", 50.0)]
    omega_meas: Annotated[float, Signal("rad/s", "measured motor speed", 100.0)]
    F_ref: Annotated[float, Signal("N", "force set point", 1e4, set_point_of="F_cl")]
    omega_ref: Annotated[float, Signal("rad/s", "speed set point", 100.0, set_point_of="omega")]
    i_ref: Annotated[float, Signal("A", "current set point", 10.0, set_point_of="i")]
    duty: Annotated[float, Signal("1", "duty cycle", 0.5), Limited("ecu.current.D_max")]
    v_source: Annotated[float, Signal("V", "source voltage", 10.0)]
    parked: Annotated[float, Signal("1", "parked by position control")]
    sat_speed: Annotated[float, Signal("1", "speed demand saturated")]
    sat_current: Annotated[float, Signal("1", "current demand saturated")]
    sat_duty: Annotated[float, Signal("1", "duty cycle saturated")]
    force_integral: Annotated[float, Signal("rad/s", "integral term of the force PI", 10.0)]
    speed_integral: Annotated[float, Signal("A", "integral term of the speed PI", 5.0)]
    current_integral: Annotated[float, Signal("1", "integral term of the current PI", 0.3)]


Memory: Any = joined(__name__, "Memory", DriveMemory, estimation.Memory)
"""memory of the ECU between its ticks"""


class Readings(NamedTuple):
    """Sensor readings at a tick. The speed is ideal."""

    F_cell: Annotated[float, Signal("N", "reading of the load cell", 1e4)]
    theta: Annotated[float, Signal("rad", "motor angle", 50.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 100.0)]
    i: Annotated[float, Signal("A", "motor current", 10.0)]


def force_tick(r: Any, m: Any, u: Stimulus, par: Any) -> Any:
    """Read the load cell, and run force control once to update the speed set point."""
    share = adc.sample(r.F_cell / par.F_span, u.noise_F, par.adc)
    m = m._replace(F_meas=share * par.F_span, theta_meas=r.theta)
    m = estimation.fed_back(m, par)
    return _force_control(m, u, par) if par.drive == "force" else m


def estimate_tick(r: Readings, m: Any, u: Stimulus, par: Par) -> Any:
    """Advance the estimate of the clamp force by one sample."""
    return estimation.estimated(r.theta, measured_current(r.i, u.noise_i, par), m, par)


def measured_current(i: float, noise: float, par: Any) -> float:
    """Return a current as the ECU measures it."""
    if par.current_adc.law == "ideal":
        return i
    share = adc.sample(current_sensor.reading(i, par.current), noise, par.current_adc)
    return current_sensor.value(share, par.current)


def speed_tick(r: Readings, m: Any, u: Stimulus, par: Par) -> Any:
    """Run speed control of a DC motor once to update the current set point."""
    return speed_control(r, m, u, par, par.motor.K_e)


def speed_control(r: Any, m: Any, u: Stimulus, par: Any, K_t: float) -> Any:
    """Run speed control once; ``K_t``: torque per current [N*m/A]."""
    m = m._replace(omega_meas=r.omega)
    if par.drive == "speed":
        m = m._replace(omega_ref=u.omega_set)
    state, out = limited_pi.speed(
        limited_pi.SpeedState(m.speed_integral),
        limited_pi.SpeedInput(m.omega_ref - m.omega_meas, _ahead(m, par, K_t)),
        par.ecu.T_force,
        par.ecu.speed,
    )
    saturated = ops.where(ops.fabs(out.i) >= par.ecu.speed.i_max, 1.0, 0.0)
    return m._replace(i_ref=out.i, sat_current=saturated, speed_integral=state.integral)


def current_tick(r: Readings, m: Any, u: Stimulus, par: Par) -> Any:
    """Run current control once."""
    if par.drive == "current":
        m = m._replace(i_ref=u.i_set)
    i = measured_current(r.i, u.noise_i, par)
    m = estimation.summed(i, m, par)
    limit = h_bridge.limited(par.ecu.current.D_max, par.bridge)
    state, out = current_pi.output(
        current_pi.State(m.current_integral),
        current_pi.Input(i_ref=m.i_ref, i_meas=i, D_lim=limit),
        par.ecu.T_current,
        par.ecu.current,
    )
    saturated = ops.where(ops.fabs(out.duty) >= limit, 1.0, 0.0)
    return m._replace(duty=out.duty, sat_duty=saturated, current_integral=state.integral)


def source_tick(r: Any, m: Any, u: Stimulus, par: Any) -> Any:
    """Update the voltage of an ideal source."""
    return m._replace(v_source=u.v_set)


def travel_per_angle(par: Any) -> float:
    """Return the piston travel per motor angle [m/rad]."""
    return ball_screw.slope(par.screw) / planetary_gear.ratio(par.gear)


def _force_control(m: Any, u: Stimulus, par: Any) -> Any:
    """Return the memory with a new speed set point, which presses the pads or parks the piston."""
    ecu = par.ecu
    state, out = limited_pi.force(
        limited_pi.ForceState(m.force_integral),
        limited_pi.ForceInput(u.F_set - m.F_used, _factor(m, par)),
        ecu.T_force,
        ecu.force,
    )
    top = ecu.force.omega_max
    parking = ops.clip(-ecu.k_park * m.theta_meas, -top, top)
    pressing = u.F_set >= ecu.F_on
    omega_ref = ops.where(pressing, out.omega, parking)
    return m._replace(
        F_ref=u.F_set,
        omega_ref=omega_ref,
        parked=ops.where(pressing, 0.0, 1.0),
        sat_speed=ops.where(ops.fabs(omega_ref) >= top, 1.0, 0.0),
        force_integral=ops.where(pressing, state.integral, 0.0),
    )


def _factor(m: Any, par: Any) -> float:
    """Return the factor on the gains of the force controller."""
    if par.ecu.scheduling == "off":
        return 1.0
    n = ops.fmax(travel_per_angle(par) * m.theta_meas - par.caliper.clearance, 0.0)
    return par.caliper.k_1 / floating_caliper.stiffness(n, par.caliper)


def _ahead(m: Any, par: Any, K_t: float) -> float:
    """Return the feed-forward current [A]."""
    if par.ecu.load == "off":
        return 0.0
    return travel_per_angle(par) * ops.fmax(m.F_used, 0.0) / K_t
