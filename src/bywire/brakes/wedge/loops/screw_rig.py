"""Loops on the rig on which two motors push their screws against a force sensor."""

from __future__ import annotations

import math
from typing import cast

from bywire.analysis.loop import Loop, Point, Quantity
from bywire.brakes.wedge.loops.causes import DRIVE_LIMITS, DRIVE_TRAIN
from bywire.brakes.wedge.loops.position import BAND, TUNABLES, two_motor_loop
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.screw_rig import ScrewRig, screws_compliance
from bywire.core import ops
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
    rig = cast(WedgeParameters, par.replace({"rig.mode_1": "position", "rig.mode_2": "position"}))
    k = roller_screw.slope(rig.screw)
    rest = zeros(force_sensor.Input)._replace(c=screws_compliance(rig))
    theta = 0.5 * value / (force_sensor.stiffness(rest, rig.rig.sensor) * k)
    state: dict[str, float] = {"y_F": value}
    memory: dict[str, float] = {}
    stimulus: dict[str, float] = {}
    for n, sign, motor in ((1, 1.0, rig.motor_1), (2, -1.0, rig.motor_2)):
        i = sign * k * value / servo_motor.torque_constant(motor)
        demand = rig.drive.G_sense * i
        reference = sign * theta + demand / _stiffness(rig)
        _require_reachable(value, abs(demand), rig)
        state |= {
            f"demand_{n}": demand,
            f"sensed_{n}": demand,
            f"i_{n}": i,
            f"theta_{n}": sign * theta,
            f"integral_{n}": servo_motor.resistance(motor) * i / rig.drive.V_dc,
        }
        memory |= {f"theta_{n}_ref": reference, f"last_{n}": sign * theta, f"i_{n}_ref": demand}
        stimulus |= {f"theta_{n}_set": reference}
    return Point(
        ScrewRig(),
        rig,
        zeros(ScrewRig.State)._replace(**state),
        zeros(ScrewRig.Memory)._replace(**memory),
        zeros(ScrewRig.Stimulus)._replace(**stimulus),
    )


def _stiffness(par: WedgeParameters) -> float:
    """Return the current demand per angle error [A/rad] of the position control."""
    control = par.control.position
    return control.J_hat / control.K_hat * (2.0 * math.pi * control.f_n) ** 2


def _require_reachable(value: float, demand: float, par: WedgeParameters) -> None:
    if ops.is_symbol(demand):
        return
    limits = {"control.position.i_max": par.control.position.i_max, "drive.i_max": par.drive.i_max}
    name, most = min(limits.items(), key=lambda limit: limit[1])
    if not demand < most:
        raise ParameterError(
            f"force = {value:g} N needs {demand:.3g} A even without friction: it must be below "
            f"{name} = {most:g} A; ask for less"
        )


_FORCE = Quantity("force", "N", 0.0)

FORCE_FIGHT = two_motor_loop(
    name="force-fight",
    summary="position control of two motors on one reference, a force sensor between, 5 kHz",
    at=_FORCE,
    point=point,
    causes=DRIVE_TRAIN,
    proof="force-fight",
)

FORCE_AGAINST = Loop(
    name="force-against",
    assembly="wedge-brake",
    summary="force between two motors, one shaken against the other that holds, 5 kHz",
    at=_FORCE,
    inputs=("theta_1_set",),
    output="F",
    cut="i_1_ref",
    point=point,
    causes=DRIVE_TRAIN,
    band=BAND,
    amplitudes=(1e-3, 0.05, 0.1, 0.2),
    tunables=TUNABLES,
    saturations=DRIVE_LIMITS,
    single=False,  # the force answers, the angle is controlled
)
