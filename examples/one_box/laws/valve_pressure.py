"""Pressure of a wheel by an inlet and an outlet valve that switch, without a pressure sensor."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from annotated_types import Gt
from pydantic import Field

from bywire.authoring import Duration, ParameterSet, Pressure, Signal, Unit
from bywire.core import ops
from bywire.plant import stiffening_caliper

FlowCoefficient = Annotated[float, Unit("m**3/(s*Pa**0.5)", 5e-9), Field(gt=0, allow_inf_nan=False)]
PumpFlow = Annotated[float, Unit("m**3/s", 3e-6), Field(gt=0, allow_inf_nan=False)]
SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
GaugePressure = Annotated[float, Signal("Pa", "pressure", 2e6)]
Drop = Annotated[float, Signal("Pa", "pressure drop", 2e6)]
Slope = Annotated[float, Signal("Pa/s", "pressure gradient", 1e8)]
Flag = Annotated[float, Signal("1", "flag")]


class Parameters(ParameterSet):
    """Valves, caliper and pump as the ECU assumes them."""

    K_in: FlowCoefficient
    """flow coefficient of the inlet valve"""
    K_out: FlowCoefficient
    """flow coefficient of the outlet valve"""
    p_cr: Pressure
    """pressure drop at the transition to laminar flow"""
    caliper: stiffening_caliper.Parameters
    """volume of the caliper"""
    p_low: Pressure
    """pressure of the accumulator"""
    t_least: Duration
    """minimum time between two switchings of the valves"""
    q_pump: PumpFlow
    """flow of the return pump"""


class State(NamedTuple):
    """Expected pressure, switched valves, and volume in the accumulator."""

    p_hat: Annotated[float, Signal("Pa", "wheel pressure expected by the ECU", 2e6)]
    building: Annotated[float, Signal("1", "inlet valve commanded open")]
    dumping: Annotated[float, Signal("1", "outlet valve commanded open")]
    since: Annotated[float, Signal("s", "time since the valves switched", 0.1)]
    V_hat: Annotated[float, Signal("m**3", "accumulator volume expected by the ECU", 1e-6)]


class Input(NamedTuple):
    """Wheel pressure demand, plunger pressure, and whether anti-lock control is active."""

    p_ref: GaugePressure
    p: GaugePressure
    active: Flag


class Output(NamedTuple):
    """Currents of the two valves and of the pump's relay, 0 or 1."""

    close: Annotated[float, Signal("1", "inlet valve energized")]
    release: Annotated[float, Signal("1", "outlet valve energized")]
    pump: Annotated[float, Signal("1", "return pump on")]


class Gradients(NamedTuple):
    """Rates at which an open valve raises or lowers the pressure, >= 0."""

    up: Slope
    down: Slope


def root(drop: Drop, par: Parameters) -> Annotated[float, Signal("Pa**0.5", "root", 1e3)]:
    """Return the square root of a drop, which is linear near zero like an orifice."""
    positive = ops.fmax(drop, 0.0)
    return positive / ops.sqrt(ops.sqrt(positive * positive + par.p_cr * par.p_cr))


def gradients(p_hat: GaugePressure, p: GaugePressure, par: Parameters) -> Gradients:
    r"""Return both gradients, :math:`\dot p = K \sqrt{\Delta p} / C(\hat p)`."""
    C = stiffening_caliper.mass(stiffening_caliper.State(ops.fmax(p_hat, 0.0)), par.caliper)
    return Gradients(
        up=par.K_in * root(p - p_hat, par) / C,
        down=par.K_out * root(p_hat - par.p_low, par) / C,
    )


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    """Advance the controller by one sample.

    Notes
    -----
    The expected pressure reacts to commands at once, although the valves lag. It is therefore the
    pressure that remains when all valves have followed. A valve switches if the pressure then comes
    closer to the demand than without. The check valve across the inlet keeps the wheel's pressure
    below that of the plunger, so the expectation is correct again after each full build-up.
    """
    slope = gradients(x.p_hat, u.p, par)
    moved = x.p_hat + T * (x.building * slope.up - x.dumping * slope.down)
    p_hat = ops.fmax(ops.fmin(moved, u.p), 0.0)
    drained = par.K_out * root(x.p_hat - par.p_low, par) * x.dumping
    V_hat = ops.fmax(x.V_hat + T * (drained - par.q_pump), 0.0)
    slope = gradients(p_hat, u.p, par)
    error = u.p_ref - p_hat
    # A pulse begins if its shortest form brings the pressure closer, and goes on by samples.
    least = ops.fmax(par.t_least, T)
    rise = 0.5 * ops.where(x.building > 0.5, T, least) * slope.up
    fall = 0.5 * ops.where(x.dumping > 0.5, T, least) * slope.down
    build = ops.where(error > rise, 1.0, 0.0)
    dump = ops.where(-error > fall, 1.0, 0.0)
    kept = ops.where(x.since + 0.5 * T < par.t_least, 1.0, 0.0)
    build = ops.where(kept > 0.5, x.building, build)
    dump = ops.where(kept > 0.5, x.dumping, dump)
    build = ops.where(u.active > 0.5, build, 1.0)
    dump = ops.where(u.active > 0.5, dump, 0.0)
    switched = ops.fabs(build - x.building) + ops.fabs(dump - x.dumping)
    since = ops.where(switched > 0.5, 0.0, x.since) + T
    pump = ops.where(V_hat > 0.0, 1.0, u.active)
    return State(p_hat, build, dump, since, V_hat), Output(1.0 - build, dump, pump)
