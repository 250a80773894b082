"""Parameters of brake, wheel and vehicle: one group per element."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from bywire.authoring import Duration, Length, ParameterSet, Pressure, TimeConstant, Unit
from bywire.plant import (
    air,
    air_orifice,
    air_volume,
    brake_chamber,
    end_stop,
    relay_valve,
    road_wheel,
)
from bywire.vehicle import CornerParameters
from truck_ebs.elements import push_rod

Gap = Annotated[float, Unit("m", 8e-4), Field(ge=0, allow_inf_nan=False)]
PadFriction = Annotated[float, Unit("1", 0.35), Field(gt=0, lt=1, allow_inf_nan=False)]


class DiscParameters(ParameterSet):
    """Disc brake at the lever."""

    gap: Gap
    """air gap of both pads together"""
    mu: PadFriction
    """friction coefficient of the pads"""
    r_eff: Length
    """effective radius of the disc"""


class EcuParameters(ParameterSet):
    """Electronic pressure control of the relay valve."""

    T_s: Duration
    """sample time"""
    T_bus: TimeConstant
    """time constant of bus, electronics and pilot valve"""
    p_max: Pressure
    """largest control pressure"""


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
    pads: end_stop.Parameters
    stop: end_stop.Parameters
    disc: DiscParameters
    wheel: road_wheel.Parameters
    corner: CornerParameters
    ecu: EcuParameters

    @model_validator(mode="after")
    def _chamber_reaches_the_pads(self) -> TruckParameters:
        reach, needed = self.chamber.x_table[-1], self.disc.gap * self.rod.i
        if not reach > needed:
            raise ValueError(
                f"chamber.x_table ends at {reach:g} m, which must be beyond the travel at which "
                f"the pads touch, disc.gap rod.i = {needed:g} m"
            )
        return self
