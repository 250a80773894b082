"""Parameters of the vehicle, its two brakes and its ECU."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.control import abs_rules, lift_pi, mixed_slip, slip_pi, vehicle_speed, wheel_speed
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, TimeConstant, Unit
from bywire.plant import brake_disc, disc_heat, pressure_loop, wheel_encoder
from bywire.vehicle.two_wheeler import VehicleParameters

PressureRate = Annotated[float, Unit("Pa/s", 2e7), Field(gt=0, allow_inf_nan=False)]
Acceleration = Annotated[float, Unit("m/s**2", 0.1), Field(allow_inf_nan=False)]


class BrakeParameters(ParameterSet):
    """One brake with its pressure loop and its discs."""

    circuit: pressure_loop.Parameters
    disc: brake_disc.Parameters


class HotBrakeParameters(BrakeParameters):
    """A brake that may warm up."""

    heat: disc_heat.Parameters


class SensorParameters(ParameterSet):
    """Sensors that do not belong to the brakes."""

    encoder: wheel_encoder.Parameters
    a_offset: Acceleration
    """accelerometer offset, positive if it measures too much deceleration"""
    tau_a: TimeConstant
    """time constant of the accelerometer filter"""


class EcuParameters(ParameterSet):
    """Sample time and controllers of the ECU.

    ``abs``: ``"pi"`` controls the slip of both wheels. ``"rules"`` builds, dumps and holds the
    pressures by thresholds. With ``"off"``, the rider controls the pressures.
    ``lift``: ``"pi"`` keeps the rear wheel on the ground.
    ``sees``: the controllers use speed and slip ``"estimated"`` from the sensors, or the exact
    (``"known"``) values for comparison.
    """

    T_s: Duration
    """sample time"""
    abs: Literal["off", "pi", "rules"]
    """wheel slip control"""
    lift: Literal["off", "pi"]
    """rear wheel lift control"""
    sees: Literal["estimated", "known"]
    """source of the speed and the slip: estimated from the sensors, or known exactly"""
    p_rate: PressureRate
    """maximum build-up rate of a demand"""
    wheel_speed: wheel_speed.Parameters
    vehicle_speed: vehicle_speed.Parameters
    mix: mixed_slip.Parameters
    front_slip: slip_pi.Parameters
    rear_slip: slip_pi.Parameters
    rules: abs_rules.Parameters
    front_lift: lift_pi.Parameters


class TwoWheelerParameters(ParameterSet):
    """The whole vehicle."""

    vehicle: VehicleParameters
    front: HotBrakeParameters
    rear: HotBrakeParameters
    sensors: SensorParameters
    ecu: EcuParameters


class WholeBrakeParameters(ParameterSet):
    """A brake with its whole actuator, its disc and its heat."""

    actuator: MotorcycleParameters
    disc: brake_disc.Parameters
    heat: disc_heat.Parameters


class WholeRearParameters(ParameterSet):
    """The vehicle with a whole brake by wire at its rear wheel."""

    vehicle: VehicleParameters
    front: HotBrakeParameters
    rear: WholeBrakeParameters
    sensors: SensorParameters
    ecu: EcuParameters
