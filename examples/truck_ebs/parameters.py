"""Parameters of brake, wheel and vehicle: one group per element."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from bywire.authoring import Duration, Length, ParameterSet, Pressure, TimeConstant, Unit
from bywire.plant import (
    abs_modulator,
    air,
    air_orifice,
    air_volume,
    anti_alias_filter,
    brake_chamber,
    compressor,
    end_stop,
    floating_caliper,
    governor,
    lever,
    relay_valve,
    road_wheel,
    spring_brake,
)
from bywire.vehicle import CornerParameters, slip_control
from truck_ebs.elements import push_rod
from truck_ebs.laws import modulator_switch, pressure_control

PadFriction = Annotated[float, Unit("1", 0.35), Field(gt=0, lt=1, allow_inf_nan=False)]


class DiscParameters(ParameterSet):
    """Disc and pads of the caliper."""

    mu: PadFriction
    """friction coefficient of the pads"""
    r_eff: Length
    """effective radius of the disc"""


class EcuParameters(ParameterSet):
    """Electronic pressure control of the relay valve.

    ``control``: with ``"feedforward"``, the control pressure follows the demand, and only the relay
    valve controls the pressure. With ``"closed-loop"``, the ECU corrects the error of the measured
    pressure.
    """

    control: Literal["feedforward", "closed-loop"]
    """whether the ECU corrects the error of the measured pressure"""
    T_s: Duration
    """sample time"""
    T_bus: TimeConstant
    """time constant of bus, electronics and pilot valve"""
    p_max: Pressure
    """maximum control pressure"""
    p_range: Pressure
    """gauge pressure at full range of the sensor"""
    filter: anti_alias_filter.Parameters
    pressure: pressure_control.Parameters


class TruckParameters(ParameterSet):
    """The brake at a wheel of the truck."""

    gas: air.Parameters
    p_s: Pressure
    """gauge pressure of the reservoir, constant"""
    relay: relay_valve.Parameters
    feed: air_orifice.Parameters
    exhaust: air_orifice.Parameters
    volume: air_volume.Parameters
    chamber: brake_chamber.Parameters
    rod: push_rod.Parameters
    lever: lever.Parameters
    caliper: floating_caliper.Parameters
    stop: end_stop.Parameters
    disc: DiscParameters
    wheel: road_wheel.Parameters
    corner: CornerParameters
    ecu: EcuParameters

    @model_validator(mode="after")
    def _chamber_reaches_the_pads(self) -> TruckParameters:
        stroke = self.chamber.x_table[-1]
        reach, gap = lever.travel(stroke, self.lever), self.caliper.clearance
        if not reach > gap:
            raise ValueError(
                f"chamber.x_table ends at {stroke:g} m, where the pads have moved {reach:.3g} m. "
                f"They must move farther than caliper.clearance = {gap:g} m. Reduce the clearance "
                f"or lever.i = {self.lever.i:g}"
            )
        return self


AirVolume = Annotated[float, Unit("m**3", 2e-4), Field(gt=0, allow_inf_nan=False)]


class AbsTruckParameters(TruckParameters):
    """The brake with a modulator at the end of its hose."""

    V_hose: AirVolume
    """volume of the hose between relay valve and modulator"""
    modulator: abs_modulator.Parameters
    passage: air_orifice.Parameters
    bleed: air_orifice.Parameters
    switch: modulator_switch.Parameters
    slip: slip_control.Parameters


class ParkTruckParameters(TruckParameters):
    """The brake with spring brake, tank and compressor. The tank starts at p_s."""

    V_tank: AirVolume
    """volume of the tank"""
    compressor: compressor.Parameters
    governor: governor.Parameters
    burst: air_orifice.Parameters
    hand_valve: air_orifice.Parameters
    spring: spring_brake.Parameters
    push: end_stop.Parameters
    ends: end_stop.Parameters
