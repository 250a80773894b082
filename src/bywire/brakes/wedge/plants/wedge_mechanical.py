"""Rotors and wedge of the wedge brake, the drives quasi-static."""

from __future__ import annotations

from bywire.analysis.linear.channels import with_channels
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.plant import Plant, PlantPoint
from bywire.brakes.wedge.linear import OUTPUTS, mechanical
from bywire.brakes.wedge.plants.point import AT, whole
from bywire.core.parameters import ParameterSet


def model(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return six states, with what the drives add to the rotors' inertia."""
    return mechanical(whole(par, at), corrected=True)


def exact(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the whole plant with the same outputs."""
    return with_channels(whole(par, at), outputs=OUTPUTS)


PLANT = Plant(
    name="wedge-mechanical",
    assembly="wedge-brake",
    summary="rotors and wedge alone: drives quasi-static, with the inertia they seem to add",
    at=AT,
    model=model,
    band=150.0,
    whole=exact,
)
