"""Control loops of the wedge brake and its rigs: moment, position, force, current."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, cast

from bywire.analysis.loop import Loop, Point, Quantity, Saturation
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.laws import moment_control
from bywire.brakes.wedge.model import WedgeBrake, force_for, memory_at, state_at, travel_for
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.screw_rig import ScrewRig, screws_compliance
from bywire.brakes.wedge.rigs.shaft_rig import ShaftRig
from bywire.core import ops
from bywire.core.errors import InputError, not_valid
from bywire.core.parameters import ParameterSet
from bywire.core.signals import zeros
from bywire.plant import current_drive, force_sensor, roller_screw, servo_motor

Causes = Mapping[str, Mapping[str, Any]]
"""causes of nonlinearity: name -> parameters that remove it"""

_SCREWS: Causes = {
    "bearing friction": {
        "bearing.C_0": 0.0,
        "bearing.C_1": 0.0,
        "bearing.C_2": 0.0,
        "bearing.T_nu": 0.0,
    },
    "screw efficiency": {"screw.eta_f": 1.0, "screw.eta_b": 1.0},
}
_MOTORS: Causes = {
    "cogging": {"motor_1.T_cog": 0.0, "motor_2.T_cog": 0.0},
    "encoder": {"encoder.law": "ideal"},
}

_DRIVE_TRAIN: Causes = {**_SCREWS, **_MOTORS}
"""causes in motors and screws on a rig"""

_CAUSES: Causes = {
    **_SCREWS,
    "wedge friction": {"wedge_friction.mu_int": 0.0, "wedge_friction.mu_R": 0.0},
    **_MOTORS,
    "run-out, disc slowing": {"flywheel.runout": 0.0, "flywheel.law": "driven"},
}
"""causes in the whole brake"""

_DRIVE_LIMITS = (
    Saturation("sat_current", ("i_1_ref", "i_2_ref"), ("control.position.i_max", "drive.i_max")),
)
"""a drive's current demand at the controller's or the drive's limit"""


def beyond(name: str, value: str, need: str, limit: str) -> InputError:
    """Build the error for an operating point that exceeds a limit.

    Parameters
    ----------
    name, value
        Quantity that defines the operating point, and its value with its unit.
    need
        Amount that the brake would need, with its unit.
    limit
        Parameter that limits this amount, with its value.
    """
    return not_valid(name, value, f"small enough for {limit}", f"but needs {need}")


# --- Moment loop, around position and current loops

MOMENT = Quantity("moment", "N*m", 200.0)
COUNTED = " (a braking moment is positive in either direction of rotation)"
"""remark on a moment that is not positive"""


def moment_point(par: ParameterSet, value: float) -> Point:
    """Return the brake that holds a moment [N m].

    Screws and references are at the wedge's equilibrium: the actuation force loads both contacts of
    the brake heart, and the currents hold it.

    Raises
    ------
    ParameterError
        If the moment is not positive, if it exceeds the wedge's travel or the drives' current, or
        if the disc is at rest.

    Notes
    -----
    The wedge is on the side of the disc's direction of rotation, where the moment is positive.
    """
    closed = cast(WedgeParameters, par.replace({"command.mode": "moment"}))
    _require_braking(value, closed)
    x = travel_for(force_for(value, closed), closed)
    _require_travel_and_current(value, x, closed)
    turning = ops.where(closed.flywheel.Omega_0 < 0, -1.0, 1.0)
    x *= turning
    memory = memory_at(x, closed)._replace(mode=moment_control.MOMENT, M_set=value, M_meas=value)
    state = state_at(x, closed)._replace(y_M=turning * value)
    return Point(
        WedgeBrake(), closed, state, memory, zeros(WedgeBrake.Stimulus)._replace(M_set=value)
    )


def _require_braking(value: float, par: WedgeParameters) -> None:
    MOMENT.require_positive(value, COUNTED)
    if not ops.is_symbol(par.flywheel.Omega_0) and par.flywheel.Omega_0 == 0.0:
        speed, advice = "the speed at which the loop works", "because a disc at rest has no moment"
        raise not_valid("flywheel.Omega_0", "0 rad/s", speed, advice)


