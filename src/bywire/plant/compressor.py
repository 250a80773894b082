"""Piston compressor of an air brake, whose flow falls with the pressure in the tank."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.signals import Signal
from bywire.plant import air

SuctionFlow = Annotated[float, Unit("m**3/s", 5e-3), Field(gt=0, allow_inf_nan=False)]
Clearance = Annotated[float, Unit("1", 0.05), Field(ge=0, lt=1, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Compressor at constant speed, with a cooled delivery line. A check valve prevents backflow.

    An unloader valve lets it run idle. Its drive is outside the model: the energy of the delivered
    air is the energy that enters.
    """

    V_dot: SuctionFlow
    """displacement per time, at ambient pressure"""
    c: Clearance
    """clearance volume relative to the displacement"""


FAULTS = (
    ParameterFault("worn", "worn piston rings or reed valves", ("V_dot",), 0.5),
    ParameterFault("lost", "broken drive, which delivers almost nothing", ("V_dot",), 1e-6),
)


class Input(NamedTuple):
    """Absolute pressure in the tank, and whether the compressor is loaded."""

    p: air.AbsolutePressure
    on: Annotated[float, Signal("1", "compressor loaded", 1.0, low=0.0, high=1.0)]


class Output(NamedTuple):
    """Flow into the tank."""

    mdot: Annotated[float, Signal("kg/s", "mass flow", 5e-3)]
    H: Annotated[float, Signal("W", "enthalpy flow", 1e3)]


def output(u: Input, par: Parameters, gas: air.Parameters) -> Output:
    r"""Return the flow into the tank, at ambient temperature.

    .. math:: \dot m = \rho_a \dot V \left(1 - c \left((p/p_a)^{1/\gamma} - 1\right)\right)^+

    Air in the clearance volume expands before the suction valve opens, so the flow falls to zero at
    :math:`p = p_a (1 + 1/c)^\gamma`, where the equation has a kink.

    References
    ----------
    The volumetric efficiency of a piston compressor with adiabatic re-expansion, as in textbooks.
    """
    rho_a = gas.rho_0 * gas.p_atm / gas.p_ref
    ratio = ops.exp(ops.log(u.p / gas.p_atm) / gas.gamma)
    filled = ops.fmax(1.0 - par.c * (ratio - 1.0), 0.0)
    mdot = u.on * rho_a * par.V_dot * filled
    return Output(mdot=mdot, H=mdot * gas.gamma * air.heat_capacity(gas) * gas.T_0)
