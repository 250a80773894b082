"""A synchronous motor with a DC link, inverter and field-oriented control turns a flywheel."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from bywire.authoring import (
    Assembly,
    Duration,
    Integral,
    ParameterSet,
    Part,
    Role,
    Signal,
    Task,
    Wire,
    zeros,
)
from bywire.control import field_oriented
from bywire.plant import dc_link, inverter, motor_heat, pmsm, shaft
from bywire.simulation.run import Run

T_S = 1e-4


class Parameters(ParameterSet):
    """All parameters."""

    link: dc_link.Parameters
    inverter: inverter.Parameters
    motor: pmsm.Parameters
    heat: motor_heat.Parameters
    shaft: shaft.Parameters
    current: field_oriented.Parameters
    T_s: Duration


class Memory(NamedTuple):
    """Voltages relative to the bus voltage, acting and next, and the state of the control."""

    alpha: Annotated[float, Signal("1", "share along alpha", 0.3)]
    beta: Annotated[float, Signal("1", "share along beta", 0.3)]
    next_alpha: Annotated[float, Signal("1", "next share along alpha", 0.3)]
    next_beta: Annotated[float, Signal("1", "next share along beta", 0.3)]
    load: Annotated[float, Signal("N*m", "load", 0.1)]
    z_d: Annotated[float, Signal("V", "integral part", 1.0)]
    z_q: Annotated[float, Signal("V", "integral part", 1.0)]
    i_fw: Annotated[float, Signal("A", "field-weakening current", 1.0)]


class Stimulus(NamedTuple):
    """Demands."""

    i_set: Annotated[float, Signal("A", "current demand", 5.0)]
    load_set: Annotated[float, Signal("N*m", "load", 0.1)]


class PmsmDrive(Assembly[Parameters, Memory]):
    """The iron's hysteresis is the one dry friction of the shaft."""

    name: ClassVar[str] = "pmsm-drive"
    Memory: ClassVar[Any] = Memory
    Stimulus: ClassVar[Any] = Stimulus
    frictions: ClassVar[tuple[str, ...]] = ("omega",)

    E_source = Integral("J", "energy of the battery", role=Role("source", "battery"))
    E_load = Integral("J", "energy to the load", role=Role("sink", "load", returns="any"))
    E_iron = Integral("J", "eddy currents", role=Role("sink", "iron"))
    E_hysteresis = Integral("J", "hysteresis of the iron", role=Role("sink", "hysteresis"))
    link = Part(dc_link, loss={"E_supply": "supply_loss", "E_chopper": "chopper_loss"})
    inverter = Part(inverter, loss="E_inverter")
    motor = Part(pmsm, loss="E_copper")
    heat = Part(motor_heat, loss="E_air")
    E_heat = Integral("J", "heat of the copper", role=motor_heat.COPPER)
    shaft = Part(shaft, loss="E_damping")

    i_dc = Wire("A", "bus current", 5.0)
    v_bus = Wire("V", "bus voltage", 24.0)
    v_d = Wire("V", "voltage along the magnets", 5.0)
    v_q = Wire("V", "voltage across the magnets", 5.0)
    torque = Wire("N*m", "torque", 0.3)
    records: ClassVar[tuple[str, ...]] = (
        *("i_d", "i_q", "theta", "omega", "v_d", "v_q", "v_bus", "i_dc", "torque"),
        *("T_winding", "T_housing", "i_fw", "E_source", "E_load", "E_iron", "E_hysteresis"),
        *("E_supply", "E_chopper", "E_inverter", "E_copper", "E_damping", "E_stored"),
    )

    def wire(self, w):
        """Connect the parts."""
        warm = motor_heat.warmth(w.heat.x, w.heat.par)
        w.motor.vary(R=w.motor.par.R * warm.R, psi=w.motor.par.psi * warm.K)
        i, theta_e = w.motor.x, w.motor.par.p * w.shaft.xe.theta
        shares = w.m.alpha, w.m.beta
        w.i_dc = inverter.bus_current(*shares, i.i_d, i.i_q, theta_e, w.inverter.par)
        w.link.u = dc_link.Input(w.i_dc)
        w.v_bus = w.link.x.v
        demands = w.v_bus * w.m.alpha, w.v_bus * w.m.beta
        w.inverter.u = inverter.Input(*demands, i.i_d, i.i_q, theta_e, w.v_bus)
        out = inverter.output(w.inverter.u, w.inverter.par)
        w.v_d, w.v_q = out.v_d, out.v_q
        w.motor.u = pmsm.Input(w.v_d, w.v_q, w.shaft.x.omega)
        w.heat.u = motor_heat.Input(pmsm.power_loss(i, w.motor.par))
        w.torque = pmsm.output(i, w.shaft.x.omega, w.motor.par).torque
        w.shaft.u = shaft.Input(w.torque - w.m.load, 0.0)

    def friction(self, w):
        """Return the bounds of the iron's hysteresis."""
        T_h = pmsm.output(w.motor.x, w.shaft.x.omega, w.motor.par).T_h
        return ((-T_h, T_h),)

    def power(self, w):
        """Return the powers that do not follow from the parts."""
        omega = w.shaft.x.omega
        return {
            "E_source": dc_link.power_source(w.link.x, w.link.par),
            "E_load": w.m.load * omega,
            "E_iron": pmsm.iron_loss(w.motor.x, omega, w.motor.par),
            "E_hysteresis": -w.reaction[0] * omega,
            "E_heat": w.heat.u.P,
        }

    def tasks(self, par):
        """Return the current control."""
        return (Task("current", par.T_s, tick),)


