"""Battery with internal resistance."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import InternalResistance, Voltage
from bywire.core.signals import Power, Role, Signal

Loss = Annotated[float, Signal("W", "loss in the supply's resistance", role=Role("sink", "supply"))]


class Parameters(ParameterSet):
    """Ideal voltage source with a series resistance, without cell dynamics."""

    V_bat: Voltage
    """open-circuit voltage of the battery"""
    R_bat: InternalResistance
    """internal resistance of battery and leads"""


FAULTS = (
    ParameterFault("under-voltage", "weak battery", replaced="V_bat", value=6.0),
    ParameterFault("bad-contact", "increased resistance of battery and leads", ("R_bat",), 10.0),
)


class Input(NamedTuple):
    """Load current."""

    i_dc: Annotated[float, Signal("A", "battery current", 5.0)]


class Output(NamedTuple):
    """Voltage at the load."""

    v_bus: Annotated[float, Signal("V", "bus voltage", 12.0)]


def output(u: Input, par: Parameters) -> Output:
    r"""Return the voltage at the terminals.

    .. math:: v_{bus} = V_{bat} - R_{bat} i_{dc}
    """
    return Output(v_bus=par.V_bat - par.R_bat * u.i_dc)


def power_source(u: Input, par: Parameters) -> Power:
    """Return the power that the cells deliver, V_bat i_dc."""
    return par.V_bat * u.i_dc


def power_loss(u: Input, par: Parameters) -> Loss:
    """Return the heat in the internal resistance, >= 0."""
    return par.R_bat * u.i_dc * u.i_dc
