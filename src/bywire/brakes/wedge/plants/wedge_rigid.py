"""Rotors and wedge of the wedge brake as one body."""

from __future__ import annotations

from typing import cast

from bywire.analysis.linear.channels import with_channels
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.plant import Plant, PlantPoint
from bywire.brakes.wedge.linear import INPUTS, OUTPUTS, mechanical, rigid
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.plants.point import AT, whole
from bywire.core.parameters import ParameterSet


def model(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return two states: travel and velocity of the wedge; both motors are driven as one."""
    own = rigid(mechanical(whole(par, at)), cast(WedgeParameters, par))
    return own.together(INPUTS)


def exact(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the whole plant with the same input and outputs."""
    return with_channels(whole(par, at), outputs=OUTPUTS).together(INPUTS)


PLANT = Plant(
    name="wedge-rigid",
    assembly="wedge-brake",
    summary="rotors and wedge as one body: drives ideal, screws and interfaces stiff",
    at=AT,
    model=model,
    band=150.0,
    whole=exact,
)
