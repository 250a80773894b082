"""What a recording of the motorcycle brake holds, and how it follows from state and memory."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.brakes.motorcycle.ecu import Memory, shown
from bywire.brakes.motorcycle.energy import Flow, stored
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.plant import State, Wires, stop_input, wires
from bywire.core import ops
from bywire.core.signals import Signal
from bywire.plant import ball_screw_gear, end_stop, seal_friction

Par = MotorcycleParameters


class Output(NamedTuple):
    """What a recording of the motorcycle brake holds."""

    i: Annotated[float, Signal("A", "motor current", 5.0)]
    i_ref: Annotated[float, Signal("A", "current set point", 5.0)]
    i_star: Annotated[float, Signal("A", "current demand", 5.0)]
    i_dit: Annotated[float, Signal("A", "dither current", 1.0)]
    i_meas: Annotated[float, Signal("A", "measured current", 5.0)]
    duty: Annotated[float, Signal("1", "duty cycle", 0.3)]
    voltage: Annotated[float, Signal("V", "motor voltage", 5.0)]
    theta: Annotated[float, Signal("rad", "motor angle", 20.0)]
    omega: Annotated[float, Signal("rad/s", "motor speed", 20.0)]
    x_mc: Annotated[float, Signal("m", "piston travel", 7e-3)]
    p_mc: Annotated[float, Signal("Pa", "master-cylinder pressure", 2e6)]
    p_pd: Annotated[float, Signal("Pa", "caliper pressure", 2e6)]
    p_ref: Annotated[float, Signal("Pa", "pressure set point", 2e6)]
    p_meas: Annotated[float, Signal("Pa", "measured pressure", 2e6)]
    V_pedal: Annotated[float, Signal("V", "potentiometer voltage", 2.5)]
    q: Annotated[float, Signal("m**3/s", "flow toward the caliper", 1e-6)]
    Re: Annotated[float, Signal("1", "Reynolds number", 10.0)]
    torque: Annotated[float, Signal("N*m", "motor torque", 0.1)]
    T_fr: Annotated[float, Signal("N*m", "friction torque", 0.05)]
    F_stop: Annotated[float, Signal("N", "end-stop load on the piston", 100.0)]
    q_makeup: Annotated[float, Signal("m**3/s", "makeup flow from the reservoir", 1e-6)]
    stuck: Annotated[float, Signal("1", "shaft stuck")]
    at_stop: Annotated[float, Signal("1", "piston at an end stop")]
    sat_current: Annotated[float, Signal("1", "current demand saturated")]
    sat_duty: Annotated[float, Signal("1", "duty cycle saturated")]
    P_gear: Annotated[float, Signal("W", "gear loss power, signed")]
    P_el: Annotated[float, Signal("W", "electrical power from battery or source", 10.0)]
    E_source: Annotated[float, Signal("J", "energy from battery or source")]
    E_supply: Annotated[float, Signal("J", "loss in the supply's resistance")]
    E_copper: Annotated[float, Signal("J", "copper loss")]
    E_gear: Annotated[float, Signal("J", "loss of gear and screw, signed")]
    E_seal: Annotated[float, Signal("J", "loss of the seals' friction")]
    E_damping: Annotated[float, Signal("J", "loss of the fluid's damping")]
    E_pipeline: Annotated[float, Signal("J", "loss in the pipeline")]
    E_stop: Annotated[float, Signal("J", "loss in the end stops, for runs that start free of them")]
    E_port: Annotated[float, Signal("J", "energy out through the reservoir port")]
    E_stored: Annotated[float, Signal("J", "stored energy")]
    W_shaft: Annotated[float, Signal("J", "work of the motor on the gear")]
    t_stuck: Annotated[float, Signal("s", "time stuck")]


def instant(
    x: State,
    m: Memory,
    par: Par,
    contact: tuple[float, ...],
    reaction: tuple[float, ...],
    flow: Flow,
) -> Output:
    """Return what is recorded at an instant.

    Parameters
    ----------
    contact, reaction
        Forces of the end stops [N]; friction torque [N m] and makeup flow [m^3/s], all of the
        last substep.
    flow
        Integrals since the start.
    """
    w = wires(x, m, par, contact)
    friction, makeup = reaction
    torque = ball_screw_gear.Input(w.torque, w.force, friction)
    shaft = ball_screw_gear.State(x.theta, x.omega)
    acceleration = ball_screw_gear.balance(shaft, torque, par.gear).omega
    acceleration = acceleration / ball_screw_gear.inertia(par.gear)
    ideal = par.drive.mode in ("voltage-source", "current-source")
    P_el = w.voltage * w.current if ideal else par.supply.V_bat * w.i_dc
    F_stop = end_stop.load(end_stop.Forces(*contact))
    direct = {name: getattr(m, name) for name in Memory._fields if name in Output._fields}
    direct |= shown(m, par)
    return Output(
        **direct,
        **{name: value for name, value in flow._asdict().items() if name != "W_stop"},
        E_stop=flow.W_stop - end_stop.energy(stop_input(x, par), par.stop),
        i=w.current,
        voltage=w.voltage,
        theta=x.theta,
        omega=x.omega,
        x_mc=w.x_mc,
        p_mc=x.p_mc,
        p_pd=x.p_pd,
        q=w.q,
        Re=w.Re,
        torque=w.torque,
        T_fr=-friction,
        F_stop=F_stop,
        q_makeup=makeup,
        stuck=ops.where(x.omega == 0, 1.0, 0.0),
        at_stop=ops.where(F_stop == 0, 0.0, 1.0),
        P_gear=_gear_power(shaft, w, acceleration, friction, x, par),
        P_el=P_el,
        E_stored=stored(x, par),
    )


def _gear_power(
    shaft: ball_screw_gear.State, w: Wires, acceleration: float, friction: float, x: State, par: Par
) -> float:
    if par.gear.law == "paper":
        return ball_screw_gear.transmission_loss(shaft, w.torque, acceleration, par.gear)
    seal = seal_friction.output(seal_friction.Input(x.omega, x.p_mc), par.seal)
    applying = x.omega > 0
    return -friction * x.omega - ops.where(applying, seal.T_p, seal.T_n) * ops.fabs(x.omega)
