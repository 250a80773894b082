"""Vapor bubbles in brake fluid above its boiling point, which decreases with water content."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge
from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Temperature, Unit, Volume
from bywire.core.signals import Signal
from bywire.core.units import shown

Share = Annotated[float, Unit("1", 0.03), Field(ge=0, lt=1, allow_inf_nan=False)]
Growth = Annotated[float, Unit("1/K", 0.02), Field(ge=0, allow_inf_nan=False)]
Kelvin = Annotated[float, Signal("K", "temperature of the fluid", 430.0), Ge(0)]


class Parameters(ParameterSet):
    """Boiling points according to FMVSS 116, at atmospheric pressure, and growth of vapor."""

    water: Share
    """fraction of water in the fluid, by mass"""
    T_dry: Temperature
    """boiling point of fluid without water"""
    T_wet: Temperature
    """boiling point of fluid with the water fraction ``water_wet``"""
    water_wet: Annotated[float, Unit("1", 0.037), Field(gt=0, lt=1, allow_inf_nan=False)]
    """fraction of water in wet fluid, up to which the vapor model is valid"""
    V: Volume
    """volume of the hot fluid"""
    growth: Growth
    """vapor volume per fluid volume and kelvin above the boiling point, at ambient pressure"""
    T_most: Temperature
    """fluid temperature up to which the vapor model is valid"""

    @model_validator(mode="after")
    def _boils_within_its_range(self) -> Parameters:
        T_dry = shown(self.T_dry, "K")
        if not self.T_wet <= self.T_dry:
            reason = "water lowers the boiling point"
            raise RuleError("T_wet", shown(self.T_wet, "K"), f"<= T_dry = {T_dry}", reason)
        if not self.T_dry < self.T_most:
            raise RuleError("T_dry", T_dry, f"< T_most = {shown(self.T_most, 'K')}")
        if self.water > self.water_wet:
            raise RuleError(
                "water",
                f"{self.water:g}",
                f"<= water_wet = {self.water_wet:g}",
                "the boiling point is known only up to water_wet. Reduce water, or set water_wet "
                "and T_wet to the values of wetter fluid",
            )
        return self


def boiling_point(par: Parameters) -> Annotated[float, Signal("K", "boiling point", 430.0)]:
    r"""Return the boiling point of fluid with some water.

    .. math:: T_b = T_{dry} - (T_{dry} - T_{wet})\, w / w_{wet}

    Notes
    -----
    This is a straight line between the two tested points. In reality, the first water has the
    largest effect.

    References
    ----------
    49 CFR 571.116 (FMVSS 116): DOT 4 boils at 230 degC at least when dry, 155 degC when wet.
    """
    return par.T_dry - (par.T_dry - par.T_wet) * (par.water / par.water_wet)


def volume(T: Kelvin, par: Parameters) -> Annotated[float, Signal("m**3", "vapor", 1e-7)]:
    r"""Return the volume of the vapor at ambient pressure.

    .. math:: V_{vapor} = \gamma V \max(T - T_b, 0)

    Pressure compresses the vapor like a gas (`brake_fluid`, air in line and caliper).

    Notes
    -----
    The heat in 5 ml of fluid with 2.3 kJ/(kg K) suffices for 10 ml of vapor per kelvin. The growth
    determines how much vapor forms before the fluid retreats or cools.
    """
    return par.growth * par.V * ops.fmax(T - boiling_point(par), 0.0)