def _require_travel_and_current(value: float, x: float, par: WedgeParameters) -> None:
    if ops.is_symbol(x):
        return
    moment = f"{value:g} N*m"
    if not x < par.wedge.x_stop:
        limit = f"wedge.x_stop = {par.wedge.x_stop * 1e3:g} mm"
        raise beyond("moment", moment, f"{x * 1e3:.3g} mm of wedge travel", limit)
    force = abs(wedge.slope(par.wedge) - par.wedge.mu_B) * force_for(value, par)
    i = 0.5 * force * roller_screw.slope(par.screw) / par.motor_1.K_ref
    if i > par.drive.i_max:
        needed = f"{i:.3g} A in each motor even without friction"
        raise beyond("moment", moment, needed, f"drive.i_max = {par.drive.i_max:g} A")


MOMENT_LOOP = Loop(
    name="moment",
    assembly="wedge-brake",
    summary="moment control at 1 kHz around position control at 5 kHz",
    at=MOMENT,
    inputs=("M_set",),
    output="y_M",
    cut="rate",
    point=moment_point,
    causes=_CAUSES,
    band=(0.5, 100.0),
    amplitudes=(0.5, 20.0),
    # The law depends only on f_c/slope_hat, so the design varies only one of the two.
    tunables={"control.moment.f_c": (0.3, 60.0)},
    sustained=_CAUSES["run-out, disc slowing"],
    proof="moment-pulses",
    saturations=_DRIVE_LIMITS,
)


# --- Position loop of the assembled wedge

_BAND = (1.0, 150.0)
"""frequencies [Hz]"""

_TUNABLES: Mapping[str, tuple[float, float]] = {
    "control.position.f_n": (2.0, 200.0),
    "control.position.zeta": (0.2, 4.0),
    "control.position.c": (0.0, 1.0),
}
"""gains of the law -> search range"""


def _two_motor_loop(
    name: str,
    summary: str,
    at: Quantity,
    point: Callable[[ParameterSet, float], Point],
    causes: Mapping[str, Mapping[str, Any]],
    proof: str = "",
) -> Loop:
    """Return the position loop of two motors that follow one reference and share a load.

    ``name``, ``summary``, ``at``, ``position_point``, ``causes``, ``proof``: see `Loop`.
    """
    return Loop(
        name=name,
        assembly="wedge-brake",
        summary=summary,
        at=at,
        inputs=("theta_1_set", "theta_2_set"),
        output="theta_2",
        cut="i_2_ref",
        point=point,
        causes=causes,
        band=_BAND,
        amplitudes=(1e-3, 0.25, 0.5, 1.0),
        tunables=_TUNABLES,
        proof=proof,
        saturations=_DRIVE_LIMITS,
        single=False,  # two motors share the load
    )


def position_point(par: ParameterSet, value: float) -> Point:
    """Return the wedge at a travel [m] within the clearance, preloaded between the screws.

    Raises
    ------
    ParameterError
        If the pads would touch the disc.
    """
    closed = cast(WedgeParameters, par.replace({"command.mode": "position"}))
    free = min(travel_for(0.0, closed), closed.wedge.x_stop)
    if not abs(value) < free:
        valid = f"between {-free * 1e3:.3g} and {free * 1e3:.3g} mm"
        raise not_valid("wedge travel", f"{value * 1e3:g} mm", valid, "within the clearance")
    memory = memory_at(value, closed)
    stimulus = zeros(WedgeBrake.Stimulus)._replace(
        theta_1_set=memory.theta_1_ref, theta_2_set=memory.theta_2_ref
    )
    return Point(WedgeBrake(), closed, state_at(value, closed), memory, stimulus)


POSITION_LOOP = _two_motor_loop(
    name="position",
    summary="position control of the assembled wedge within its clearance, at 5 kHz",
    at=Quantity("wedge travel", "m", 0.0),
    point=position_point,
    causes=_CAUSES,
)


# --- Position loop of one motor on a preloaded screw (Figs. 5 and 6)

_ONE_MOTOR = {**_DRIVE_TRAIN, "cogging": {"motor_1.T_cog": 0.0}}


