"""The ECU of the plunger: demand, and a cascade of pressure, position and current control."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from annotated_types import Ge

from bywire.authoring import Limited, Signal
from bywire.control import current_pi, pedal_map, position_pd
from bywire.core import ops
from bywire.plant import h_bridge, solenoid_valve
from one_box.laws import plunger_pressure, refill


class Stimulus(NamedTuple):
    """External inputs. ``drive`` determines which of the demands acts."""

    F_foot: Annotated[float, Signal("N", "foot force", 100.0), Ge(0)]
    p_set: Annotated[float, Signal("Pa", "pressure demand", 5e6), Ge(0)]
    theta_set: Annotated[float, Signal("rad", "motor angle demand", 10.0)]
    i_set: Annotated[float, Signal("A", "current demand", 20.0)]


class Memory(NamedTuple):
    """Memory of the ECU between its ticks."""

    foot: Annotated[float, Signal("N", "sampled foot force", 100.0)]
    p_ref: Annotated[float, Signal("Pa", "pressure set point", 5e6, set_point_of="p_mc")]
    theta_ref: Annotated[float, Signal("rad", "motor angle set point", 10.0, set_point_of="theta")]
    omega_ref: Annotated[float, Signal("rad/s", "speed of the set point", 50.0)]
    theta_last: Annotated[float, Signal("rad", "previous measured motor angle", 10.0)]
    omega_meas: Annotated[float, Signal("rad/s", "measured motor speed", 50.0)]
    refill: Annotated[float, Signal("1", "phase of the refill", 2.0)]
    p_kept: Annotated[float, Signal("Pa", "pressure that the brakes keep", 5e6)]
    separate: Annotated[float, Signal("1", "separation valve command")]
    separate_on: Annotated[float, Signal("1", "separation valve energized")]
    separate_waiting: Annotated[
        float, Signal("s", "time since the separation command changed", 1e-3)
    ]
    i_ref: Annotated[float, Signal("A", "current set point", 20.0, set_point_of="i")]
    duty: Annotated[float, Signal("1", "duty cycle", 0.3), Limited("ecu.current.D_max")]
    pi_integral: Annotated[float, Signal("1", "integral term of the current PI", 0.3)]
    sat_current: Annotated[float, Signal("1", "current demand saturated")]
    sat_duty: Annotated[float, Signal("1", "duty cycle saturated")]


class Readings(NamedTuple):
    """Sensor readings at a tick: plunger pressure, motor and pedal rod."""

    p: Annotated[float, Signal("Pa", "plunger pressure", 5e6)]
    theta: Annotated[float, Signal("rad", "motor angle", 10.0)]
    i: Annotated[float, Signal("A", "motor current", 20.0)]
    x_rod: Annotated[float, Signal("m", "travel of the pedal rod", 0.01)]


def demand_tick(r: Readings, m: Any, u: Stimulus, par: Any) -> Any:
    """Sample the foot force, and convert the pedal travel to a pressure demand."""
    m = m._replace(foot=u.F_foot)
    if par.drive == "pedal":
        V = par.ecu.V_ref * ops.clip(r.x_rod / par.ecu.x_span, 0.0, 1.0)
        return m._replace(p_ref=pedal_map.output(V, par.ecu.pedal_map))
    return m._replace(p_ref=u.p_set) if par.drive == "pressure" else m


def pressure_tick(r: Readings, m: Any, u: Stimulus, par: Any) -> Any:
    """Run pressure control of the plunger once, or refill the plunger near its end."""
    law = par.ecu.refill
    before = refill.State(m.refill, m.p_kept)
    state = refill.output(before, refill.Input(m.p_ref, r.theta, r.p), law)
    retracts = ops.where(ops.fabs(state.phase - refill.RETRACTS) < 0.5, m.separate_on, 0.0)
    reference = plunger_pressure.State(m.theta_ref)
    seen = plunger_pressure.Input((1.0 - retracts) * m.p_ref, r.p)
    controlled = plunger_pressure.output(reference, seen, par.ecu.pressure)
    return m._replace(
        omega_ref=ops.where(state.phase > 1.5, law.omega, controlled),
        refill=state.phase,
        p_kept=state.p_kept,
        separate=ops.where(state.phase > 0.5, 1.0, 0.0),
    )


def separate_tick(r: Readings, m: Any, u: Stimulus, par: Any) -> Any:
    """Pass the command on to the separation valve after its delay."""
    coil = solenoid_valve.Coil(m.separate_on, m.separate_waiting)
    coil = solenoid_valve.delayed(coil, m.separate, par.ecu.T_s, par.separation)
    return m._replace(separate_on=coil.on, separate_waiting=coil.waiting)


def position_tick(r: Readings, m: Any, u: Stimulus, par: Any) -> Any:
    """Move the reference of the motor angle, and run position control once."""
    T, law = par.ecu.T_position, par.ecu.position
    if par.drive == "position":
        m = m._replace(theta_ref=u.theta_set)
    else:
        reference = plunger_pressure.State(m.theta_ref)
        law_p = par.ecu.pressure
        moved = plunger_pressure.advanced(reference, m.omega_ref, r.theta, T, law_p)
        m = m._replace(theta_ref=moved.theta_ref)
    state, out = position_pd.output(
        position_pd.State(m.theta_last, m.omega_meas),
        position_pd.Input(m.theta_ref, m.omega_ref, r.theta),
        T,
        law,
    )
    saturated = ops.where(ops.fabs(out.i) >= law.i_max, 1.0, 0.0)
    return m._replace(
        theta_last=state.last, omega_meas=state.speed, i_ref=out.i, sat_current=saturated
    )


def current_tick(r: Readings, m: Any, u: Stimulus, par: Any) -> Any:
    """Run current control once."""
    if par.drive == "current":
        m = m._replace(i_ref=u.i_set)
    limit = h_bridge.limited(par.ecu.current.D_max, par.bridge)
    state, out = current_pi.output(
        current_pi.State(m.pi_integral),
        current_pi.Input(i_ref=m.i_ref, i_meas=r.i, D_lim=limit),
        par.ecu.T_current,
        par.ecu.current,
    )
    saturated = ops.where(ops.fabs(out.duty) >= limit, 1.0, 0.0)
    return m._replace(duty=out.duty, sat_duty=saturated, pi_integral=state.integral)
