"""The motorcycle brake behind its current loop."""

from __future__ import annotations

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.plant import Plant, PlantPoint
from bywire.brakes.motorcycle.plants.point import AT, linear
from bywire.core.parameters import ParameterSet


def model(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the plant from the motor current: eq. (14) of Dardanelli et al. (2010), and angle."""
    return linear(par, at, "current-source", ("i_source",), ("p_mc", "p_pd", "x_mc"))


PLANT = Plant(
    name="motorcycle-plant",
    assembly="motorcycle-brake",
    summary="motor current to pressures: gear, master cylinder, pipeline, caliper (eq. 14)",
    at=AT,
    model=model,
    band=50.0,
)
