"""Slow stop: from walking pace to standstill, brakes on, then held, on a slope or level."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis import vehicle_stop
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.two_wheeler.case import Demand, RidingSpeed, rolling_case
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.plant.road import Gradient

_QUIET = 1e-3  # m/s
_CALM = 2.0  # s after the stop

FIGURES = Figures(
    undefined="the vehicle does not stop in the recorded time",
    stopping_distance=("m", "Distance from time zero to the first standstill."),
    stopping_time=("s", "Time from zero to the first standstill."),
    rebound_speed=("m/s", "Largest speed backward after it: the tyres' give, the final jerk."),
    rollback=("m", "Distance from the farthest place to that at the end."),
    ringing_time=("s", f"Time from the standstill until the speed stays below {_QUIET:g} m/s."),
    creep_speed=("m/s", f"Largest speed from {_CALM:g} s after the first standstill on."),
    creep=("m", "Distance in that time."),
)


class Options(ParameterSet):
    """The stop, and the slope; slip and lift control stay off."""

    v_0: RidingSpeed
    """speed at the start"""
    p_front: Demand
    """front pressure that the rider demands"""
    p_rear: Demand
    """rear pressure that the rider demands"""
    gradient: Gradient
    """rise over run, uphill positive"""
    duration: Duration
    """time recorded"""


def cases(par: TwoWheelerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the one run."""
    demands = {"p_f_set": options.p_front, "p_r_set": options.p_rear}
    changes = {
        "vehicle.road.gradient": options.gradient,
        "vehicle.road.gradient_further": options.gradient,
        "ecu.abs": "off",
        "ecu.lift": "off",
        "ecu.p_rate": 1e12,  # the rider's hand is as fast as the circuit
    }
    return (rolling_case(par, options.v_0, demands, options.duration, changes),)


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return how the vehicle comes to rest, and how it stays there."""
    run = recordings["run"]
    end = vehicle_stop.standstill(run["time"].values, run["v"].values)
    if math.isnan(end):
        return FIGURES(**dict.fromkeys(FIGURES.units, math.nan))
    return FIGURES(**_rest(run, end))


def _rest(run: xr.Dataset, end: float) -> dict[str, float | tuple[float, str]]:
    t, x, v = (run[name].values for name in ("time", "x", "v"))
    after = t >= end
    loud = np.flatnonzero(np.abs(v) > _QUIET)[-1]
    rings = float(t[loud]) - end if loud + 1 < t.size else (math.nan, "it does not come to rest")
    late = t >= end + _CALM
    short = (math.nan, f"less than {_CALM:g} s are recorded after the stop")
    return {
        "stopping_distance": float(np.interp(end, t, x)),
        "stopping_time": end,
        "rebound_speed": float(np.max(-v[after])),
        "rollback": float(np.max(x) - x[-1]),
        "ringing_time": rings,
        "creep_speed": float(np.max(np.abs(v[late]))) if late.any() else short,
        "creep": float(np.ptp(x[late])) if late.any() else short,
    }


EXPERIMENT = Experiment(
    name="slow-stop",
    assembly="two-wheeler-by-wire",
    summary="stop from {v_0} without control, then held on level road or slope",
    options=Options,
    defaults=Options(v_0=3.0, p_front=40e5, p_rear=40e5, gradient=0.0, duration=5.0),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
