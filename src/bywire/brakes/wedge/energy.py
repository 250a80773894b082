"""Energy book-keeping of the wedge brake: powers between elements, stored energy."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.brakes.wedge.control import Memory
from bywire.brakes.wedge.elements import brake_heart, wedge, wedge_caliper
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.plant import (
    HEART,
    State,
    caliper_input,
    heart_input,
    motor_power,
    sides,
    stop_input,
    wedge_input,
    wires,
)
from bywire.core import ops
from bywire.core.signals import Signal
from bywire.plant import drive_supply, end_stop, servo_motor

Par = WedgeParameters


class Flow(NamedTuple):
    """Integrals over the run."""

    W_supply: Annotated[float, Signal("J", "energy at the drives' input, standby included")]
    W_electric: Annotated[float, Signal("J", "electrical energy into the motors")]
    W_disc: Annotated[float, Signal("J", "work of the disc on the wedge")]
    W_runout: Annotated[float, Signal("J", "work of the run-out on the caliper")]
    W_brake: Annotated[float, Signal("J", "energy taken from the disc")]
    E_copper: Annotated[float, Signal("J", "copper loss")]
    E_damping: Annotated[float, Signal("J", "damping of the motors")]
    E_shaft: Annotated[float, Signal("J", "friction of bearings and screws")]
    E_wedge: Annotated[float, Signal("J", "friction on the wedge")]
    W_heart: Annotated[float, Signal("J", "work on the heart's contacts")]
    W_caliper: Annotated[float, Signal("J", "work on the caliper")]
    W_stop: Annotated[float, Signal("J", "work on the end stops")]
    t_stuck: Annotated[float, Signal("s", "time in which shafts and wedge stick")]


class Elastic(NamedTuple):
    """Energies of the contacts."""

    heart: Annotated[float, Signal("J", "energy of the heart's contacts")]
    caliper: Annotated[float, Signal("J", "energy of the caliper")]
    stop: Annotated[float, Signal("J", "energy of the end stops")]


def rates(
    x: State,
    xe: State,
    m: Memory,
    par: Par,
    contact: tuple[float, ...],
    reaction: tuple[float, ...],
) -> Flow:
    """Return the powers at the midpoint of a substep; sides and run-out as in the balance."""
    w = wires(xe, par, contact)
    both = sides(x, x, m, par)
    friction_1, friction_2, friction_w, moment = reaction
    motors = motor_power(x, m, par)
    body = wedge.State(x.x, x.v)
    caliper = caliper_input(x, xe, par)
    stuck = ops.where(ops.fabs(x.omega_1) + ops.fabs(x.omega_2) == 0, 1.0, 0.0)
    return Flow(
        W_supply=drive_supply.power(motors, par.supply),
        W_electric=motors,
        W_disc=wedge.pad_power(body, wedge_input(w, friction_w), par.wedge),
        W_runout=w.F_N * caliper.runout_rate,
        W_brake=-moment * x.Omega,
        E_copper=sum((servo_motor.copper_loss(s.motor, s.par) for s in both), 0.0),
        E_damping=sum((servo_motor.damping_loss(s.motor, s.par) for s in both), 0.0),
        E_shaft=-(friction_1 * x.omega_1 + friction_2 * x.omega_2),
        E_wedge=-friction_w * x.v,
        W_heart=brake_heart.power_in(heart_input(x, par), brake_heart.Forces(*contact[:HEART])),
        W_caliper=wedge_caliper.power_in(caliper, wedge_caliper.Forces(w.F_N)),
        W_stop=w.F_stop * x.v,
        t_stuck=stuck * ops.where(x.v == 0, 1.0, 0.0),
    )


def elastic(x: State, par: Par) -> Elastic:
    """Return the energies of heart, caliper and end stops."""
    return Elastic(
        heart=brake_heart.energy(heart_input(x, par), par.heart),
        caliper=wedge_caliper.energy(caliper_input(x, x, par), par.caliper),
        stop=end_stop.energy(stop_input(x, par), par.stop),
    )


def stored(x: State, m: Memory, par: Par) -> float:
    """Return the energy stored in windings, rotors, cogging, wedge and contacts [J]."""
    motors = (servo_motor.energy(s.motor, s.par) for s in sides(x, x, m, par))
    body = wedge.energy(wedge.State(x.x, x.v), par.wedge)
    return sum(motors, 0.0) + body + sum(elastic(x, par), 0.0)
