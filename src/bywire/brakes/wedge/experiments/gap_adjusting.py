"""Gap adjusting: several applications with excess clearance, which an adjuster removes.

Roberts et al. (2003) plan an adjustment mechanism for their next prototype. The maneuver is ours.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import along_disc, case_from_parked, first, steps
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Unit

Count = Annotated[int, Unit("1", 5.0), Field(ge=1, le=100)]
Growth = Annotated[float, Unit("m", 2e-4), Field(ge=-1e-2, le=1e-2, allow_inf_nan=False)]

FIGURES = Figures(
    clicks=("1", "Teeth turned by the adjuster."),
    teeth_counted=("1", "Teeth counted by the adjuster as a measure of wear."),
    turned_after=("1", "Number of applications before the adjuster first turns."),
    clearance_start=("m", "Clearance at the start."),
    clearance_end=("m", "Clearance at the end."),
    gap_error=("m", "Clearance estimated by the adjuster at the end, minus the true clearance."),
    contact_first=("s", "Time to pad contact, first application."),
    contact_last=("s", "Time to pad contact, last application."),
    adjuster_work=("J", "Work of the adjuster on the caliper, 0 if it turns within the gap."),
    undefined="the pads do not touch the disc, or the adjuster does not turn",
)


class Options(ParameterSet):
    """The maneuver."""

    M_brake: SomeMoment
    """moment of each application"""
    more: Growth
    """excess clearance due to wear; the brake's stored contact angle is correct"""
    applications: Count
    """number of applications"""
    t_hold: Duration
    """length of each application"""
    t_pause: Duration
    """time between applications, and after the last one"""
    settle: Duration
    """time parked before the first application"""


def _begins(options: Options) -> list[float]:
    return [k * (options.t_hold + options.t_pause) for k in range(options.applications)]


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run. A driven disc makes conditions equal in all applications."""
    begins = _begins(options)
    levels = {begin: options.M_brake for begin in begins}
    levels |= {begin + options.t_hold: 0.0 for begin in begins}
    changes = {
        "adjuster.law": "screw",
        "flywheel.law": "driven",
        "caliper.clearance": par.caliper.clearance + options.more,
    }
    return (
        case_from_parked(
            par,
            lambda t: {"M_set": steps(t, levels)},
            begins[-1] + options.t_hold + options.t_pause,
            changes,
            settle=options.settle,
            keep=options.settle,
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the adjuster's turns and their effect on the clearance."""
    run = along_disc(recordings["run"])
    after = run.sel(time=slice(-1e-9, None))
    clicks, clearance = after["clicks"].values, after["clearance"].values
    begins = _begins(options)
    turned = np.flatnonzero(after["adjusting"].values > 1.5)
    until = after["time"].values[turned[0]] if turned.size else np.nan
    contacts = [
        first(after.sel(time=slice(begin, begin + options.t_hold)), "F_N", 0.0) - begin
        for begin in (begins[0], begins[-1])
    ]
    return FIGURES(
        clicks=clicks[-1],
        teeth_counted=after["teeth"].values[-1],
        turned_after=np.searchsorted(begins, until) if turned.size else np.nan,
        clearance_start=clearance[0],
        clearance_end=clearance[-1],
        gap_error=after["gap_hat"].values[-1] - clearance[-1],
        contact_first=contacts[0],
        contact_last=contacts[1],
        adjuster_work=after["W_adjuster"].values[-1],
    )


EXPERIMENT = Experiment(
    name="gap-adjusting",
    assembly="wedge-brake",
    summary="applications with {more} excess clearance, which the adjuster removes",
    options=Options,
    defaults=Options(
        M_brake=200.0, more=0.25e-3, applications=5, t_hold=0.25, t_pause=0.25, settle=0.05
    ),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
