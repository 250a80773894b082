"""Shared parts of the two-wheeler's experiments: rolling starts, and the evaluation of a stop."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from bywire.bench.experiment import Case
from bywire.bench.kpis import vehicle_stop
from bywire.bench.kpis.families import FamilyJudge
from bywire.brakes.two_wheeler.model import TwoWheelerByWire, at_speed
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Unit
from bywire.core.typing import Array
from bywire.plant import adhesion, road
from bywire.plant.road import SurfaceName
from bywire.vehicle import ideal_stop
from bywire.vehicle.surfaces import laid
from bywire.vehicle.two_wheeler import VehicleParameters

if TYPE_CHECKING:
    import xarray as xr

Course = Callable[[Array], Array]
Vehicle = tuple[type[Any], Callable[..., tuple[Any, Any]]]
Demand = Annotated[float, Unit("Pa", 4e6), Field(ge=0, allow_inf_nan=False)]


def rolling_case(
    par: ParameterSet,
    v_0: float,
    demands: Mapping[str, float | Course],
    duration: float,
    changes: Mapping[str, Any] | None = None,
    label: str = "run",
    heat: Mapping[str, Any] | None = None,
    vehicle: Vehicle = (TwoWheelerByWire, at_speed),
) -> Case:
    """Return a run that starts rolling at a speed [m/s]. The rider brakes from t = 0 on.

    Parameters
    ----------
    demands
        Pressure demand [Pa] by stimulus name, constant or as a function of time [s].
    changes
        Parameters that the experiment sets.
    heat
        Initial brake temperatures by part. Default: cold.
    vehicle
        Vehicle model, and its ``at_speed(v, par, heat)``.
    """
    model, rolling = vehicle
    changed = par.replace(dict(changes or {}))
    state, memory = rolling(v_0, changed, heat)

    def stimulus(t: Array) -> dict[str, Array]:
        return {
            name: np.where(t < -1e-9, 0.0, p(t) if callable(p) else p)
            for name, p in demands.items()
        }

    return Case(
        label,
        model(),
        changed,
        state,
        memory,
        stimulus,
        duration,
        start=lambda par: rolling(v_0, par, heat),
    )


def on_surface(first: SurfaceName, further: SurfaceName | None = None) -> dict[str, float]:
    """Return the parameters of a road with one or two surfaces. "own" changes no parameter."""
    return laid("vehicle.road", first, further)


def vehicle_of(run: xr.Dataset) -> VehicleParameters:
    """Return the vehicle parameters of a recording, for any type of brake."""
    par = getattr(run, "par", None)
    if par is not None:
        vehicle: VehicleParameters = par.vehicle
        return vehicle
    return VehicleParameters.model_validate(json.loads(run.attrs["parameters"])["vehicle"])


def _levels(run: xr.Dataset, options: Any) -> dict[str, dict[str, float]]:
    """Return the reference values of a stop from ``options.v_0``."""
    par = vehicle_of(run)
    peak = adhesion.peak_slip(road.surface(0.0, par.road), par.front_tyre)
    ideal = ideal_stop.ideal_distance(options.v_0, par)
    return {"vehicle_stop": {"ideal": ideal, "peak_slip": float(peak)}}


JUDGE = FamilyJudge(lambda _: {"vehicle_stop": vehicle_stop.Setting()}, levels=_levels)
"""evaluation of a stop from the speed ``options.v_0``"""
