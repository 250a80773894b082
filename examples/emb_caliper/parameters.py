"""Parameters of the brake: one group per element, and a separate group for the ECU."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from bywire.authoring import Duration, ParameterSet, TorqueConstant, Unit
from bywire.control import (
    clamp_force_estimator,
    clamp_force_training,
    current_pi,
    field_oriented,
)
from bywire.plant import (
    adc,
    angle_sensor,
    battery_supply,
    current_sensor,
    dc_motor,
    end_stop,
    floating_caliper,
    h_bridge,
    inverter,
    pad_hysteresis,
    pmsm,
)
from emb_caliper.elements import (
    ball_screw,
    load_cell,
    load_friction,
    planetary_gear,
    rotor,
)
from emb_caliper.laws import force_monitor, limited_pi

Force = Annotated[float, Unit("N", 1e4), Field(gt=0, allow_inf_nan=False)]
Position = Annotated[float, Unit("m", 1e-3), Field(allow_inf_nan=False)]
PerTime = Annotated[float, Unit("1/s", 30.0), Field(gt=0, allow_inf_nan=False)]

DriveMode = Literal["force", "speed", "current", "voltage"]


class StopParameters(end_stop.Parameters):
    """Positions and stiffness of the piston's end stops."""

    x_rest: Position
    """piston travel at the retracted stop"""
    x_end: Position
    """piston travel at the extended stop"""

    @model_validator(mode="after")
    def _leaves_a_stroke(self) -> StopParameters:
        if not self.x_rest < 0.0 < self.x_end:
            raise ValueError(
                f"x_rest = {self.x_rest:g} m must be < 0 m, where the piston parks, and "
                f"x_end = {self.x_end:g} m must be > 0 m"
            )
        return self


class CascadeParameters(ParameterSet):
    """Sample times, force and speed control of the ECU, and its model of the brake.

    ``scheduling``: ``"stiffness"`` divides the gains of the force controller by the expected
    stiffness at the piston travel, relative to the stiffness at first contact. ``load``:
    ``"fed-forward"`` adds the current that the force needs without friction. ``feedback``: the
    force that the ECU controls. With ``"fallback"``, the estimate replaces a load cell that
    disagrees with it.
    """

    T_force: Duration
    """sample time of force and speed control"""
    T_current: Duration
    """sample time of current control"""
    F_on: Force
    """force demand below which the ECU parks the piston, clear of the disc"""
    k_park: PerTime
    """gain of the position control for parking"""
    scheduling: Literal["off", "stiffness"]
    """whether the gains of the force controller follow the stiffness"""
    load: Literal["off", "fed-forward"]
    """whether feed-forward adds the current that holds the force"""
    feedback: Literal["sensor", "fallback", "estimate"]
    """source of the clamp force for control"""
    estimation: Literal["off", "on"]
    """whether the ECU estimates the clamp force"""
    K_t_hat: TorqueConstant
    """torque per current"""
    force: limited_pi.ForceParameters
    speed: limited_pi.SpeedParameters
    estimator: clamp_force_estimator.Parameters
    training: clamp_force_training.Parameters
    monitor: force_monitor.Parameters

    @model_validator(mode="after")
    def _samples_fit(self) -> CascadeParameters:
        ratio = self.T_force / self.T_current
        if ratio < 1.0 or abs(ratio - round(ratio)) > 1e-9:
            raise ValueError(
                f"T_current = {1e3 * self.T_current:g} ms must divide T_force = "
                f"{1e3 * self.T_force:g} ms. For example, use T_current = {100 * self.T_force:g} ms"
            )
        if self.feedback != "sensor" and self.estimation == "off":
            raise ValueError(
                f"feedback = {self.feedback} needs an estimate of the clamp force. Set "
                "estimation = on, or feedback = sensor"
            )
        return self


class EcuParameters(CascadeParameters):
    """The ECU of a DC motor."""

    current: current_pi.Parameters


class FieldOrientedEcuParameters(CascadeParameters):
    """The ECU of a synchronous motor."""

    current: field_oriented.Parameters


class CaliperBrakeParameters(ParameterSet):
    """The whole brake with a DC motor: plant, sensors and ECU."""

    supply: battery_supply.Parameters
    bridge: h_bridge.Parameters
    motor: dc_motor.Parameters
    encoder: angle_sensor.Parameters
    rotor: rotor.Parameters
    friction: load_friction.Parameters
    gear: planetary_gear.Parameters
    screw: ball_screw.Parameters
    caliper: floating_caliper.Parameters
    hysteresis: pad_hysteresis.Parameters
    stop: StopParameters
    force: load_cell.Parameters
    F_span: Force
    """full-scale clamp force of the load cell"""
    adc: adc.Parameters
    current: current_sensor.Parameters
    current_adc: adc.Parameters
    ecu: EcuParameters
    drive: DriveMode
    """quantity that the stimulus commands; "voltage" is an ideal source at the motor"""

    @model_validator(mode="after")
    def _stop_is_beyond(self) -> CaliperBrakeParameters:
        _require_room(self.caliper, self.stop)
        return self


class SynchronousBrakeParameters(ParameterSet):
    """The whole brake with a synchronous motor: plant, sensors and ECU."""

    supply: battery_supply.Parameters
    inverter: inverter.Parameters
    motor: pmsm.Parameters
    encoder: angle_sensor.Parameters
    rotor: rotor.Parameters
    friction: load_friction.Parameters
    gear: planetary_gear.Parameters
    screw: ball_screw.Parameters
    caliper: floating_caliper.Parameters
    hysteresis: pad_hysteresis.Parameters
    stop: StopParameters
    force: load_cell.Parameters
    F_span: Force
    """full-scale clamp force of the load cell"""
    adc: adc.Parameters
    current: current_sensor.Parameters
    current_adc: adc.Parameters
    ecu: FieldOrientedEcuParameters
    drive: DriveMode
    """quantity that the stimulus commands; "voltage" is an ideal source that turns with the rotor
    and drives its q axis"""

    @model_validator(mode="after")
    def _stop_is_beyond(self) -> SynchronousBrakeParameters:
        _require_room(self.caliper, self.stop)
        return self


BrakeParameters = CaliperBrakeParameters | SynchronousBrakeParameters
"""parameters of the brake with either motor"""


def torque_constant(par: BrakeParameters) -> float:
    """Return the torque per motor current [N*m/A]; for a synchronous motor, per amplitude."""
    if isinstance(par.motor, dc_motor.Parameters):
        return par.motor.K_e
    return 1.5 * par.motor.p * par.motor.psi


def _require_room(caliper: floating_caliper.Parameters, stop: StopParameters) -> None:
    """Reject an end stop within the caliper's measured curve."""
    needed = caliper.clearance + caliper.n_max
    if not stop.x_end > needed:
        raise ValueError(
            f"stop.x_end = {stop.x_end:g} m must be > caliper.clearance + caliper.n_max "
            f"= {needed:g} m, the end of the caliper's measured curve"
        )
