"""Traction battery: charge, losses, and a charging limit by state of charge and temperature."""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Temperature, Unit
from bywire.core.signals import Energy, Power, Role, Signal

Charge = Annotated[float, Unit("A*s", 1e5), Field(gt=0, allow_inf_nan=False)]
PackVoltage = Annotated[float, Unit("V", 400.0), Field(gt=0, allow_inf_nan=False)]
PackResistance = Annotated[float, Unit("ohm", 0.2), Field(gt=0, allow_inf_nan=False)]
ChargingCurrent = Annotated[float, Unit("A", 75.0), Field(ge=0, allow_inf_nan=False)]
ChargingPower = Annotated[float, Unit("W", 25e3), Field(ge=0, allow_inf_nan=False)]
Loss = Annotated[
    float, Signal("W", "loss in the battery", role=Role("sink", "battery loss", book="battery"))
]


class Parameters(ParameterSet):
    """Cells with a linear open-circuit voltage and a constant resistance.

    ``law``: with ``"cells"``, the charging current also keeps the terminal voltage below its
    maximum, and falls with the temperature, because lithium plates cold anodes. With
    ``"constant"``, only the largest power counts. The temperature is constant during a run.
    """

    law: Literal["constant", "cells"]
    """charging limit: constant, or from the cells"""
    P_max: ChargingPower
    """maximum charging power; 0 if the battery accepts none"""
    Q: Charge
    """charge of the full battery"""
    V_0: PackVoltage
    """open-circuit voltage of the empty battery"""
    V_1: PackVoltage
    """open-circuit voltage of the full battery"""
    V_max: PackVoltage
    """maximum terminal voltage"""
    R: PackResistance
    """internal resistance"""
    I_max: ChargingCurrent
    """maximum charging current of the warm battery"""
    T: Temperature
    """temperature of the cells"""
    T_cold: Temperature
    """temperature below which the battery accepts no charge"""
    T_warm: Temperature
    """temperature above which the battery accepts the maximum current"""

    @model_validator(mode="after")
    def _levels_rise(self) -> Parameters:
        if not self.V_1 > self.V_0:
            raise RuleError("V_1", f"{self.V_1:g} V", f"> V_0 = {self.V_0:g} V")
        if not self.V_max >= self.V_1:
            reason = "the full battery must be below its largest voltage"
            raise RuleError("V_max", f"{self.V_max:g} V", f">= V_1 = {self.V_1:g} V", reason)
        if not self.T_warm > self.T_cold:
            raise RuleError("T_warm", f"{self.T_warm:g} K", f"> T_cold = {self.T_cold:g} K")
        return self


FAULTS = (
    ParameterFault("full", "the battery accepts no power", ("P_max",), 0.0),
    ParameterFault("cold", "cold cells", replaced="T", value=263.15, with_it={"law": "cells"}),
)


class State(NamedTuple):
    """State of charge."""

    soc: Annotated[float, Signal("1", "state of charge", 0.5, low=0.0, high=1.0)]


class Input(NamedTuple):
    """Power at the terminals, positive while the battery charges."""

    P: Power


def open_voltage(
    x: State, par: Parameters
) -> Annotated[float, Signal("V", "open-circuit voltage", 400.0)]:
    r"""Return the open-circuit voltage, :math:`V_{oc} = V_0 + (V_1 - V_0)\, soc`."""
    return par.V_0 + (par.V_1 - par.V_0) * x.soc


def current(
    x: State, u: Input, par: Parameters
) -> Annotated[float, Signal("A", "charging current", 50.0)]:
    r"""Return the current at a power.

    .. math:: P = V_{oc} i + R i^2, \quad i = \frac{2 P}{V_{oc} + \sqrt{V_{oc}^2 + 4 R P}}

    This form is exact near zero. While the battery delivers more power than it can, the root is
    clipped at zero.
    """
    V = open_voltage(x, par)
    root = ops.sqrt(ops.fmax(V * V + 4.0 * par.R * u.P, 0.0))
    return 2.0 * u.P / (V + root)


def mass(
    x: State, par: Parameters
) -> Annotated[float, Signal("A*s", "charge of the full battery", 1e5)]:
    """Return the factor of the state's derivative, which is the charge."""
    return par.Q


def balance(
    x: State, u: Input, par: Parameters
) -> Annotated[float, Signal("A", "charging current", 50.0)]:
    r"""Return the current, :math:`Q\, \dot{soc} = i`."""
    return current(x, u, par)


def charging_limit(
    x: State, par: Parameters
) -> Annotated[float, Signal("W", "maximum charging power", 25e3)]:
    r"""Return the maximum power that the battery accepts.

    With the law "cells":

    .. math::
        I = \min\left(I_{max}\,
            \mathrm{clip}\left(\frac{T - T_{cold}}{T_{warm} - T_{cold}}, 0, 1\right),
            \frac{\max(V_{max} - V_{oc}, 0)}{R}\right), \quad
        P = \min(P_{max}, I (V_{oc} + R I))

    It has kinks where the smallest of the limits changes, and at both temperatures.
    """
    if par.law == "constant":
        return par.P_max
    V = open_voltage(x, par)
    warm = ops.clip((par.T - par.T_cold) / (par.T_warm - par.T_cold), 0.0, 1.0)
    i = ops.fmin(par.I_max * warm, ops.fmax(par.V_max - V, 0.0) / par.R)
    return ops.fmin(par.P_max, i * (V + par.R * i))


def energy(x: State, par: Parameters) -> Energy:
    r"""Return the stored energy, :math:`Q (V_0\, soc + (V_1 - V_0)\, soc^2/2)`."""
    return par.Q * (par.V_0 * x.soc + 0.5 * (par.V_1 - par.V_0) * x.soc * x.soc)


def power_in(u: Input) -> Power:
    """Return the power at the terminals."""
    return u.P


def power_loss(x: State, u: Input, par: Parameters) -> Loss:
    """Return the heat in the internal resistance, >= 0."""
    i = current(x, u, par)
    return par.R * i * i
