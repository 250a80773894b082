"""Slow application and release: hysteresis of relay valve, lever and pads."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from bywire.authoring import Case, Experiment, Figures, Kpi, Recordings
from truck_ebs.experiments.ebs_response import DemandOptions, on_rig
from truck_ebs.parameters import TruckParameters

Array = NDArray[np.float64]
FIGURES = Figures(
    undefined="the pads do not touch",
    threshold_pressure=("Pa", "Chamber pressure at which the pads touch during application."),
    pressure_error=("Pa", "Largest difference between demand and pressure above 1 bar."),
    force_hysteresis=("%", "Largest force difference at equal pressure, in % of the largest."),
    clamp_force=("N", "Clamp force at the demanded pressure."),
)
_ABOVE = 1e5  # Pa, where the pads touch and the valve has settled


def demand(options: DemandOptions) -> Callable[[Array], Mapping[str, Array]]:
    """Return the stimulus: up to the pressure in half of the time, and down."""

    def at(t: Array) -> Mapping[str, Array]:
        share = 1.0 - np.abs(2.0 * np.clip(t / options.duration, 0.0, 1.0) - 1.0)
        return {"p_set": options.p_brake * share}

    return at


def cases(par: TruckParameters, options: DemandOptions, _: object = None) -> tuple[Case, ...]:
    """Return the single run."""
    return on_rig(par, demand(options), options.duration)


def judge(recordings: Recordings, options: DemandOptions) -> tuple[Kpi, ...]:
    """Return the key figures of both branches."""
    run = recordings["run"]
    t, p, F, p_ref = (run[name].values for name in ("time", "p", "F_cl", "p_ref"))
    if not F.max() > 0.0:
        return FIGURES(**dict.fromkeys(FIGURES.units, np.nan))
    up, down = (t >= 0.0) & (t < 0.5 * options.duration), t > 0.5 * options.duration
    levels = np.linspace(_ABOVE, 0.95 * p.max(), 200)
    applied = np.interp(levels, np.maximum.accumulate(p[up]), F[up])
    released = np.interp(levels, np.maximum.accumulate(p[down][::-1]), F[down][::-1])
    settled = (p_ref > _ABOVE) & (t > 0.0)
    return FIGURES(
        threshold_pressure=float(p[up][np.argmax(F[up] > 1.0)]),
        pressure_error=float(np.abs(p_ref - p)[settled].max()),
        force_hysteresis=100.0 * float(np.max(released - applied)) / float(F.max()),
        clamp_force=float(F.max()),
    )


EXPERIMENT = Experiment(
    name="ebs-hysteresis",
    assembly="truck-ebs",
    summary="slowly to {p_brake:bar} and back within {duration:s}: hysteresis",
    options=DemandOptions,
    defaults=DemandOptions(p_brake=6e5, duration=12.0),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("clamp-over-pressure", "time-traces", "energy-balance"),
)