def tick(x, m, u, par):
    """Apply the voltages of the last tick, and compute the next ones."""
    theta_e = par.motor.p * x.theta
    i_alpha, i_beta = inverter.rotated(x.i_d, x.i_q, -theta_e)
    V_dc = x.v
    state, out = field_oriented.output(
        field_oriented.State(m.z_d, m.z_q, m.i_fw),
        field_oriented.Input(u.i_set, i_alpha, i_beta, theta_e, x.omega, V_dc, par.current.i_max),
        par.T_s,
        par.current,
    )
    return Memory(
        m.next_alpha,
        m.next_beta,
        out.v_alpha / V_dc,
        out.v_beta / V_dc,
        u.load_set,
        *state,
    )


SERVO = {"p": 4.0, "R": 0.36, "L_d": 0.2e-3, "L_q": 0.2e-3, "psi": 6.395e-3}
"""Teknic M-2310P, as in examples of MathWorks' Motor Control Blockset"""
NO_MAP = {f"map.{name}": () for name in ("i_d", "i_q", "psi_d", "psi_q")}
MOTOR = {"law": "linear", "iron": "off", "c_h": 0.0, "c_e": 0.0} | NO_MAP | SERVO
STAGE = {"law": "ideal", "f_s": 10e3, "t_d": 1e-6, "V_f": 0.0, "i_th": 0.05}
HEAT = {
    "law": "off",
    "C_w": 15.0,
    "C_h": 150.0,
    "G_wh": 1 / 3,
    "G_ha": 0.5,
    "a_R": 0.00393,
    "a_K": 0.001,
    "T_ref": 293.15,
    "T_a": 293.15,
    "T_most": 428.15,
}
LINK = {
    "law": "battery",
    "V_s": 24.0,
    "R_s": 0.05,
    "C": 2e-3,
    "chopper": "off",
    "V_on": 30.0,
    "R_on": 1.0,
    "V_most": 35.0,
}
CURRENT = {
    "omega_c": 1 / (3 * T_S),
    "R_a": 0.0,
    "p": 4.0,
    "R_hat": SERVO["R"],
    "L_d_hat": SERVO["L_d"],
    "L_q_hat": SERVO["L_q"],
    "psi_hat": SERVO["psi"],
    "lead": 1.5,
    "i_max": 20.0,
    "voltage": "circle",
    "k_fw": 0.0,
    "reserve": 0.95,
}


def parameters(**changes):
    """Return the drive with a servo motor; changes by dotted name with ``__`` for the dot."""
    values = {"T_s": T_S}
    groups = {
        "link": LINK,
        "inverter": STAGE | {"gates": 1.0, "i_off": 0.5},
        "motor": MOTOR,
        "heat": HEAT,
        "shaft": {"J": 7.06e-6, "d": 0.0},
        "current": CURRENT,
    }
    for group, fields in groups.items():
        values |= {f"{group}.{name}": value for name, value in fields.items()}
    return Parameters.create(values | {k.replace("__", "."): v for k, v in changes.items()})


def turning(omega, par, theta=0.0):
    """Return state and memory of a shaft that turns without current: the voltage is the emf."""
    state = PmsmDrive.state(
        link=dc_link.State(par.link.V_s),
        motor=pmsm.State(0.0, 0.0),
        heat=motor_heat.cold(par.heat),
        shaft=shaft.State(theta, omega),
    )
    share = par.motor.p * omega * par.motor.psi / par.link.V_s
    omega_e, T = par.motor.p * omega, par.T_s
    angle = par.motor.p * theta + np.pi / 2.0
    held = [angle + omega_e * T * middle for middle in (-0.5, 0.5)]
    now, following = ((share * np.cos(a), share * np.sin(a)) for a in held)
    return state, zeros(Memory)._replace(
        alpha=now[0],
        beta=now[1],
        next_alpha=following[0],
        next_beta=following[1],
    )


def run(par, i_set=0.0, load=0.0, omega=0.0, duration=0.02, step=1e-5, record=1e-4, **more):
    """Return a run of the drive, with demands that are numbers or functions of time."""
    state, memory = turning(omega, par)

    def stimulus(t):
        rows = [f(t) if callable(f) else np.full(t.size, f) for f in (i_set, load)]
        return np.column_stack(rows)

    return Run(PmsmDrive(), par, state, memory, stimulus, duration, step, record, **more)
