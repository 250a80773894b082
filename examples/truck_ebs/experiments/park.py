"""Loss of all air on a slope: the spring brake takes over from the service brake."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from bywire.authoring import Case, Experiment, Figures, Kpi, Recordings, Unit
from truck_ebs.experiments.ebs_response import DemandOptions
from truck_ebs.models.park import TruckPark, standing
from truck_ebs.parameters import ParkTruckParameters

Array = NDArray[np.float64]
Gradient = Annotated[float, Unit("1", 0.18), Field(ge=-0.5, le=0.5, allow_inf_nan=False)]
_PUSHES = 100.0  # N
FIGURES = Figures(
    undefined="the spring brake does not push the rod within the recording",
    takeover_time=("s", "Time from the loss of air until the spring brake pushes the rod."),
    least_holding=("1", "Smallest ratio of the torque that the brake can hold to the slope's."),
    parked_holding=("1", "The same ratio at the end, with the spring brake alone."),
    largest_clamp_force=("N", "Largest clamp force, while both brakes act."),
    parked_clamp_force=("N", "Clamp force at the end."),
    rolled=("m", "Distance that the vehicle moves after the loss of air."),
    park_pressure=("Pa", "Pressure in the park chamber at the end."),
)


class Options(DemandOptions):
    """The slope, and the service brake that holds the vehicle first."""

    gradient: Gradient
    """gradient of the road, positive uphill"""


def cases(par: ParkTruckParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run. Before time zero, the tire comes to rest on the slope."""
    changed = par.replace(
        {f"corner.road.{name}": options.gradient for name in ("gradient", "gradient_further")}
    )

    def demand(t: Array) -> Mapping[str, Array]:
        lost = np.where(t >= -1e-9, 1.0, 0.0)
        return {"p_set": np.full(t.shape, options.p_brake), "parks": 0.0 * t, "burst": lost}

    return (
        Case(
            "run",
            TruckPark(),
            changed,
            *standing(changed, options.p_brake),
            demand,
            options.duration,
            start=lambda par: standing(par, options.p_brake),
            settle=5.0,
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures."""
    run = recordings["run"]
    par = ParkTruckParameters.model_validate_json(run.attrs["parameters"])
    after = run.sel(time=slice(0.0, None))
    t, F, push = (after[name].values for name in ("time", "F_cl", "F_push"))
    sine = options.gradient / math.sqrt(1.0 + options.gradient**2)
    slope = par.corner.body.m * par.corner.body.g * abs(sine) * par.wheel.r
    holding = 2.0 * par.disc.mu * par.disc.r_eff * F / slope if slope > 0.0 else F + math.inf
    pushes = np.flatnonzero(push > _PUSHES)
    return FIGURES(
        takeover_time=float(t[pushes[0]]) if pushes.size else math.nan,
        least_holding=float(holding.min()),
        parked_holding=float(holding[-1]),
        largest_clamp_force=float(F.max()),
        parked_clamp_force=float(F[-1]),
        rolled=float(np.abs(after["s"].values - after["s"].values[0]).max()),
        park_pressure=float(after["p_park"].values[-1]),
    )


EXPERIMENT = Experiment(
    name="park",
    assembly="truck-park",
    summary="all air is lost at a service pressure of {p_brake:bar} on a gradient of {gradient:%}",
    options=Options,
    defaults=Options(gradient=0.18, p_brake=5e5, duration=20.0),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
