r"""Capacitor on the bus of an inverter, with a supply that takes current or does not.

A motor that regenerates lifts the bus voltage. A battery takes the energy. A supply with a diode
takes none, so the energy charges the capacitor, or a brake chopper turns it into heat.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import Resistance, Unit, Voltage
from bywire.core.signals import Energy, Power, Role, Signal
from bywire.core.typing import Array
from bywire.core.validity import first, within_limits

Capacitance = Annotated[float, Unit("F", 1e-3), Field(gt=0, allow_inf_nan=False)]
Amperes = Annotated[float, Signal("A", "current", 5.0)]
Loss = Annotated[float, Signal("W", "loss in the supply's resistance", role=Role("sink", "supply"))]
Chopped = Annotated[float, Signal("W", "brake chopper", role=Role("sink", "brake chopper"))]


class Parameters(ParameterSet):
    """Ideal capacitor and an ideal voltage source with a series resistance.

    ``law``: with ``"battery"``, the supply takes current. With ``"diode"``, it only delivers
    current. ``chopper``: with ``"resistor"``, a resistor discharges the bus above a voltage.
    """

    law: Literal["battery", "diode"]
    """whether the supply takes current"""
    V_s: Voltage
    """open-circuit voltage of the supply"""
    R_s: Resistance
    """resistance of supply and leads"""
    C: Capacitance
    """capacitance"""
    chopper: Literal["off", "resistor"]
    """whether a brake chopper limits the voltage"""
    V_on: Voltage
    """voltage above which the chopper conducts (chopper "resistor")"""
    R_on: Resistance
    """slope of the chopper's voltage over current (chopper "resistor")"""
    V_most: Voltage
    """maximum voltage of capacitor and switches"""

    @model_validator(mode="after")
    def _withstands_the_supply(self) -> Parameters:
        if not self.V_s < self.V_most:
            raise RuleError("V_most", f"{self.V_most:g} V", f"> V_s = {self.V_s:g} V")
        if self.chopper == "resistor" and not self.V_on > self.V_s:
            reason = "otherwise the chopper discharges the supply"
            raise RuleError("V_on", f"{self.V_on:g} V", f"> V_s = {self.V_s:g} V", reason)
        return self


FAULTS = (
    ParameterFault(
        "disconnected",
        "supply disconnected (value: resistance of the contact)",
        replaced="R_s",
        value=1e6,
    ),
    ParameterFault("aged", "dried-out capacitor (value: factor)", ("C",), 0.3),
)


class State(NamedTuple):
    """Voltage."""

    v: Annotated[float, Signal("V", "bus voltage", 24.0)]


class Factors(NamedTuple):
    """Factor of the voltage's derivative."""

    v: Annotated[float, Signal("F", "capacitance", 1e-3)]


class Balance(NamedTuple):
    """Current into the capacitor."""

    v: Annotated[float, Signal("A", "current into the capacitor", 5.0)]


class Input(NamedTuple):
    """Current to the inverter; negative if the motor regenerates."""

    i_dc: Amperes


class Output(NamedTuple):
    """Currents of supply and chopper."""

    i_s: Annotated[float, Signal("A", "supply current", 5.0)]
    i_ch: Annotated[float, Signal("A", "chopper current", 5.0)]


def mass(par: Parameters) -> Factors:
    """Return the capacitance."""
    return Factors(v=par.C)


def output(x: State, par: Parameters) -> Output:
    r"""Return the currents of supply and chopper.

    .. math:: i_s = (V_s - v)/R_s, \quad i_{ch} = (v - V_{on})^+ / R_{on}

    With law "diode", the supply current has a corner at :math:`v = V_s`, above which it is zero. It
    requires a step below the time constant :math:`R_s C`. The chopper's current has a corner at
    :math:`v = V_{on}`.
    """
    i_s = (par.V_s - x.v) / par.R_s
    if par.law == "diode":
        i_s = ops.fmax(i_s, 0.0)
    if par.chopper == "off":
        return Output(i_s=i_s, i_ch=0.0 * i_s)
    return Output(i_s=i_s, i_ch=ops.fmax((x.v - par.V_on) / par.R_on, 0.0))


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return the current into the capacitor, :math:`C \dot v = i_s - i_{ch} - i_{dc}`."""
    out = output(x, par)
    return Balance(v=out.i_s - out.i_ch - u.i_dc)


def energy(x: State, par: Parameters) -> Energy:
    r"""Return the energy of the capacitor, :math:`\tfrac{1}{2} C v^2`."""
    return 0.5 * par.C * x.v * x.v


def power_source(x: State, par: Parameters) -> Power:
    """Return the power that the source delivers, V_s i_s."""
    return par.V_s * output(x, par).i_s


def power_in(x: State, u: Input, par: Parameters) -> Power:
    """Return the power of the source minus the power to the inverter."""
    return power_source(x, par) - x.v * u.i_dc


def supply_loss(x: State, par: Parameters) -> Loss:
    """Return the heat in the supply's resistance, >= 0."""
    return (par.V_s - x.v) * output(x, par).i_s


def chopper_loss(x: State, par: Parameters) -> Chopped:
    """Return the heat of the brake chopper, >= 0."""
    return x.v * output(x, par).i_ch


def power_loss(x: State, par: Parameters) -> Power:
    """Return the heat of supply and chopper, >= 0."""
    return supply_loss(x, par) + chopper_loss(x, par)


@within_limits
def watch(t: Array, x: State, par: Parameters) -> list[str]:
    """Warn if the bus exceeds its maximum voltage."""
    cause = "" if par.law == "battery" else ", because the supply takes no current"
    return list(first(t, x.v > par.V_most, f"the bus exceeds {par.V_most:g} V", cause))
