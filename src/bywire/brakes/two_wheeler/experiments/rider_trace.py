"""Rider trace: the rider's demand follows a measured file or any stimulus."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.experiment import Case, Experiment
from bywire.bench.kpis import vehicle_stop
from bywire.bench.kpis.families import units_of
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.bench.stimulus import Stimulus
from bywire.brakes.two_wheeler.case import JUDGE, Course, on_surface, rolling_case
from bywire.brakes.two_wheeler.parameters import TwoWheelerParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.plant import brake_disc
from bywire.plant.road import SurfaceName
from bywire.vehicle.ideal_stop import RidingSpeed

if TYPE_CHECKING:
    import xarray as xr

# The built-in ride is our choice: a light pull, a short hesitation, then full hand force.
_TIMES = (0.0, 0.25, 0.9, 1.1, 1.3, 1.5, 3.0)  # s
_FRONT = (0.0, 8e5, 10e5, 4e5, 5e5, 38e5, 34e5)  # Pa
_REAR = (0.0, 3e5, 6e5, 6e5, 8e5, 20e5, 20e5)  # Pa
_DRIVEN = {"p_f_set": _FRONT, "p_r_set": _REAR}

FIGURES = Figures(
    undefined="the rider's demand is zero",
    rider_share_front=(
        "%",
        "Ratio of the time integrals of front pressure and its demand, until standstill.",
    ),
    rider_share_rear=(
        "%",
        "Ratio of the time integrals of rear pressure and its demand, until standstill.",
    ),
    rider_share=("%", "The same ratio for the total torque of both brakes."),
)


class Options(ParameterSet):
    """The ride. Demands are [stimulus.p_f_set] and [stimulus.p_r_set], or the built-in trace."""

    v_0: RidingSpeed
    """initial speed"""
    surface: SurfaceName
    """road surface"""
    duration: Duration
    """recording time"""


def driven(_: Options) -> Mapping[str, str]:
    """Return the unit of the demands."""
    return dict.fromkeys(_DRIVEN, "Pa")


def cases(
    par: TwoWheelerParameters, options: Options, stimuli: Mapping[str, Stimulus] | None = None
) -> tuple[Case, ...]:
    """Return the single run. If the user sets only one demand, the other is zero."""
    custom: dict[str, float | Course] = {
        name: each.sample for name, each in (stimuli or {}).items()
    }
    built_in: dict[str, float | Course] = {name: _course(p) for name, p in _DRIVEN.items()}
    demands = {**dict.fromkeys(_DRIVEN, 0.0), **custom} if custom else built_in
    return (rolling_case(par, options.v_0, demands, options.duration, on_surface(options.surface)),)


def _course(values: tuple[float, ...]) -> Course:
    return lambda t: np.interp(t, _TIMES, values)


def _parameters_of(run: xr.Dataset) -> TwoWheelerParameters:
    """Return the parameters of a recording."""
    par = getattr(run, "par", None)  # an attribute of plain rows
    if isinstance(par, TwoWheelerParameters):
        return par
    return TwoWheelerParameters.model_validate_json(run.attrs["parameters"])


def rider_shares(run: xr.Dataset, _: Options) -> tuple[Kpi, ...]:
    """Return the fractions of the rider's demand that the brakes apply."""
    return FIGURES(**_shares(run))


def _shares(run: xr.Dataset) -> dict[str, float]:
    par = _parameters_of(run)
    t = run["time"].values
    end = vehicle_stop.standstill(t, run["v"].values)
    braked = (t >= 0.0) & (t <= (end if math.isfinite(end) else math.inf))
    left, asked = 0.0, 0.0
    shares = {}
    for wheel, side, disc in (("front", "f", par.front.disc), ("rear", "r", par.rear.disc)):
        p, demanded = (
            float(np.trapezoid(run[name].values[braked], t[braked]))
            for name in (f"p_{side}", f"p_{side}_set")
        )
        shares[f"rider_share_{wheel}"] = 100.0 * p / demanded if demanded > 0 else math.nan
        torque = brake_disc.torque_per_pressure(disc)
        left, asked = left + torque * p, asked + torque * demanded
    return {**shares, "rider_share": 100.0 * left / asked if asked > 0 else math.nan}


EXPERIMENT = Experiment(
    name="rider-trace",
    assembly="two-wheeler-by-wire",
    summary="stop from {v_0} on {surface} with a built-in or measured trace of the rider's demand",
    options=Options,
    defaults=Options(v_0=30.0, surface="wet-asphalt", duration=8.0),
    cases=cases,
    judge=replace(
        JUDGE, further=rider_shares, further_signals=("v", "p_f", "p_r", "p_f_set", "p_r_set")
    ),
    kpis=FIGURES.units | units_of("vehicle_stop"),
    figures=("road-marks", "time-traces", "energy-balance"),
    beside=driven,
)
