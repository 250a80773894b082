"""Surface jump: the road turns from one surface into another below a vehicle that brakes hard."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case, Experiment
from bywire.bench.kpis import vehicle_stop
from bywire.bench.kpis.families import units_of
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.two_wheeler.case import (
    JUDGE,
    Demand,
    RidingSpeed,
    on_surface,
    rolling_case,
    vehicle_of,
)
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.plant import adhesion, road
from bywire.plant.road import Distance, SurfaceName

_CALM = 1.2  # of the peak's slip

FIGURES = Figures(
    recovery_time=(
        "s",
        "Time from the front wheel's step onto the further surface until its slip stays below "
        f"{_CALM:g} of the slip of the peak there, above {vehicle_stop.SLOW:g} m/s.",
    ),
    jump_speed=("m/s", "Speed at that step."),
)


class Options(ParameterSet):
    """The stop, and the two surfaces."""

    v_0: RidingSpeed
    """speed at the start"""
    p_front: Demand
    """front pressure that the rider demands"""
    p_rear: Demand
    """rear pressure that the rider demands"""
    first: SurfaceName
    """surface at the start"""
    further: SurfaceName
    """surface from x_change on"""
    x_change: Distance
    """where that begins"""
    duration: Duration
    """time recorded"""


def cases(par: TwoWheelerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the one run."""
    demands = {"p_f_set": options.p_front, "p_r_set": options.p_rear}
    changes = {
        **on_surface(options.first, options.further),
        "vehicle.road.x_change": options.x_change,
        "vehicle.road.x_back": options.x_change + 1e6,
    }
    return (rolling_case(par, options.v_0, demands, options.duration, changes),)


def recovery(run: xr.Dataset, options: Options) -> tuple[Kpi, ...]:
    """Return how the front wheel takes the further surface."""
    return FIGURES(**_recovery(run, options))


def _recovery(run: xr.Dataset, options: Options) -> dict[str, float | tuple[float, str]]:
    t, x, v = (run[name].values for name in ("time", "x", "v"))
    if not np.any(x > options.x_change):
        undefined = (math.nan, "the vehicle stops before the further surface")
        return {"recovery_time": undefined, "jump_speed": undefined}
    k = int(np.argmax(x > options.x_change))
    begin = float(np.interp(options.x_change, x[: k + 1], t[: k + 1]))
    ground = road.surface(options.x_change + 1.0, vehicle_of(run).road)
    beyond = (t > begin) & (v > vehicle_stop.SLOW)
    peak = adhesion.peak_slip(ground, vehicle_of(run).front_tyre)
    beyond &= run["slip_f"].values > _CALM * peak
    last = float(t[np.flatnonzero(beyond)[-1]]) if beyond.any() else begin
    return {"recovery_time": last - begin, "jump_speed": float(np.interp(begin, t, v))}


EXPERIMENT = Experiment(
    name="surface-jump",
    assembly="two-wheeler-by-wire",
    summary="panic stop from {v_0}, {first} turns {further} after {x_change:m}",
    options=Options,
    defaults=Options(
        v_0=30.0,
        p_front=40e5,
        p_rear=40e5,
        first="dry-asphalt",
        further="wet-asphalt",
        x_change=15.0,
        duration=6.0,
    ),
    cases=cases,
    judge=replace(JUDGE, further=recovery, further_signals=("x", "v", "slip_f")),
    kpis=FIGURES.units | units_of("vehicle_stop"),
    figures=("road-marks", "time-traces", "energy-balance"),
)
