"""Brake application by the pedal: the foot force rises, holds, and falls."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated

import numpy as np
from pydantic import Field

from bywire.authoring import (
    Array,
    Case,
    Duration,
    Experiment,
    Figures,
    Kpi,
    ParameterSet,
    Recordings,
    TimeConstant,
    Unit,
)
from one_box.model import OneBox, released
from one_box.parameters import OneBoxParameters

FootForce = Annotated[float, Unit("N", 100.0), Field(gt=0, allow_inf_nan=False)]
FIGURES = Figures(
    undefined="the pressure does not reach this level before the pedal is released",
    time_to_90=("s", "Time from the start of the foot force to 90 % of the held wheel pressure."),
    wheel_pressure=("Pa", "Wheel pressure at the end of the hold."),
    overshoot=("Pa", "Largest plunger pressure above the held pressure demand."),
    error_held=("Pa", "Pressure demand minus plunger pressure at the end of the hold."),
    pedal_travel=("m", "Pedal travel at the end of the hold."),
    time_to_release=("s", "Time from the release to 10 % of the held wheel pressure."),
    current_max=("A", "Largest motor current."),
    supply_energy=("J", "Energy from the battery."),
    volume_error=("m**3", "Largest residual of the fluid volume balance."),
)


class Options(ParameterSet):
    """The foot force."""

    F_foot: FootForce
    """foot force"""
    t_rise: TimeConstant
    """rise time and fall time of this force"""
    t_hold: Duration
    """time from the beginning to the release"""
    t_end: Duration
    """recording time after the release"""


def pressed(options: Options) -> Callable[[Array], Mapping[str, Array]]:
    """Return the stimulus: a trapezoid of the foot force."""
    rise = max(options.t_rise, 1e-9)

    def stimulus(t: Array) -> Mapping[str, Array]:
        up = np.clip(t / rise, 0.0, 1.0)
        down = np.clip((t - options.t_hold) / rise, 0.0, 1.0)
        return {"F_foot": options.F_foot * (up - down)}

    return stimulus


def cases(par: OneBoxParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run."""
    driven = par.replace({"drive": "pedal"})
    return (
        Case(
            "run",
            OneBox(),
            driven,
            *released(driven),
            pressed(options),
            options.t_hold + options.t_end,
            start=released,
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures of application and release."""
    run = recordings["run"]
    t, p, p_mc = (run[name].values for name in ("time", "p", "p_mc"))
    hold = int(np.searchsorted(t, options.t_hold - 1e-9))
    held, demand = float(p[hold]), float(run["p_ref"][hold])
    applied = (t >= 0.0) & (t <= options.t_hold)
    return FIGURES(
        time_to_90=_first(t[applied & (p >= 0.9 * held)], 0.0),
        wheel_pressure=held,
        overshoot=float(p_mc.max()) - demand,
        error_held=demand - float(p_mc[hold]),
        pedal_travel=float(run["x_foot"][hold]),
        time_to_release=_first(t[~applied & (t > 0.0) & (p <= 0.1 * held)], options.t_hold),
        current_max=float(abs(run["i"]).max()),
        supply_energy=float(run["E_source"][-1] - run["E_source"][0]),
        volume_error=float(abs(run["V_missing"]).max()),
    )


def _first(times: Array, start: float) -> float:
    """Return the first of some times, relative to a start."""
    return float(times[0]) - start if times.size else math.nan


EXPERIMENT = Experiment(
    name="pedal-apply",
    assembly="one-box",
    summary="the foot presses with {F_foot} for {t_hold:s}, then releases",
    options=Options,
    defaults=Options(F_foot=80.0, t_rise=0.1, t_hold=1.0, t_end=0.8),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
