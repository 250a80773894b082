"""Motor heat: copper loss heats the winding, which heats the housing, which heats the air.

Copper resistance increases with temperature, and magnets become weaker. `warmth` returns the
resulting resistance and torque constant of the motor.
"""

from __future__ import annotations

from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge
from pydantic import model_validator

from bywire.core.parameters import ParameterSet, RuleError
from bywire.core.quantities import (
    HeatCapacity,
    HeatConductance,
    Temperature,
    TemperatureCoefficient,
)
from bywire.core.signals import Energy, Power, Role, Signal
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.core.validity import first, within_limits

BOOK = "motor heat"
COPPER = Role("source", "copper", book=BOOK)
WINDING, HOUSING = (
    Role("sink", label, book=BOOK, returns="any") for label in ("winding", "housing")
)
Conducted = Annotated[
    float,
    Signal("W", "heat flow from motors to air", role=Role("sink", "air", book=BOOK, returns="any")),
]
Kelvin = Annotated[float, Signal("K", "temperature", 400.0), Ge(0)]


class Parameters(ParameterSet):
    """Two bodies with one temperature each.

    ``law``: with ``"lumped"``, the motor warms up. With ``"off"``, temperatures are constant and
    the motor keeps its values for ``T_ref``.
    """

    law: Literal["off", "lumped"]
    """whether the motor warms up"""
    C_w: HeatCapacity
    """heat capacity of the winding"""
    C_h: HeatCapacity
    """heat capacity of housing and magnets"""
    G_wh: HeatConductance
    """thermal conductance from the winding to the housing"""
    G_ha: HeatConductance
    """thermal conductance from the housing to the air"""
    a_R: TemperatureCoefficient
    """increase in resistance with winding temperature (copper)"""
    a_K: TemperatureCoefficient
    """decrease in torque constant with housing temperature (magnets)"""
    T_ref: Temperature
    """temperature at which the motor's resistance and torque constant are valid"""
    T_a: Temperature
    """air temperature, and initial motor temperature"""
    T_most: Temperature
    """temperature limit of the winding insulation"""

    @model_validator(mode="after")
    def _magnets_hold(self) -> Parameters:
        rise = self.T_most - self.T_ref
        if not self.a_K * rise < 1.0:
            raise RuleError(
                "a_K",
                f"{self.a_K:g} 1/K",
                f"< {1.0 / rise:.3g} 1/K",
                f"otherwise the torque constant is not positive at T_most = "
                f"{shown(self.T_most, 'K')}",
            )
        return self


class State(NamedTuple):
    """Temperatures."""

    T_winding: Annotated[float, Signal("K", "winding temperature", 350.0), Ge(0)]
    T_housing: Annotated[float, Signal("K", "motor housing temperature", 320.0), Ge(0)]


class Factors(NamedTuple):
    """Factors of the derivatives: heat capacities."""

    T_winding: Annotated[float, Signal("J/K", "heat capacity of the winding", 30.0)]
    T_housing: Annotated[float, Signal("J/K", "heat capacity of the housing", 300.0)]


class Balance(NamedTuple):
    """Heat sources."""

    T_winding: Annotated[float, Signal("W", "heat into the winding", 30.0)]
    T_housing: Annotated[float, Signal("W", "heat into the housing", 30.0)]


class Input(NamedTuple):
    """Copper loss of the winding."""

    P: Annotated[float, Signal("W", "copper loss", 30.0), Ge(0)]


class Stored(NamedTuple):
    """Heat above the air temperature."""

    winding: Annotated[float, Signal("J", "heat in the winding", 1e3)]
    housing: Annotated[float, Signal("J", "heat in the housing", 1e4)]


class Warmth(NamedTuple):
    """Resistance and torque constant relative to their values at the reference temperature."""

    R: Annotated[
        float, Signal("1", "resistance relative to its value at the reference temperature", 1.0)
    ]
    K: Annotated[
        float,
        Signal("1", "torque constant relative to its value at the reference temperature", 1.0),
    ]


def mass(par: Parameters) -> Factors:
    """Return the heat capacities."""
    return Factors(par.C_w, par.C_h)


def balance(x: State, u: Input, par: Parameters) -> Balance:
    r"""Return the net heat flow into winding and housing.

    .. math::
        C_w \dot T_w &= P - G_{wh} (T_w - T_h) \\
        C_h \dot T_h &= G_{wh} (T_w - T_h) - G_{ha} (T_h - T_a)
    """
    if par.law == "off":
        return Balance(0.0, 0.0)
    through = par.G_wh * (x.T_winding - x.T_housing)
    return Balance(u.P - through, through - par.G_ha * (x.T_housing - par.T_a))


def warmth(x: State, par: Parameters) -> Warmth:
    r"""Return resistance and torque constant relative to their values at T_ref.

    .. math:: R/R_{ref} = 1 + a_R (T_w - T_{ref}), \quad K/K_{ref} = 1 - a_K (T_h - T_{ref})
    """
    if par.law == "off":
        return Warmth(1.0, 1.0)
    return Warmth(
        R=1.0 + par.a_R * (x.T_winding - par.T_ref), K=1.0 - par.a_K * (x.T_housing - par.T_ref)
    )


def stored(x: State, par: Parameters) -> Stored:
    """Return the heat in each body."""
    if par.law == "off":
        return Stored(0.0, 0.0)
    return Stored(par.C_w * (x.T_winding - par.T_a), par.C_h * (x.T_housing - par.T_a))


def energy(x: State, par: Parameters) -> Energy:
    """Return the heat in both bodies."""
    each = stored(x, par)
    return each.winding + each.housing


def power_in(u: Input, par: Parameters) -> Power:
    """Return the copper loss if it heats the motor."""
    return 0.0 if par.law == "off" else u.P


def power_loss(x: State, par: Parameters) -> Conducted:
    """Return the heat flow to the air (signed: negative if the air is warmer)."""
    return 0.0 if par.law == "off" else par.G_ha * (x.T_housing - par.T_a)


def cold(par: Parameters) -> State:
    """Return the state of a motor at air temperature."""
    return State(par.T_a, par.T_a)


@within_limits
def watch(t: Array, x: State, par: Parameters) -> list[str]:
    """Warn if the winding exceeds its insulation limit."""
    if par.law == "off":
        return []
    most = shown(par.T_most, "K")
    return list(first(t, x.T_winding > par.T_most, f"the winding exceeds {most}, its limit,"))
