"""Current loop of the wedge brake's drives: analog, the shaft clamped as in the paper's test."""

from __future__ import annotations

from typing import cast

from bywire.analysis.loop import Loop, Point, Quantity
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.shaft_rig import ShaftRig
from bywire.core import ops
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros
from bywire.plant import current_drive, servo_motor

_SAMPLE = 20e-6  # of the demand [s], which an analog drive takes as it comes
_STEP = 5e-6  # substep [s]


def point(par: ParameterSet, value: float) -> Point:
    """Return the drive that holds a current [A] in a motor whose shaft is clamped.

    Raises
    ------
    ParameterError
        When the current is beyond the drive's limit, its voltage beyond the supply, or its
        torque beyond the clamp.
    """
    clamped = cast(
        WedgeParameters,
        par.replace(
            {
                "rig.mode_1": "current",
                "rig.load": "dummy",
                "rig.clamp": "closed",
                "control.T_fast": _SAMPLE,
            }
        ),
    )
    _require_reachable(value, clamped)
    drive, motor = clamped.drive, clamped.motor_1
    held = value / drive.G_sense
    duty = servo_motor.resistance(motor) * held / drive.V_dc
    state = ShaftRig.state(
        drive=current_drive.State(demand=value, sensed=value, integral=duty),
        motor=servo_motor.State(i=held, theta=0.0, omega=0.0),
    )
    memory = zeros(ShaftRig.Memory)._replace(i_1_ref=value)
    stimulus = zeros(ShaftRig.Stimulus)._replace(i_1_set=value)
    return Point(ShaftRig(), clamped, state, memory, stimulus, _STEP)


def _require_reachable(value: float, par: WedgeParameters) -> None:
    if ops.is_symbol(par.drive.V_dc):
        return
    drive, motor = par.drive, par.motor_1
    held = abs(value) / drive.G_sense
    torque = servo_motor.torque_constant(motor) * held
    limits = (
        ("drive.i_max", abs(value), drive.i_max, "A"),
        ("drive.V_dc", servo_motor.resistance(motor) * held, drive.V_dc, "V"),
        ("rig.T_clamp", torque, par.rig.T_clamp, "N*m"),
    )
    for name, need, most, unit in limits:
        if not need < most:
            raise ParameterError(
                f"current = {value:g} A needs {need:.4g} {unit}: it must be below {name} = "
                f"{most:g} {unit}; ask for less"
            )


LOOP = Loop(
    name="drive-current",
    assembly="wedge-brake",
    summary="current control in the drive, analog, shaft clamped",
    at=Quantity("current", "A", 0.0),
    inputs=("i_1_set",),
    output="i_1",
    cut="sensed_1",
    point=point,
    causes={},
    band=(10.0, 3000.0),
    amplitudes=(1e-2, 1.0, 5.0),
    tunables={"drive.k_p": (1e-3, 1.0), "drive.k_i": (1.0, 5e3)},
    proof="current-loop",
    single=False,
    analog=True,
    locked=("theta_1", "omega_1"),
)
