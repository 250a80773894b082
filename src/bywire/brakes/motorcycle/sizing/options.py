"""Options and assumptions of the study of the motorcycle actuator's gear and motor."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Frequency, GearRatio, Pressure, Unit
from bywire.synthesis.study import require_ranges

Count = Annotated[int, Unit("1", 41.0), Field(ge=3, le=401)]

ASSUMPTIONS = (
    "The gear ratio varies; motor, rotor inertia, battery, pistons, fluid and efficiency stay.",
    "The seals' friction is a force at the piston: at the shaft it grows with the gear ratio.",
    "The wanted pressure is reached exactly: flow through the pressure-volume curves of chamber, "
    "pipeline and caliper gives the speed; pressure, friction, efficiency and inertia the torque.",
    "Compliances are those at the middle of the course; the winding's inductance is left out.",
    "The seals slide; the current that breaks them away at the peak pressure must be there too.",
    "Dither is left out of the calculation; its current at the peak pressure is listed.",
    "Limits: the pressure controller's current limit, and the bridge's voltage at that current.",
    "On the bench the pressure controller's gains grow with the gear ratio; they are not tuned.",
)


class Options(ParameterSet):
    """What the actuator must do, and the designs to compare."""

    bandwidth: Frequency
    """frequency at which a sine of the amplitude, or a step, is followed"""
    p_peak: Pressure
    """largest pressure: crest of the sine, end of the step"""
    amplitude: Pressure
    """amplitude of the sine"""
    p_from: Pressure
    """begin of the step"""
    demand: Literal["sine", "step"]
    """what sizes the actuator"""
    k_g_min: GearRatio
    """smallest gear ratio"""
    k_g_max: GearRatio
    """largest gear ratio"""
    ratios: Count
    """number of gear ratios, evenly spread in their logarithm"""
    f_min: Frequency
    """lowest bandwidth of the map"""
    f_max: Frequency
    """highest bandwidth of the map"""
    frequencies: Count
    """number of bandwidths, evenly spread in their logarithm"""

    @model_validator(mode="after")
    def _ordered(self) -> Options:
        ratios, bandwidths = ("k_g_min", "k_g_max", "m/rad"), ("f_min", "f_max", "Hz")
        require_ranges(self, (ratios, bandwidths, ("p_from", "p_peak", "Pa")))
        if not 2.0 * self.amplitude <= self.p_peak:
            raise ValueError(
                f"amplitude = {self.amplitude / 1e5:g} bar must be <= half of p_peak = "
                f"{self.p_peak / 1e5:g} bar: pressures cannot fall below zero"
            )
        return self