def screw_position_point(par: ParameterSet, value: float) -> Point:
    """Return the shaft at rest at an angle [rad]."""
    rig = cast(
        WedgeParameters,
        par.replace({"rig.mode_1": "position", "rig.load": "screw", "rig.clamp": "open"}),
    )
    state = zeros(ShaftRig.State)._replace(theta_1=value)
    memory = zeros(ShaftRig.Memory)._replace(theta_1_ref=value, last_1=value)
    return Point(
        ShaftRig(), rig, state, memory, zeros(ShaftRig.Stimulus)._replace(theta_1_set=value)
    )


SCREW_POSITION_LOOP = Loop(
    name="screw-position",
    assembly="wedge-brake",
    summary="position control of one motor on a preloaded screw, at 5 kHz (Figs. 5 and 6 of "
    "Roberts et al.)",
    at=Quantity("motor angle", "rad", 0.0),
    inputs=("theta_1_set",),
    output="theta_1",
    cut="i_1_ref",
    point=screw_position_point,
    causes=_ONE_MOTOR,
    band=_BAND,
    amplitudes=(1e-3, 0.25, 0.5, 1.0, 2.0),
    tunables=_TUNABLES,
    proof="screw-position",
)


# --- Two motors that push their screws against a force sensor


def force_point(par: ParameterSet, value: float) -> Point:
    """Return both motors in position control, at rest with a force [N] between their screws.

    Each nut is half the compression away from the middle. The controllers have no integral term, so
    the references are farther away, by the angle errors that produce the holding currents.

    Raises
    ------
    ParameterError
        If the drives cannot hold the force.
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
        _require_force(value, abs(demand), rig)
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


def _require_force(value: float, demand: float, par: WedgeParameters) -> None:
    if ops.is_symbol(demand):
        return
    limits = {"control.position.i_max": par.control.position.i_max, "drive.i_max": par.drive.i_max}
    name, most = min(limits.items(), key=lambda limit: limit[1])
    if not demand < most:
        needed = f"{demand:.3g} A even without friction"
        raise beyond("force", f"{value:g} N", needed, f"{name} = {most:g} A")


_FORCE = Quantity("force", "N", 0.0)

FORCE_FIGHT = _two_motor_loop(
    name="force-fight",
    summary="position control of two motors with a common reference, pushing on a force sensor, "
    "at 5 kHz",
    at=_FORCE,
    point=force_point,
    causes=_DRIVE_TRAIN,
    proof="force-fight",
)

FORCE_AGAINST = Loop(
    name="force-against",
    assembly="wedge-brake",
    summary="force between two motors, one excited while the other holds, at 5 kHz",
    at=_FORCE,
    inputs=("theta_1_set",),
    output="F",
    cut="i_1_ref",
    point=force_point,
    causes=_DRIVE_TRAIN,
    band=_BAND,
    amplitudes=(1e-3, 0.05, 0.1, 0.2),
    tunables=_TUNABLES,
    saturations=_DRIVE_LIMITS,
    single=False,  # the output is the force, but the angle is controlled
)


# --- Current loop of the drives, with a clamped shaft

_SAMPLE = 20e-6  # sample time of the demand [s]; the analog drive itself does not sample
_STEP = 5e-6  # substep [s]


def current_point(par: ParameterSet, value: float) -> Point:
    """Return the drive that holds a current [A] in a motor whose shaft is clamped.

    Raises
    ------
    ParameterError
        If the current exceeds the drive's limit, its voltage the supply, or its torque the clamp.
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
    _require_current(value, clamped)
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


def _require_current(value: float, par: WedgeParameters) -> None:
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
            needed, limit = f"{need:.4g} {unit}", f"{name} = {most:g} {unit}"
            raise beyond("current", f"{value:g} A", needed, limit)


DRIVE_CURRENT_LOOP = Loop(
    name="drive-current",
    assembly="wedge-brake",
    summary="analog current control in the drive, with a clamped shaft",
    at=Quantity("current", "A", 0.0),
    inputs=("i_1_set",),
    output="i_1",
    cut="sensed_1",
    point=current_point,
    causes={},
    band=(10.0, 3000.0),
    amplitudes=(1e-2, 1.0, 5.0),
    tunables={"drive.k_p": (1e-3, 1.0), "drive.k_i": (1.0, 5e3)},
    proof="current-loop",
    single=False,
    analog=True,
    locked=("theta_1", "omega_1"),
)
