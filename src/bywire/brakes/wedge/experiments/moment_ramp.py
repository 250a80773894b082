"""Moment ramp: a step, a reduction, and a slow ramp back (Roberts 2003, Fig. 8)."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from pydantic import model_validator

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import BRAKING, braking, case_from_parked, steps
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rows import along_disc, too_coarse
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.core.typing import Array

_ROWS = 10  # fewest on the ramp

FIGURES = Figures(
    ramp_error_mean=("N*m", "Mean of demand less moment, ramp."),
    ramp_error_rms=(
        "N*m",
        "Root mean square of demand less moment on the ramp; the run-out is in it.",
    ),
    ramp_slope=("N*m/s", "Slope of a line through the moment on the ramp."),
)


class Options(ParameterSet):
    """The braking maneuver; its times are ours, the figure's text gives none."""

    M_high: SomeMoment
    """moment demanded at first, and at the end of the ramp"""
    M_low: SomeMoment
    """moment from which the ramp starts"""
    t_hold: Duration
    """time from the step to the reduction"""
    t_low: Duration
    """time at the lower moment"""
    t_ramp: Duration
    """length of the ramp"""
    t_end: Duration
    """time recorded after the ramp"""
    settle: Duration
    """time parked before the step"""

    @model_validator(mode="after")
    def _rises(self) -> Options:
        if self.M_low > self.M_high:
            raise ValueError(
                f"M_low = {self.M_low:g} N*m must not be above M_high = {self.M_high:g} N*m: "
                "the ramp rises from M_low to M_high"
            )
        return self


def demand(t: Array, options: Options) -> Array:
    """Return the moment demand [N m] at times t [s], shape (len(t),)."""
    begin = options.t_hold + options.t_low
    ramp = np.clip((t - begin) / options.t_ramp, 0.0, 1.0)
    stepped = steps(t, {0.0: options.M_high, options.t_hold: options.M_low})
    return stepped + (options.M_high - options.M_low) * ramp


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the one run."""
    duration = options.t_hold + options.t_low + options.t_ramp + options.t_end
    return (
        case_from_parked(
            par,
            lambda t: {"M_set": demand(t, options)},
            duration,
            settle=options.settle,
            keep=options.settle,
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the figures of the braking, and how well the ramp is followed."""
    run = along_disc(recordings["run"])
    begin = options.t_hold + options.t_low
    end = begin + options.t_ramp
    problem = too_coarse(run, begin, end, _ROWS)
    mean, rms, slope = (math.nan,) * 3 if problem else _followed(run, begin, end)
    ramp = FIGURES(
        ramp_error_mean=(mean, problem), ramp_error_rms=(rms, problem), ramp_slope=(slope, problem)
    )
    return (*braking(run, options.M_high, options.t_hold), *ramp)


def _followed(run: xr.Dataset, begin: float, end: float) -> tuple[float, float, float]:
    """Return mean and root mean square of the error [N m], and the moment's slope [N m/s]."""
    ramp = run.sel(time=slice(begin - 1e-9, end + 1e-9))
    error = (ramp["M_set"] - ramp["M_B"]).values
    slope = float(np.polyfit(ramp["time"].values, ramp["M_B"].values, 1)[0])
    return float(error.mean()), float(np.sqrt(np.mean(error**2))), slope


EXPERIMENT = Experiment(
    name="moment-ramp",
    assembly="wedge-brake",
    summary="moment step to {M_high}, down to {M_low}, slow ramp back (Fig. 8)",
    options=Options,
    defaults=Options(
        M_high=200.0, M_low=160.0, t_hold=0.5, t_low=0.3, t_ramp=1.0, t_end=0.3, settle=0.05
    ),
    cases=cases,
    judge=judge,
    kpis=BRAKING.units | FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
