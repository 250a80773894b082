"""Rear lift: the front brake lifts the rear wheel, with or without lift control."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.two_wheeler.case import Demand, rolling_case, vehicle_of
from bywire.brakes.two_wheeler.parameters import PressureRate, TwoWheelerParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Factor
from bywire.vehicle.ideal_stop import RidingSpeed

if TYPE_CHECKING:
    import xarray as xr

FIGURES = Figures(
    undefined="the rear wheel stays on the ground",
    lift_time=("s", "Time until the rear wheel leaves the ground."),
    lift_deceleration=("m/s**2", "Deceleration when the rear wheel leaves the ground."),
    flat_limit=("m/s**2", "Static lift limit of the level body, g l_f/h."),
    time_to_5_deg=("s", "Time from the start of the lift to 5 degrees of pitch."),
    peak_pitch=("rad", "Maximum pitch, nose down."),
    air_time=("s", "Time during which the rear wheel is off the ground."),
)
_FIVE = math.radians(5.0)


class Options(ParameterSet):
    """The stop. Slip control stays off, and lift control is a parameter."""

    v_0: RidingSpeed
    """initial speed"""
    p_front: Demand
    """front pressure demand"""
    p_rate: PressureRate
    """front pressure build-up rate; if it is too high, the wheel locks before it is loaded"""
    grip: Factor
    """scale factor for the adhesion; sport tires have more grip than the car tires in the data"""
    duration: Duration
    """recording time"""


def cases(par: TwoWheelerParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run."""
    demands = {"p_f_set": options.p_front}
    changes = {"ecu.abs": "off", "ecu.p_rate": options.p_rate, "vehicle.road.grip": options.grip}
    return (rolling_case(par, options.v_0, demands, options.duration, changes),)


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return time and size of the rear wheel lift."""
    run = recordings["run"]
    body = vehicle_of(run).body
    flat = body.g * body.l_f / body.h
    off = run["support"].values <= 0
    values = _lift(run, off) if off.any() else dict.fromkeys(FIGURES.units, math.nan)
    if not off.any():
        values |= {"peak_pitch": float(np.max(run["phi"].values)), "air_time": 0.0}
    return FIGURES(**{**values, "flat_limit": flat})


def _lift(run: xr.Dataset, off: np.ndarray) -> dict[str, float | tuple[float, str]]:
    t, a, phi = (run[name].values for name in ("time", "a", "phi"))
    k = int(np.argmax(off))
    far = np.flatnonzero(phi > _FIVE)
    reached = (
        float(t[far[0]] - t[k]) if far.size else (math.nan, "the pitch does not reach 5 degrees")
    )
    return {
        "lift_time": float(t[k]),
        "lift_deceleration": float(a[k]),
        "time_to_5_deg": reached,
        "peak_pitch": float(np.max(phi)),
        "air_time": float(np.sum(np.diff(t)[off[:-1]])),
    }


EXPERIMENT = Experiment(
    name="rear-lift",
    assembly="two-wheeler-by-wire",
    summary="stop from {v_0} with only the front brake, {p_front} (lift control optional)",
    options=Options,
    defaults=Options(v_0=30.0, p_front=27e5, p_rate=60e5, grip=1.2, duration=1.5),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("road-marks", "time-traces", "energy-balance"),
)
