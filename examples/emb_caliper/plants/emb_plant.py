"""The brake without controllers, from motor voltage to current, speed and clamp force."""

from __future__ import annotations

from typing import cast

from bywire.authoring import LinearModel, ParameterSet, Plant, PlantPoint, Quantity, linearize
from emb_caliper.ecu import travel_per_angle
from emb_caliper.loops.points import FORCE, point
from emb_caliper.parameters import CaliperBrakeParameters

CURRENT = Quantity("current", "A", 7.5)


def model(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the exact plant at a clamp force, or at the force that a current holds."""
    caliper = cast(CaliperBrakeParameters, par)
    F = at.value
    if at.quantity is CURRENT:
        F = at.value * caliper.motor.K_e / travel_per_angle(caliper)
    p = point(par, F, "voltage")
    return linearize(
        p.model,
        p.par,
        p.state._replace(omega=at.speed),
        p.memory,
        inputs=("v_source",),
        outputs=("i", "omega", "F_cl"),
        friction=at.friction,
    )


PLANT = Plant(
    name="emb-plant",
    assembly="emb-caliper",
    summary="winding, rotor, gear and caliper, from motor voltage to current, speed, clamp force",
    at=(FORCE, CURRENT),
    model=model,
    band=200.0,
)
