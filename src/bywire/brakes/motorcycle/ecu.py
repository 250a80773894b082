"""Signal chain of the motorcycle's ECU: sensors and controllers at one sampling instant."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.control import current_pi, derating, dither, low_pass_2, pedal_map, pressure_pid
from bywire.core import ops
from bywire.core.signals import Limited, Signal
from bywire.plant import adc, current_sensor, h_bridge, pedal, pressure_sensor


class Stimulus(NamedTuple):
    """External inputs; ``drive.mode`` determines which of them act."""

    p_set: Annotated[float, Signal("Pa", "pressure demand", 2e6)]
    pedal_force: Annotated[float, Signal("N", "foot force", 100.0)]
    i_set: Annotated[float, Signal("A", "current demand", 5.0)]
    v_set: Annotated[float, Signal("V", "voltage demand", 5.0)]
    noise_p: Annotated[float, Signal("1", "noise of the pressure channel")]
    noise_i: Annotated[float, Signal("1", "noise of the current channel")]


class Memory(NamedTuple):
    """Memory of ECU and sources between sampling instants."""

    p_meas: Annotated[float, Signal("Pa", "measured pressure", 2e6)]
    i_meas: Annotated[float, Signal("A", "measured current", 5.0)]
    V_pedal: Annotated[float, Signal("V", "potentiometer voltage", 2.5)]
    p_ref: Annotated[float, Signal("Pa", "pressure set point", 2e6)]
    i_star: Annotated[float, Signal("A", "current demand", 5.0)]
    i_dit: Annotated[float, Signal("A", "dither current", 1.0)]
    i_ref: Annotated[float, Signal("A", "current set point", 5.0)]
    duty: Annotated[float, Signal("1", "duty cycle", 0.3), Limited("ecu.current.D_max")]
    v_source: Annotated[float, Signal("V", "source voltage", 5.0)]
    i_source: Annotated[float, Signal("A", "source current", 5.0)]
    sat_current: Annotated[float, Signal("1", "current demand saturated")]
    sat_duty: Annotated[float, Signal("1", "duty cycle saturated")]
    pid_integral: Annotated[float, Signal("A", "integral term of the pressure PID", 5.0)]
    pid_slope: Annotated[float, Signal("A", "derivative term of the pressure PID", 1.0)]
    pid_last: Annotated[float, Signal("Pa", "previous value of the differentiated signal", 2e6)]
    pi_integral: Annotated[float, Signal("1", "integral term of the current PI", 0.3)]
    lp_s1: Annotated[float, Signal("A", "low-pass state 1", 1.0)]
    lp_s2: Annotated[float, Signal("A", "low-pass state 2", 5.0)]
    dit_phase: Annotated[float, Signal("1", "dither phase", 0.5)]
    rise_winding: derating.Rise
    rise_housing: derating.Rise
    i_most: Annotated[float, Signal("A", "limit of the current demand", 20.0)]
    derated: Annotated[float, Signal("1", "motor derated")]


class Readings(NamedTuple):
    """Filtered sensor readings at the converter's inputs, as fractions of the spans."""

    p: Annotated[float, Signal("1", "pressure reading", 0.5)]
    i: Annotated[float, Signal("1", "current reading", 0.5)]


def tick(readings: Readings, m: Memory, u: Stimulus, par: MotorcycleParameters) -> Memory:
    """Run the ECU once: conversion, pressure control if the mode includes it, current control."""
    p_share = adc.sample(readings.p, u.noise_p, par.adc)
    i_share = adc.sample(readings.i, u.noise_i, par.adc)
    p_before = m.p_meas
    m = _derated(m._replace(**_values(p_share, i_share, par)), par)
    if par.drive.mode == "current-direct":
        m = m._replace(i_star=u.i_set, i_dit=0.0, i_ref=u.i_set)
    else:
        m = _shaped(_demand(m, p_before, u, par), par)
    if par.ecu.derating.law != "off":
        m = m._replace(i_ref=ops.clip(m.i_ref, -m.i_most, m.i_most))
    limit = h_bridge.limited(par.ecu.current.D_max, par.bridge)
    pi, out = current_pi.output(
        current_pi.State(m.pi_integral),
        current_pi.Input(i_ref=m.i_ref, i_meas=m.i_meas, D_lim=limit),
        par.ecu.T_s,
        par.ecu.current,
    )
    saturated = ops.where(ops.fabs(out.duty) >= limit, 1.0, 0.0)
    return m._replace(duty=out.duty, sat_duty=saturated, pi_integral=pi.integral)


