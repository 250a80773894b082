"""Operating points of the rig on which two motors push their screws against a force sensor."""

from __future__ import annotations

import math
from typing import cast

from bywire.analysis.loop import Point
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs import screw_rig_plant as plant
from bywire.brakes.wedge.rigs.screw_rig import ScrewRig
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros
from bywire.plant import force_sensor, roller_screw, servo_motor


def point(par: ParameterSet, value: float) -> Point:
    """Return both motors in position control, at rest with a force [N] between their screws.

    Both stand half the compression off the middle. The controllers have no integral part: the
    references lie further off, by what the holding currents need.

    Raises
    ------
    ParameterError
        When the drives cannot hold the force.
    """
    own = cast(
        WedgeParameters, par.replace({"rig.mode_1": "position", "rig.mode_2": "position"})
    )
    k = roller_screw.slope(own.screw)
    rest = plant.line(zeros(plant.State), own)
    theta = 0.5 * value / (force_sensor.stiffness(rest, own.rig.sensor) * k)
    state: dict[str, float] = {"y_F": value}
    memory: dict[str, float] = {}
    stimulus: dict[str, float] = {}
    for n, sign, motor in ((1, 1.0, own.motor_1), (2, -1.0, own.motor_2)):
        i = sign * k * value / servo_motor.torque_constant(motor)
        demand = own.drive.G_sense * i
        reference = sign * theta + demand / _stiffness(own)
        _require_reachable(value, abs(demand), own)
        state |= {
            f"demand_{n}": demand, f"sensed_{n}": demand, f"i_{n}": i, f"theta_{n}": sign * theta,
            f"integral_{n}": servo_motor.resistance(motor) * i / own.drive.V_dc,
        }  # fmt: skip
        memory |= {f"theta_{n}_ref": reference, f"last_{n}": sign * theta, f"i_{n}_ref": demand}
        stimulus |= {f"theta_{n}_set": reference}
    return Point(
        ScrewRig(), own, zeros(plant.State)._replace(**state),
        zeros(plant.Memory)._replace(**memory), zeros(plant.Stimulus)._replace(**stimulus),
    )  # fmt: skip


def _stiffness(par: WedgeParameters) -> float:
    """Return the current demand per angle error [A/rad] of the position control."""
    control = par.control.position
    return control.J_hat / control.K_hat * (2.0 * math.pi * control.f_n) ** 2


def _require_reachable(value: float, demand: float, par: WedgeParameters) -> None:
    limits = {"control.position.i_max": par.control.position.i_max, "drive.i_max": par.drive.i_max}
    name, most = min(limits.items(), key=lambda one: one[1])
    if not demand < most:
        raise ParameterError(
            f"force = {value:g} N needs {demand:.3g} A even without friction: it must be below "
            f"{name} = {most:g} A; ask for less"
        )
