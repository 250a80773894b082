"""Parameters of brake, wheel and vehicle: one group per element."""

from __future__ import annotations

from typing import Literal

from bywire.authoring import Duration, Length, ParameterSet, Voltage
from bywire.control import current_pi, pedal_map, position_pd
from bywire.plant import (
    ball_screw_gear,
    battery_supply,
    brake_fluid,
    check_valve,
    dc_motor,
    end_stop,
    h_bridge,
    master_cylinder,
    pedal_simulator,
    reservoir_port,
    seal_friction,
    solenoid_valve,
    stiffening_caliper,
)
from one_box.elements import pedal_rod
from one_box.laws import plunger_pressure, refill

DriveMode = Literal["pedal", "pressure", "position", "current"]


class EcuParameters(ParameterSet):
    """Control of the plunger."""

    T_s: Duration
    """sample time of pressure control"""
    T_position: Duration
    """sample time of position control"""
    T_current: Duration
    """sample time of current control"""
    V_ref: Voltage
    """supply voltage of the travel sensor at the pedal rod"""
    x_span: Length
    """rod travel at the end of the sensor's range"""
    pedal_map: pedal_map.Parameters
    pressure: plunger_pressure.Parameters
    refill: refill.Parameters
    position: position_pd.Parameters
    current: current_pi.Parameters


class OneBoxParameters(ParameterSet):
    """The brake of a front wheel, and the lumped brakes of the other wheels."""

    drive: DriveMode
    """quantity that the experiment commands"""
    fluid: brake_fluid.Parameters
    rod: pedal_rod.Parameters
    simulator: pedal_simulator.Parameters
    pedal_stop: end_stop.Parameters
    x_pedal: Length
    """maximum travel of the pedal rod"""
    supply: battery_supply.Parameters
    bridge: h_bridge.Parameters
    motor: dc_motor.Parameters
    gear: ball_screw_gear.Parameters
    seal: seal_friction.Parameters
    plunger: master_cylinder.Parameters
    port: reservoir_port.Parameters
    stop: end_stop.Parameters
    separation: solenoid_valve.Parameters
    others: stiffening_caliper.Parameters
    inlet: solenoid_valve.Parameters
    check: check_valve.Parameters
    caliper: stiffening_caliper.Parameters
    ecu: EcuParameters
