"""Stop from a speed: a pressure demand at time zero, on a dry road."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from bywire.authoring import (
    Case,
    Experiment,
    Figures,
    Kpi,
    Recordings,
    Unit,
)
from truck_ebs.experiments.ebs_response import DemandOptions, demanded
from truck_ebs.model import TruckEbs, rolling
from truck_ebs.parameters import TruckParameters

RidingSpeed = Annotated[float, Unit("m/s", 20.0), Field(gt=0, allow_inf_nan=False)]
FIGURES = Figures(
    undefined="the vehicle does not stop within the recording",
    stopping_distance=("m", "Distance from the demand to standstill."),
    mean_deceleration=("m/s**2", "Initial speed squared over twice the stopping distance."),
    peak_slip=("1", "Largest slip above a tenth of the initial speed."),
    clamp_force=("N", "Largest clamp force."),
)


class Options(DemandOptions):
    """The stop."""

    v_0: RidingSpeed
    """initial speed"""


def cases(par: TruckParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run."""
    return (
        Case(
            "run",
            TruckEbs(),
            par,
            *rolling(par, options.v_0),
            demanded(options.p_brake, 0.0),
            options.duration,
            start=lambda par: rolling(par, options.v_0),
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures of the stop."""
    run = recordings["run"]
    v, s = run["v_x"].values, run["s"].values
    still = np.flatnonzero(v <= 1e-3)
    distance = float(s[still[0]]) if still.size and s[still[0]] > 0.0 else math.nan
    fast = v > 0.1 * options.v_0
    return FIGURES(
        stopping_distance=distance,
        mean_deceleration=options.v_0**2 / (2.0 * distance),
        peak_slip=float(run["slip"].values[fast].max(initial=0.0)),
        clamp_force=float(run["F_cl"].max()),
    )


EXPERIMENT = Experiment(
    name="ebs-stop",
    assembly="truck-ebs",
    summary="stop from {v_0:km/h} with {p_brake:bar}",
    options=Options,
    defaults=Options(v_0=80.0 / 3.6, p_brake=5e5, duration=7.0),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
