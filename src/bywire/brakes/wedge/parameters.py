"""Parameters of the wedge brake and its rigs: groups for the elements and the controllers."""

from __future__ import annotations

from typing import Literal

from pydantic import model_validator

from bywire.brakes.wedge.elements import brake_heart, wedge, wedge_caliper, wedge_friction
from bywire.brakes.wedge.laws import gap_adjusting, moment_control, screw_offset
from bywire.control import derating, position_pd
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Duration, Force, Inertia, Torque
from bywire.core.units import shown
from bywire.plant import (
    axial_bearing,
    clearance_adjuster,
    current_drive,
    drive_supply,
    end_stop,
    flywheel,
    force_sensor,
    moment_sensor,
    motor_heat,
    roller_screw,
    servo_motor,
    shaft_encoder,
)


class RigParameters(ParameterSet):
    """Fixtures and operating modes of the rigs. The assembled brake does not have them."""

    mode_1: Literal["position", "current"]
    """quantity of motor 1 that the operator commands"""
    mode_2: Literal["position", "current"]
    """quantity of motor 2 that the operator commands"""
    load: Literal["dummy", "screw"]
    """load on a single motor: a solid dummy shaft, or a preloaded screw"""
    clamp: Literal["open", "closed"]
    """whether a single motor's shaft is clamped"""
    J_dummy: Inertia
    """inertia of the dummy shaft"""
    F_0: Force
    """preload between the two halves of a single screw's nut"""
    T_clamp: Torque
    """torque at which the clamp slips"""
    sensor: force_sensor.Parameters


# --- The brake


class CommandParameters(ParameterSet):
    """Quantity that the stimulus commands.

    ``moment`` closes moment and position loops. ``position`` sends each position loop its
    reference. ``current`` sends each drive its current demand.
    """

    mode: Literal["moment", "position", "current"]
    """quantity that the stimulus commands"""


class ControlParameters(ParameterSet):
    """Sample times and controllers of the real-time computer."""

    T_fast: Duration
    """sample time of position control"""
    T_slow: Duration
    """sample time of moment control"""
    position: position_pd.Parameters
    derating: derating.Parameters
    offset: screw_offset.Parameters
    moment: moment_control.Parameters
    adjuster: gap_adjusting.Parameters


class WedgeParameters(ParameterSet):
    """The whole wedge brake. Its two motors may differ; drives, screws and bearings are equal."""

    supply: drive_supply.Parameters
    drive: current_drive.Parameters
    motor_1: servo_motor.Parameters
    motor_2: servo_motor.Parameters
    motor_heat: motor_heat.Parameters
    screw: roller_screw.Parameters
    bearing: axial_bearing.Parameters
    heart: brake_heart.Parameters
    wedge: wedge.Parameters
    wedge_friction: wedge_friction.Parameters
    stop: end_stop.Parameters
    caliper: wedge_caliper.Parameters
    adjuster: clearance_adjuster.Parameters
    flywheel: flywheel.Parameters
    moment_sensor: moment_sensor.Parameters
    encoder: shaft_encoder.Parameters
    control: ControlParameters
    command: CommandParameters
    rig: RigParameters

    @model_validator(mode="after")
    def _follows_the_adjuster(self) -> WedgeParameters:
        T, slow = self.control.adjuster.T_adjust, self.control.T_slow
        if self.adjuster.law != "none" and abs(T / slow - round(T / slow)) > 1e-6:
            raise RuleError(
                "control.adjuster.T_adjust",
                shown(T, "s"),
                f"a whole multiple of control.T_slow = {shown(slow, 's')}",
                "because the moment control follows the adjuster's turns",
            )
        return self
