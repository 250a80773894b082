"""Derating: a motor's current limit falls with the winding temperature estimated by the ECU.

The winding has no temperature sensor. The ECU runs a thermal model with the current as input.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge, Gt
from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import (
    HeatCapacity,
    HeatConductance,
    Resistance,
    Temperature,
    TemperatureCoefficient,
    Unit,
)
from bywire.core.signals import Signal
from bywire.core.units import shown

LeastCurrent = Annotated[float, Unit("A", 10.0), Field(ge=0, allow_inf_nan=False)]
SampleTime = Annotated[float, Signal("s", "sample time", 1e-3), Gt(0)]
Rise = Annotated[
    float, Signal("delta_degC", "temperature rise above air, estimated by the ECU", 50.0)
]


class Parameters(ParameterSet):
    """The ECU's thermal model, and the resulting current limit.

    ``law``: ``"current"`` lowers the limit. ``"off"`` keeps it constant and computes nothing.
    """

    law: Literal["off", "current"]
    """whether the limit decreases with temperature"""
    R_hat: Resistance
    """resistance at T_ref_hat assumed by the ECU"""
    a_R_hat: TemperatureCoefficient
    """temperature coefficient of the resistance"""
    C_w_hat: HeatCapacity
    """winding heat capacity assumed by the ECU"""
    C_h_hat: HeatCapacity
    """housing heat capacity assumed by the ECU"""
    G_wh_hat: HeatConductance
    """thermal conductance from winding to housing assumed by the ECU"""
    G_ha_hat: HeatConductance
    """thermal conductance from housing to air assumed by the ECU"""
    T_ref_hat: Temperature
    """temperature at which R_hat is valid"""
    T_a_hat: Temperature
    """air temperature assumed by the ECU"""
    T_derate: Temperature
    """winding temperature above which the limit decreases"""
    T_limit: Temperature
    """winding temperature at which the limit reaches i_least"""
    i_least: LeastCurrent
    """minimum limit at any temperature"""

    @model_validator(mode="after")
    def _falls(self) -> Parameters:
        if not self.T_derate < self.T_limit:
            raise RuleError(
                "T_derate",
                shown(self.T_derate, "K"),
                f"< T_limit = {shown(self.T_limit, 'K')}",
                "the current limit decreases between these temperatures",
            )
        return self


class State(NamedTuple):
    """Temperature rises above the air; zero for a cold motor."""

    winding: Rise
    housing: Rise


class Input(NamedTuple):
    """Measured or demanded current, and its limit for a cold motor."""

    i: Annotated[float, Signal("A", "motor current", 5.0)]
    i_max: Annotated[float, Signal("A", "limit of the current's magnitude", 20.0), Ge(0)]


class Output(NamedTuple):
    """Current limit, estimated winding temperature, and whether the limit is lowered."""

    i_max: Annotated[float, Signal("A", "limit of the current's magnitude", 20.0)]
    T: Annotated[float, Signal("K", "estimated winding temperature", 350.0)]
    derated: Annotated[float, Signal("1", "motor derated")]


def output(x: State, u: Input, T: SampleTime, par: Parameters) -> tuple[State, Output]:
    r"""Advance the thermal model by one sample, and return the resulting limit.

    .. math::
        C_w \dot\vartheta_w &= R(\vartheta_w)\, i^2 - G_{wh} (\vartheta_w - \vartheta_h) \\
        C_h \dot\vartheta_h &= G_{wh} (\vartheta_w - \vartheta_h) - G_{ha} \vartheta_h \\
        i_{max} &= i_{least} + (i_0 - i_{least})\,
        \mathrm{clip}\left(\frac{T_{limit} - T_w}{T_{limit} - T_{derate}}, 0, 1\right)

    Notes
    -----
    The limit is linear instead of a switch. While a demand is at the limit, current and temperature
    settle where heat input equals heat loss, without hunting.
    """
    if par.law == "off":
        return x, Output(u.i_max, par.T_a_hat, 0.0)
    hot = par.T_a_hat + x.winding
    R = par.R_hat * (1.0 + par.a_R_hat * (hot - par.T_ref_hat))
    through = par.G_wh_hat * (x.winding - x.housing)
    winding = x.winding + T / par.C_w_hat * (R * u.i * u.i - through)
    housing = x.housing + T / par.C_h_hat * (through - par.G_ha_hat * x.housing)
    now = par.T_a_hat + winding
    share = ops.clip((par.T_limit - now) / (par.T_limit - par.T_derate), 0.0, 1.0)
    least = ops.fmin(par.i_least, u.i_max)
    limit = least + (u.i_max - least) * share
    return State(winding, housing), Output(limit, now, ops.where(share < 1.0, 1.0, 0.0))
