"""Brake discs of a wheel: maximum brake torque at the caliper pressure."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.core import ops
from bywire.core.faults import ParameterFault
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Area, Factor, Length, Torque, Unit
from bywire.core.signals import Pressure, Signal

Count = Annotated[float, Unit("1", 2.0), Field(ge=1, allow_inf_nan=False)]


class Parameters(ParameterSet):
    """Discs and calipers of one wheel."""

    faces: Count
    """number of friction faces, two per disc"""
    mu_pad: Factor
    """pad friction coefficient"""
    A_cal: Area
    """piston area on one side of a disc"""
    r_eff: Length
    """effective friction radius"""
    T_drag: Torque
    """torque of pads that drag without pressure; 0 for free pads"""


FAULTS = (
    ParameterFault("glazed", "reduced pad friction", ("mu_pad",), 0.7),
    ParameterFault(
        "dragging",
        "a piston sticks in its caliper and the pads drag (value: torque)",
        replaced="T_drag",
        value=10.0,
    ),
)


class Input(NamedTuple):
    """Pressure in the calipers."""

    p: Pressure


class Output(NamedTuple):
    """Torque that the discs can hold."""

    torque: Annotated[float, Signal("N*m", "maximum brake torque", 300.0)]


def torque_per_pressure(
    par: Parameters,
) -> Annotated[float, Signal("N*m/Pa", "brake torque per unit pressure", 3e-4)]:
    r"""Return :math:`k = z\, \mu_{pad} A_{cal} r_{eff}`."""
    return par.faces * par.mu_pad * par.A_cal * par.r_eff


def output(u: Input, par: Parameters) -> Output:
    """Return the torque. Without pressure, only dragging pads contribute."""
    return Output(torque=ops.fmax(torque_per_pressure(par) * u.p, par.T_drag))
