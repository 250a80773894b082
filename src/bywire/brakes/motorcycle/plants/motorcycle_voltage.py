"""The motorcycle brake behind its bridge."""

from __future__ import annotations

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.plant import Plant, PlantPoint
from bywire.brakes.motorcycle.plants.point import AT, linear
from bywire.core.parameters import ParameterSet


def model(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the plant from the motor voltage, winding and back-EMF included."""
    return linear(par, at, "voltage-source", ("v_source",), ("i", "p_mc", "p_pd", "x_mc"))


PLANT = Plant(
    name="motorcycle-voltage",
    assembly="motorcycle-brake",
    summary="motor voltage to current and pressures: winding, gear, hydraulics",
    at=AT,
    model=model,
    band=200.0,
)
