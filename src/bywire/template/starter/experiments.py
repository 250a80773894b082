"""Experiments of the brake starter, for ``bywire run``. Generic experiments need no code."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import Field

from bywire.authoring import (
    Case,
    Duration,
    Experiment,
    Kpi,
    ParameterSet,
    Recordings,
    Unit,
    evaluate,
    step_response,
    units_of,
    zeros,
)
from bywire.template.starter.model import Memory, StarterActuator
from bywire.template.starter.parameters import Parameters


class Options(ParameterSet):
    """Options of the brake application."""

    F_set: Annotated[float, Unit("N", 1e4), Field(gt=0, allow_inf_nan=False)]
    """demanded clamp force"""
    duration: Duration
    """duration of the demand"""
    release: Duration
    """recording time after the release"""


def cases(par: Parameters, options: Options, _: Any) -> tuple[Case, ...]:
    """Return the only run, from the open caliper to the force and back."""

    def stimulus(t: np.ndarray) -> dict[str, np.ndarray]:
        return {"F_set": np.where((t >= 0.0) & (t < options.duration), options.F_set, 0.0)}

    model = StarterActuator()
    return (
        Case(
            "run",
            model,
            par,
            zeros(model.State),
            zeros(Memory),
            stimulus,
            duration=options.duration + options.release,
            start=lambda _: (zeros(model.State), zeros(Memory)),
        ),
    )


def step(options: Options) -> step_response.Setting:
    """Return the step of the clamp force, judged during the hold."""
    window = (0.8 * options.duration, options.duration)
    return step_response.Setting("F", 0.0, 0.0, options.F_set, window)


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures of the brake application."""
    held = recordings["run"].sel(time=slice(None, options.duration - 1e-9))
    return tuple(evaluate("step_response", held, step(options)).values())


EXPERIMENT = Experiment(
    name="starter-clamp",
    assembly="starter-actuator",
    summary="clamp across the clearance, hold, release",
    options=Options,
    defaults=Options(F_set=15e3, duration=0.6, release=0.4),
    cases=cases,
    judge=judge,
    kpis=units_of("step_response", resolved={"level": "N"}),
    figures=("step-response", "time-traces"),
    step=step,
)
