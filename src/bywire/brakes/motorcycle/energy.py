"""Energy book-keeping of the motorcycle brake: powers between elements, stored energy."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.brakes.motorcycle.ecu import Memory
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.plant import (
    State,
    cylinder_input,
    port_input,
    stop_input,
    wires,
)
from bywire.core import ops
from bywire.core.signals import Signal
from bywire.plant import (
    ball_screw_gear,
    battery_supply,
    brake_fluid,
    caliper,
    dc_motor,
    end_stop,
    master_cylinder,
    pipeline,
    reservoir_port,
    seal_friction,
)

Par = MotorcycleParameters


class Flow(NamedTuple):
    """Integrals over the run."""

    E_source: Annotated[float, Signal("J", "energy from battery or source")]
    E_supply: Annotated[float, Signal("J", "loss in the supply's resistance")]
    E_copper: Annotated[float, Signal("J", "copper loss")]
    E_gear: Annotated[float, Signal("J", "loss of gear and screw, signed")]
    E_seal: Annotated[float, Signal("J", "loss of the seals' friction")]
    E_damping: Annotated[float, Signal("J", "loss of the fluid's damping")]
    E_pipeline: Annotated[float, Signal("J", "loss in the pipeline")]
    W_stop: Annotated[float, Signal("J", "work on the end stops")]
    E_port: Annotated[float, Signal("J", "energy out through the reservoir port")]
    W_shaft: Annotated[float, Signal("J", "work of the motor on the gear")]
    t_stuck: Annotated[float, Signal("s", "time stuck")]


def rates(
    x: State,
    rate: State,
    m: Memory,
    par: Par,
    contact: tuple[float, ...],
    reaction: tuple[float, ...],
) -> Flow:
    """Return the powers at the midpoint of a substep, and 1 while the shaft is stuck."""
    w = wires(x, m, par, contact)
    friction, makeup = reaction
    gear, seal = _dry_losses(x, par, friction)
    shaft = ball_screw_gear.State(x.theta, x.omega)
    gear = gear + ball_screw_gear.transmission_loss(shaft, w.torque, rate.omega, par.gear)
    supply = battery_supply.Input(i_dc=w.i_dc)
    port = reservoir_port.power_loss(port_input(x, par), par.port, par.fluid)
    ideal = par.drive.mode in ("voltage-source", "current-source")
    source = w.voltage * w.current if ideal else battery_supply.power_source(supply, par.supply)
    return Flow(
        E_source=source,
        E_supply=battery_supply.power_loss(supply, par.supply),
        E_copper=dc_motor.power_loss(dc_motor.State(w.current), par.motor),
        E_gear=gear,
        E_seal=seal,
        E_damping=master_cylinder.power_loss(cylinder_input(x, w.q, par), par.master_cylinder),
        E_pipeline=pipeline.power_loss(pipeline.Input(x.p_mc, x.p_pd), par.pipeline, par.fluid),
        W_stop=end_stop.load(end_stop.Forces(*contact)) * w.v_mc,
        E_port=port - brake_fluid.convected_power(makeup, x.p_mc, par.fluid),
        W_shaft=w.torque * x.omega,
        t_stuck=ops.where(x.omega == 0, 1.0, 0.0),
    )


def stored(x: State, par: Par) -> float:
    """Return the energy stored in winding, drive train, fluid, pads and end stops [J]."""
    cylinder = cylinder_input(x, 0.0, par)
    return (
        dc_motor.energy(dc_motor.State(x.i), par.motor)
        + ball_screw_gear.energy(ball_screw_gear.State(x.theta, x.omega), par.gear)
        + master_cylinder.energy(
            master_cylinder.State(x.p_mc), cylinder, par.master_cylinder, par.fluid
        )
        + caliper.energy(caliper.State(x.p_pd), par.caliper, par.fluid)
        + end_stop.energy(stop_input(x, par), par.stop)
    )


def _dry_losses(x: State, par: Par, friction: float) -> tuple[float, float]:
    """Return the powers lost in the gear's and in the seals' dry friction.

    What the seals can take at this speed is theirs, the rest is the gear's.
    """
    total = -friction * x.omega
    if par.gear.law == "paper":
        return 0.0 * total, total
    seal = seal_friction.output(seal_friction.Input(x.omega, x.p_mc), par.seal)
    most = ops.where(x.omega > 0, seal.T_p, seal.T_n) * ops.fabs(x.omega)
    loss = ops.fmin(most, total)
    return total - loss, loss
