"""Stop from a speed: a pressure demand at time zero, on any surface."""

from __future__ import annotations

import json
import math
from typing import Any, cast

import numpy as np
import xarray as xr

from bywire.authoring import Case, Experiment, Figures, Kpi, Recordings
from bywire.plant import road
from bywire.vehicle import CornerParameters, RidingSpeed, ideal_corner_distance, surfaces
from truck_ebs import model
from truck_ebs.experiments.ebs_response import DemandOptions, demanded
from truck_ebs.models import abs as with_abs
from truck_ebs.models import park
from truck_ebs.parameters import AbsTruckParameters, ParkTruckParameters, TruckParameters

_SLOW = 2.0  # m/s, below which a wheel may lock
FIGURES = Figures(
    undefined="the vehicle does not stop within the recording. Increase options.duration",
    stopping_distance=("m", "Distance from the demand to standstill."),
    mean_deceleration=("m/s**2", "Initial speed squared over twice the stopping distance."),
    braking_efficiency=("%", "Ratio of the ideal stopping distance on this road to the actual."),
    peak_slip=("1", "Largest slip above a tenth of the initial speed."),
    locked_time=("s", f"Time with a locked wheel at speeds above {_SLOW:g} m/s."),
    clamp_force=("N", "Largest clamp force."),
    air_used=("kg", "Air from reservoir or compressor until the stop."),
)


class Options(DemandOptions):
    """The stop."""

    v_0: RidingSpeed
    """initial speed"""
    surface: road.SurfaceName
    """road surface; own keeps the set's surface"""


def started(par: TruckParameters, v: float) -> tuple[Any, tuple[Any, Any]]:
    """Return the variant that has these parameters, and its start at a speed [m/s]."""
    if hasattr(par, "modulator"):
        return with_abs.TruckAbs(), with_abs.rolling(cast(AbsTruckParameters, par), v)
    if hasattr(par, "spring"):
        return park.TruckPark(), park.rolling(cast(ParkTruckParameters, par), v)
    return model.TruckEbs(), model.rolling(par, v)


def cases(par: TruckParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run of any variant."""
    changed = par.replace(surfaces.laid("corner.road", options.surface))
    truck, (state, memory) = started(changed, options.v_0)
    demand = demanded(options.p_brake, 0.0)
    return (
        Case(
            "run",
            truck,
            changed,
            state,
            memory,
            demand,
            options.duration,
            start=lambda par: started(par, options.v_0)[1],
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures of the stop."""
    run = recordings["run"]
    t, v = run["time"].values, run["v_x"].values
    still = np.flatnonzero((v <= 1e-3) & (t > 0.0))
    end = still[0] if still.size else -1
    distance = float(run["s"].values[end]) if still.size else 0.0
    distance = distance if distance > 0.0 else math.nan
    locked = (run["omega"].values == 0.0) & (v > _SLOW)
    return FIGURES(
        stopping_distance=distance,
        mean_deceleration=options.v_0**2 / (2.0 * distance),
        braking_efficiency=100.0 * _ideal(options.v_0, run) / distance,
        peak_slip=float(run["slip"].values[v > 0.1 * options.v_0].max(initial=0.0)),
        locked_time=float(np.sum(np.diff(t)[locked[:-1]])),
        clamp_force=float(run["F_cl"].max()),
        air_used=float(run["m_fed"].values[end]) if still.size else math.nan,
    )


def _ideal(v_0: float, run: xr.Dataset) -> float:
    """Return the shortest stopping distance [m] on this road."""
    corner = CornerParameters.model_validate(json.loads(run.attrs["parameters"])["corner"])
    return ideal_corner_distance(v_0, corner)


EXPERIMENT = Experiment(
    name="ebs-stop",
    assembly="truck-ebs",
    variants=("truck-abs", "truck-park"),
    summary="stop from {v_0:km/h} with {p_brake:bar} (surface: {surface})",
    options=Options,
    defaults=Options(v_0=80.0 / 3.6, p_brake=5e5, surface="own", duration=7.0),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
