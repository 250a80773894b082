"""Load cell in the force flow of the caliper, with its amplifier."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

from pydantic import Field

from bywire.authoring import Frequency, ParameterFault, ParameterSet, Signal, Unit


class Parameters(ParameterSet):
    """Stiff load cell, and a filter of first order. The cell's own deflection is neglected."""

    f_F: Frequency
    """cutoff frequency of the amplifier's filter"""
    gain: Annotated[float, Unit("1", 1.0), Field(ge=0, le=10, allow_inf_nan=False)]
    """reading per clamp force; 1 if the cell is calibrated"""


FAULTS = (
    ParameterFault(
        "lost", "the load cell is lost and reads zero (value: remaining gain)", ("gain",), 0.0
    ),
)


class State(NamedTuple):
    """Reading of the amplifier."""

    F_cell: Annotated[float, Signal("N", "reading of the load cell", 1e4)]


class Rate(NamedTuple):
    """Derivative of the reading."""

    F_cell: Annotated[float, Signal("N/s", "rate of the load cell's reading", 1e5)]


class Input(NamedTuple):
    """Clamp force."""

    F: Annotated[float, Signal("N", "clamp force", 1e4)]


def rate(x: State, u: Input, par: Parameters) -> Rate:
    r"""Return the derivative of the reading, :math:`2 \pi f_F (g F - y)`."""
    return Rate(F_cell=2.0 * math.pi * par.f_F * (par.gain * u.F - x.F_cell))
