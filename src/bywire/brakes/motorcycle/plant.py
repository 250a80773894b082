"""Wiring of the motorcycle brake's plant: which element feeds which, at one instant."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.brakes.motorcycle.ecu import Memory
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.core.signals import Signal
from bywire.plant import (
    ball_screw_gear,
    battery_supply,
    dc_motor,
    end_stop,
    h_bridge,
    master_cylinder,
    pipeline,
    reservoir_port,
)

Par = MotorcycleParameters


class State(NamedTuple):
    """Continuous states of plant and anti-alias filters."""

    i: Annotated[float, Signal("A", "motor current", 5.0)]
    theta: Annotated[float, Signal("rad", "motor angle", 20.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 20.0)]
    p_mc: Annotated[float, Signal("Pa", "master-cylinder pressure", 2e6)]
    p_pd: Annotated[float, Signal("Pa", "caliper pressure", 2e6)]
    y_p: Annotated[float, Signal("1", "filtered pressure reading", 0.5)]
    y_i: Annotated[float, Signal("1", "filtered current reading", 0.5)]


class Wires(NamedTuple):
    """What the elements exchange."""

    current: Annotated[float, Signal("A", "motor current", 5.0)]
    voltage: Annotated[float, Signal("V", "motor voltage", 5.0)]
    i_dc: Annotated[float, Signal("A", "battery current", 2.0)]
    torque: Annotated[float, Signal("N*m", "motor torque", 0.1)]
    x_mc: Annotated[float, Signal("m", "piston travel", 7e-3)]
    v_mc: Annotated[float, Signal("m/s", "piston speed", 0.01)]
    q: Annotated[float, Signal("m**3/s", "flow toward the caliper", 1e-6)]
    Re: Annotated[float, Signal("1", "Reynolds number", 10.0)]
    force: Annotated[float, Signal("N", "load on the piston", 200.0)]


def wires(x: State, m: Memory, par: Par, contact: tuple[float, ...]) -> Wires:
    """Return what flows between the elements.

    Parameters
    ----------
    contact
        Forces of the near and the far end stop [N].
    """
    current, voltage, i_dc = _electrics(x, m, par)
    piston = ball_screw_gear.output(ball_screw_gear.State(x.theta, x.omega), par.gear)
    flow = pipeline.output(pipeline.Input(x.p_mc, x.p_pd), par.pipeline, par.fluid)
    load = master_cylinder.output(
        master_cylinder.State(x.p_mc), cylinder_input(x, flow.q, par), par.master_cylinder
    )
    return Wires(
        current=current,
        voltage=voltage,
        i_dc=i_dc,
        torque=dc_motor.output(dc_motor.State(current), par.motor).torque,
        x_mc=piston.x,
        v_mc=piston.v,
        q=flow.q,
        Re=flow.Re,
        force=load.force + end_stop.load(end_stop.Forces(*contact)),
    )


def cylinder_input(x: State, q: float, par: Par) -> master_cylinder.Input:
    """Return the master cylinder's input for an outflow q [m^3/s]."""
    piston = ball_screw_gear.output(ball_screw_gear.State(x.theta, x.omega), par.gear)
    return master_cylinder.Input(x=piston.x, v=piston.v, q=q)


def stop_input(x: State, par: Par) -> end_stop.Input:
    """Return the end stops' input."""
    piston = ball_screw_gear.output(ball_screw_gear.State(x.theta, x.omega), par.gear)
    cylinder = par.master_cylinder
    return end_stop.Input(x=piston.x, v=piston.v, x_rest=cylinder.x_rest, x_end=cylinder.x_end)


def port_input(x: State, par: Par) -> reservoir_port.Input:
    """Return the reservoir port's input: its stroke counts from the retracted end."""
    travel = ball_screw_gear.output(ball_screw_gear.State(x.theta, x.omega), par.gear).x
    return reservoir_port.Input(x=travel - par.master_cylinder.x_rest, p=x.p_mc)


def port_conductance(xe: State, par: Par) -> float:
    """Return the conductance of the reservoir port [m^3/(s Pa)]."""
    return reservoir_port.output(port_input(xe, par), par.port).G


def _electrics(x: State, m: Memory, par: Par) -> tuple[float, float, float]:
    """Return motor current, motor voltage and battery current of the drive mode."""
    if par.drive.mode == "current-source":
        # The winding's state stays at rest; the source supplies what the voltage balance needs.
        voltage = par.motor.R_m * m.i_source + par.motor.K_e * x.omega
        return m.i_source, voltage, 0.0 * m.i_source
    if par.drive.mode == "voltage-source":
        return x.i, m.v_source, 0.0 * x.i
    bus = battery_supply.output(battery_supply.Input(i_dc=m.duty * x.i), par.supply)
    bridge = h_bridge.output(h_bridge.Input(duty=m.duty, v_bus=bus.v_bus, i=x.i))
    return x.i, bridge.v, bridge.i_dc
