"""What a recording of the wedge brake holds, and how it follows from state and memory."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.brakes.wedge import drive_train
from bywire.brakes.wedge.control import Memory
from bywire.brakes.wedge.energy import Flow, elastic, stored
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.plant import State, Wires, motor_power, sides, wires
from bywire.core import ops
from bywire.core.signals import Signal
from bywire.plant import drive_supply

Par = WedgeParameters


class Output(NamedTuple):
    """What a recording of the wedge brake holds."""

    M_set: Annotated[float, Signal("N*m", "moment demand", 300.0)]
    M_B: Annotated[float, Signal("N*m", "braking moment", 300.0)]
    y_M: Annotated[float, Signal("N*m", "moment shown by the sensor", 300.0)]
    mode: Annotated[float, Signal("1", "mode: 0 parked, 1 gap, 2 moment, 3 retracting")]
    rate: Annotated[float, Signal("rad/s", "speed of the reference", 50.0)]
    sat_rate: Annotated[float, Signal("1", "software rate limit reached")]
    theta_c: Annotated[float, Signal("rad", "contact position, estimated", 1.7)]
    theta_ref: Annotated[float, Signal("rad", "common angle reference", 3.0)]
    theta_1_ref: Annotated[float, Signal("rad", "angle reference 1", 3.0)]
    theta_2_ref: Annotated[float, Signal("rad", "angle reference 2", 3.0)]
    theta_1: Annotated[float, Signal("rad", "motor angle 1", 3.0)]
    theta_2: Annotated[float, Signal("rad", "motor angle 2", 3.0)]
    omega_1: Annotated[float, Signal("rad/s", "motor speed 1", 50.0)]
    omega_2: Annotated[float, Signal("rad/s", "motor speed 2", 50.0)]
    i_1_ref: Annotated[float, Signal("A", "current demand 1", 5.0)]
    i_2_ref: Annotated[float, Signal("A", "current demand 2", 5.0)]
    i_1: Annotated[float, Signal("A", "current 1", 5.0)]
    i_2: Annotated[float, Signal("A", "current 2", 5.0)]
    voltage_1: Annotated[float, Signal("V", "motor voltage 1", 10.0)]
    voltage_2: Annotated[float, Signal("V", "motor voltage 2", 10.0)]
    x: Annotated[float, Signal("m", "wedge travel", 1e-3)]
    v: Annotated[float, Signal("m/s", "wedge velocity", 0.02)]
    f_1: Annotated[float, Signal("N", "force screw 1 - wedge", 400.0)]
    f_2: Annotated[float, Signal("N", "force screw 2 - wedge", 400.0)]
    f_12: Annotated[float, Signal("N", "force screw 1 - screw 2", 400.0)]
    F_M: Annotated[float, Signal("N", "actuation force", 400.0)]
    F_N: Annotated[float, Signal("N", "normal force", 3e3)]
    F_end: Annotated[float, Signal("N", "load of the end stops", 100.0)]
    T_fr_1: Annotated[float, Signal("N*m", "friction torque 1", 0.1)]
    T_fr_2: Annotated[float, Signal("N*m", "friction torque 2", 0.1)]
    F_fr: Annotated[float, Signal("N", "friction on the wedge", 50.0)]
    Omega: Annotated[float, Signal("rad/s", "disc speed", 60.0)]
    phi: Annotated[float, Signal("rad", "disc angle", 10.0)]
    contacts: Annotated[float, Signal("1", "contacts of the heart: 1, 2, 4 added", 4.0)]
    stuck: Annotated[float, Signal("1", "shafts and wedge stuck")]
    P_in: Annotated[float, Signal("W", "power at the drives' input", 50.0)]
    P_meas: Annotated[float, Signal("W", "power at the drives' input, filtered", 50.0)]
    E_source: Annotated[float, Signal("J", "energy in: electrical, disc on wedge, run-out")]
    E_copper: Annotated[float, Signal("J", "copper loss")]
    E_damping: Annotated[float, Signal("J", "damping of the motors")]
    E_shaft: Annotated[float, Signal("J", "friction of bearings and screws")]
    E_wedge: Annotated[float, Signal("J", "friction on the wedge")]
    E_heart: Annotated[float, Signal("J", "loss in the heart's contacts, less its energy at start")]
    E_caliper: Annotated[float, Signal("J", "loss in the caliper, less its energy at start")]
    E_stop: Annotated[float, Signal("J", "loss in the end stops, less their energy at start")]
    E_stored: Annotated[float, Signal("J", "stored energy")]
    U_caliper: Annotated[float, Signal("J", "energy of the caliper")]
    W_supply: Annotated[float, Signal("J", "energy at the drives' input, standby included")]
    W_electric: Annotated[float, Signal("J", "electrical energy into the motors")]
    W_disc: Annotated[float, Signal("J", "work of the disc on the wedge")]
    W_runout: Annotated[float, Signal("J", "work of the run-out on the caliper")]
    W_brake: Annotated[float, Signal("J", "energy taken from the disc")]
    t_stuck: Annotated[float, Signal("s", "time in which shafts and wedge stick")]


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
        Forces of the contacts [N]; friction torques of the shafts [N m], friction on the wedge
        [N], moment on the disc [N m], all of the last substep.
    flow
        Integrals since the start.
    """
    w = wires(x, par, contact)
    both = sides(x, x, m, par)
    held = elastic(x, par)
    power = drive_supply.power(motor_power(x, m, par), par.supply)
    still = ops.fabs(x.omega_1) + ops.fabs(x.omega_2)
    still = ops.where(still == 0, 1.0, 0.0) * ops.where(x.v == 0, 1.0, 0.0)
    own = {
        "voltage_1": drive_train.voltage(both[0], m.on, par),
        "voltage_2": drive_train.voltage(both[1], m.on, par),
        "T_fr_1": -reaction[0],
        "T_fr_2": -reaction[1],
        "F_fr": -reaction[2],
        "F_end": w.F_stop,
        "contacts": _contact_number(contact),
        "stuck": still,
        "P_in": power,
        "P_meas": x.y_P,
        "E_source": flow.W_electric + flow.W_disc + flow.W_runout,
        "E_heart": flow.W_heart - held.heart,
        "E_caliper": flow.W_caliper - held.caliper,
        "E_stop": flow.W_stop - held.stop,
        "E_stored": stored(x, m, par),
        "U_caliper": held.caliper,
        "f_1": contact[0],
        "f_2": contact[1],
        "f_12": contact[2],
    }
    return Output(**(_direct(x, m, w, flow) | own))


def _direct(x: State, m: Memory, w: Wires, flow: Flow) -> dict[str, float]:
    """Return what is recorded as it stands."""
    found: dict[str, float] = {}
    for part in (x, m, w, flow):
        found |= {k: v for k, v in part._asdict().items() if k in Output._fields}
    return found


def _contact_number(contact: tuple[float, ...]) -> float:
    bits = (1.0, 2.0, 4.0)
    return sum(
        (bit * ops.where(f > 0, 1.0, 0.0) for bit, f in zip(bits, contact, strict=False)), 0.0
    )