def source_tick(readings: Readings, m: Memory, u: Stimulus, par: MotorcycleParameters) -> Memory:
    """Hold the value of an ideal source and the converter readings.

    Only the recording uses the readings, and ``shown`` rounds them. Rounding within the tick would
    interrupt derivatives, as it does in a closed loop.
    """
    p_share = adc.noisy(readings.p, u.noise_p, par.adc)
    i_share = adc.noisy(readings.i, u.noise_i, par.adc)
    m = m._replace(**_values(p_share, i_share, par))
    if par.drive.mode == "voltage-source":
        return m._replace(v_source=u.v_set)
    return m._replace(i_source=u.i_set, i_ref=u.i_set)


def shown(m: Memory, par: MotorcycleParameters) -> dict[str, float]:
    """Return the measurements after the converters, in all modes."""
    if par.drive.mode not in ("voltage-source", "current-source") or par.adc.law == "ideal":
        return {"p_meas": m.p_meas, "i_meas": m.i_meas}
    p = pressure_sensor.reading(m.p_meas + par.ecu.p_atm, par.pressure_sensor)
    i = current_sensor.reading(m.i_meas, par.current_sensor)
    return _values(adc.rounded(p, par.adc), adc.rounded(i, par.adc), par)


def _values(p: float, i: float, par: MotorcycleParameters) -> dict[str, float]:
    """Return the measurements from fractions of the sensor spans."""
    return {
        "p_meas": pressure_sensor.value(p, par.pressure_sensor) - par.ecu.p_atm,
        "i_meas": current_sensor.value(i, par.current_sensor),
    }


def _derated(m: Memory, par: MotorcycleParameters) -> Memory:
    """Return the memory with the current limit for the motor's temperature."""
    if par.ecu.derating.law == "off":
        return m
    x, out = derating.output(
        derating.State(m.rise_winding, m.rise_housing),
        derating.Input(m.i_meas, par.ecu.pressure.i_max),
        par.ecu.T_s,
        par.ecu.derating,
    )
    return m._replace(
        rise_winding=x.winding, rise_housing=x.housing, i_most=out.i_max, derated=out.derated
    )


def _demand(m: Memory, p_before: float, u: Stimulus, par: MotorcycleParameters) -> Memory:
    """Return the memory with a new unfiltered current demand.

    ``p_before``: pressure at the last tick, for a bumpless change of the scheduled gains.
    """
    if par.drive.mode == "current":
        return m._replace(i_star=u.i_set)
    p_ref = u.p_set
    if par.drive.mode == "pedal":
        V_pedal = pedal.output(pedal.Input(force=u.pedal_force), par.pedal).V
        p_ref = pedal_map.output(V_pedal, par.ecu.pedal_map)
        m = m._replace(V_pedal=V_pedal)
    state = pressure_pid.State(m.pid_integral, m.pid_slope, m.pid_last)
    signals = pressure_pid.Input(p_ref=p_ref, p_meas=m.p_meas)
    scheduled = par.ecu.pressure_at(m.p_meas)
    if par.ecu.derating.law != "off":  # a lower limit; symbols could not be validated
        limited = {**dict(scheduled), "i_max": m.i_most}
        scheduled = pressure_pid.Parameters.model_construct(**limited)
    if par.ecu.schedule.law != "off":
        last = par.ecu.pressure_at(p_before)
        state = pressure_pid.transferred(state, signals, last.k_p, scheduled)
    pid, out = pressure_pid.output(state, signals, par.ecu.T_s, scheduled)
    saturated = ops.where(ops.fabs(out.i) >= scheduled.i_max, 1.0, 0.0)
    return m._replace(
        p_ref=p_ref,
        i_star=out.i,
        sat_current=saturated,
        pid_integral=pid.integral,
        pid_slope=pid.slope,
        pid_last=pid.last,
    )


def _shaped(m: Memory, par: MotorcycleParameters) -> Memory:
    """Return the memory after dither and low-pass filter."""
    ecu = par.ecu
    dit, wave = dither.output(dither.State(m.dit_phase), m.p_meas, ecu.T_s, ecu.dither, ecu.est_par)
    filter_first = ecu.filter.place == "before-dither"
    low, filtered = low_pass_2.output(
        low_pass_2.State(m.lp_s1, m.lp_s2),
        m.i_star if filter_first else m.i_star + wave.i,
        ecu.T_s,
        ecu.filter,
    )
    return m._replace(
        i_dit=wave.i,
        i_ref=filtered.y + wave.i if filter_first else filtered.y,
        dit_phase=dit.phase,
        lp_s1=low.s1,
        lp_s2=low.s2,
    )
