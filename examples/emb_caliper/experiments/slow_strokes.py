"""Slow strokes to a clamp force and back at constant motor speeds, which show friction."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

import numpy as np
import xarray as xr
from pydantic import Field, model_validator

from bywire.authoring import (
    Case,
    Duration,
    Experiment,
    Kpi,
    Nodes,
    ParameterSet,
    Recordings,
    Stimulus,
    Unit,
)
from emb_caliper.case import Array, case_from_rest
from emb_caliper.parameters import BrakeParameters
from emb_caliper.trim import state_at

TopForce = Annotated[float, Unit("N", 1e4), Field(gt=0, allow_inf_nan=False)]


class Options(ParameterSet):
    """The strokes."""

    F_top: TopForce
    """clamp force at which a stroke reverses"""
    speeds: Annotated[Nodes, Unit("rad/s", 10.0)]
    """motor speed of each stroke, both up and down"""
    record: Duration
    """recording interval; mean currents are wrong if it exceeds current control's sample time"""

    @model_validator(mode="after")
    def _moves(self) -> Options:
        if not self.speeds or min(self.speeds) <= 0.0:
            raise ValueError("speeds must contain at least one motor speed, each > 0 rad/s")
        return self


def turns(par: BrakeParameters, options: Options) -> Array:
    """Return the times [s] at which the speed demand changes, including the first and the last."""
    stroke = state_at(options.F_top, par).theta
    times = [stroke / speed for speed in options.speeds for _ in range(2)]
    return np.concatenate(([0.0], np.cumsum(times)))


def cases(par: BrakeParameters, options: Options, _: Stimulus | None = None) -> tuple[Case, ...]:
    """Return the single run, which starts from the parked piston, under speed control."""
    instants = turns(par, options)
    demands = np.array([way * speed for speed in options.speeds for way in (1.0, -1.0)])

    def stimulus(t: Array) -> dict[str, Array]:
        piece = np.searchsorted(instants, t, side="right") - 1
        demand = demands[np.clip(piece, 0, demands.size - 1)]
        return {"omega_set": np.where(t < instants[-1], demand, 0.0)}

    # The run ends a tenth of a second after the last turn.
    duration = round(float(instants[-1]) + 0.1, 3)
    return (case_from_rest(par, "speed", 0.0, stimulus, duration, record=options.record),)


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the currents of the first stroke at half the top force, applying and releasing."""
    run = recordings["run"]
    way, half = np.sign(run["omega"].values), 0.5 * options.F_top
    apply, release = (_current_at(run, half, way == sign) for sign in (1.0, -1.0))
    return (
        Kpi("F_max", float(run["F_cl"].max()), "N", "Maximum clamp force."),
        Kpi("current_apply", apply, "A", "Current at half the top force while applying slowly."),
        Kpi(
            "current_release",
            release,
            "A",
            "Current at half the top force while releasing slowly.",
        ),
        Kpi(
            "loop_width",
            apply - release,
            "A",
            "current_apply minus current_release, which is twice the friction.",
        ),
    )


def _current_at(run: xr.Dataset, level: float, moving: Array) -> float:
    """Return the current at the first crossing of a clamp force in one direction, or NaN."""
    F, i = run["F_cl"].values, run["i"].values
    for k, (a, b) in enumerate(pairwise(F)):
        if moving[k] and moving[k + 1] and (a - level) * (b - level) <= 0.0 and a != b:
            return float(i[k] + (level - a) / (b - a) * (i[k + 1] - i[k]))
    return float("nan")


EXPERIMENT = Experiment(
    name="slow-strokes",
    assembly="emb-caliper",
    variants=("emb-caliper-pmsm",),
    summary="to {F_top:kN} and back at constant motor speeds: friction versus load and speed",
    options=Options,
    defaults=Options(F_top=30e3, speeds=(20.0, 50.0, 120.0), record=2e-4),
    cases=cases,
    judge=judge,
    kpis={"F_max": "N", "current_apply": "A", "current_release": "A", "loop_width": "A"},
    figures=("time-traces", "friction-over-load", "energy-balance"),
)
