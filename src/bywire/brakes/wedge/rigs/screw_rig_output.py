"""What a recording of the two motors' rig holds, and how it follows from state and memory."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.brakes.wedge import drive_train
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs import screw_rig_plant as plant
from bywire.core.signals import Signal
from bywire.plant import shaft_encoder

Par = WedgeParameters


class Output(NamedTuple):
    """What a recording of the rig holds."""

    theta_1_ref: Annotated[float, Signal("rad", "angle reference 1", 3.0)]
    theta_2_ref: Annotated[float, Signal("rad", "angle reference 2", 3.0)]
    theta_1: Annotated[float, Signal("rad", "motor angle 1", 3.0)]
    theta_2: Annotated[float, Signal("rad", "motor angle 2", 3.0)]
    q_1: Annotated[float, Signal("rad", "angle shown by encoder 1", 3.0)]
    q_2: Annotated[float, Signal("rad", "angle shown by encoder 2", 3.0)]
    omega_1: Annotated[float, Signal("rad/s", "motor speed 1", 50.0)]
    omega_2: Annotated[float, Signal("rad/s", "motor speed 2", 50.0)]
    i_1_ref: Annotated[float, Signal("A", "current demand 1", 5.0)]
    i_2_ref: Annotated[float, Signal("A", "current demand 2", 5.0)]
    i_1: Annotated[float, Signal("A", "current 1", 5.0)]
    i_2: Annotated[float, Signal("A", "current 2", 5.0)]
    voltage_1: Annotated[float, Signal("V", "motor voltage 1", 10.0)]
    voltage_2: Annotated[float, Signal("V", "motor voltage 2", 10.0)]
    F: Annotated[float, Signal("N", "force on the sensor", 1000.0)]
    y_F: Annotated[float, Signal("N", "force shown by the sensor", 1000.0)]
    T_fr_1: Annotated[float, Signal("N*m", "friction torque 1", 0.1)]
    T_fr_2: Annotated[float, Signal("N*m", "friction torque 2", 0.1)]
    stuck: Annotated[float, Signal("1", "both shafts stuck")]
    P_el: Annotated[float, Signal("W", "electrical power", 50.0)]
    E_source: Annotated[float, Signal("J", "electrical energy into the motors")]
    E_copper: Annotated[float, Signal("J", "copper loss")]
    E_damping: Annotated[float, Signal("J", "damping of the motors")]
    E_shaft: Annotated[float, Signal("J", "friction of bearings and screws")]
    E_line: Annotated[float, Signal("J", "damping of screws and force sensor")]
    E_stored: Annotated[float, Signal("J", "stored energy")]
    t_stuck: Annotated[float, Signal("s", "time in which both shafts stick")]


def instant(
    x: plant.State,
    m: plant.Memory,
    par: Par,
    reaction: tuple[float, ...],
    flow: plant.Flow,
) -> Output:
    """Return what is recorded at an instant.

    Parameters
    ----------
    reaction
        Friction torques of both shafts in the last substep [N m].
    flow
        Integrals since the start.
    """
    both = plant.sides(x, x, m, par)
    own = {
        "q_1": shaft_encoder.reading(x.theta_1, par.encoder),
        "q_2": shaft_encoder.reading(x.theta_2, par.encoder),
        "voltage_1": drive_train.voltage(both[0], plant.ON, par),
        "voltage_2": drive_train.voltage(both[1], plant.ON, par),
        "F": plant.force(x, par),
        "T_fr_1": -reaction[0],
        "T_fr_2": -reaction[1],
        "stuck": plant.stuck(x),
        "P_el": plant.power(x, m, par),
        "E_source": flow.W_electric,
        "E_stored": plant.stored(x, m, par),
    }
    for part in (x, m, flow):
        own |= {k: v for k, v in part._asdict().items() if k in Output._fields}
    return Output(**own)
