"""Response time of the brake at standstill: a full demand within 0.2 s."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from bywire.authoring import (
    Case,
    Duration,
    Experiment,
    Figures,
    Kpi,
    ParameterSet,
    Pressure,
    Recordings,
    TimeConstant,
)
from truck_ebs.parameters import TruckParameters
from truck_ebs.rigs.brake_rig import BrakeRig

Array = NDArray[np.float64]
FIGURES = Figures(
    undefined="the pressure does not reach this level within the recording",
    time_to_10=("s", "Time from the start of the demand to 10 % of the final pressure."),
    time_to_75=("s", "Time from the start of the demand to 75 % of the final pressure."),
    contact_time=("s", "Time from the start of the demand to pad contact."),
    final_pressure=("Pa", "Chamber pressure at the end."),
    clamp_force=("N", "Clamp force at the end."),
)


class DemandOptions(ParameterSet):
    """A demand from time zero."""

    p_brake: Pressure
    """demanded pressure"""
    duration: Duration
    """recording time"""


class Options(DemandOptions):
    """The demand."""

    t_pedal: TimeConstant
    """time in which the pedal is pressed"""


def demanded(p: float, t_pedal: float) -> Callable[[Array], Mapping[str, Array]]:
    """Return the stimulus that rises to a pressure [Pa] within a time [s]."""

    def demand(t: Array) -> Mapping[str, Array]:
        share = np.where(t >= 0.0, 1.0, 0.0) if t_pedal == 0.0 else np.clip(t / t_pedal, 0.0, 1.0)
        return {"p_set": p * share}

    return demand


def on_rig(
    par: TruckParameters, demand: Callable[[Array], Mapping[str, Array]], duration: float
) -> tuple[Case, ...]:
    """Return the single run of a brake on the rig, from its released state."""
    rig = BrakeRig()
    return (Case("run", rig, par, *rig.rest(par), demand, duration, start=rig.rest),)


def cases(par: TruckParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run."""
    return on_rig(par, demanded(options.p_brake, options.t_pedal), options.duration)


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the response times, interpolated between the samples."""
    run = recordings["run"]
    t, p, F = (run[name].values for name in ("time", "p", "F_cl"))
    return FIGURES(
        time_to_10=_crossing(t, p, 0.10 * p[-1]),
        time_to_75=_crossing(t, p, 0.75 * p[-1]),
        contact_time=_crossing(t, F, 1.0),
        final_pressure=float(p[-1]),
        clamp_force=float(F[-1]),
    )


def _crossing(t: Array, y: Array, level: float) -> float:
    """Return the first time at which a signal exceeds a level."""
    above = np.flatnonzero((y >= level) & (t >= 0.0))
    if not above.size or above[0] == 0:
        return math.nan
    k = above[0]
    return float(t[k - 1] + (level - y[k - 1]) / (y[k] - y[k - 1]) * (t[k] - t[k - 1]))


EXPERIMENT = Experiment(
    name="ebs-response",
    assembly="truck-ebs",
    summary="{p_brake:bar} within {t_pedal:s}: time to 10 % and to 75 %",
    options=Options,
    defaults=Options(p_brake=7e5, t_pedal=0.2, duration=1.5),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
