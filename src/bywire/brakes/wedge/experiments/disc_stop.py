"""Disc stop: the brake stops a disc with little energy, holds it, and releases it.

Roberts et al. (2003), section "Wedge and calliper", drop the pad's friction on the wedge once the
disc is at rest. In the other reading the pad then sticks to the disc. The experiment runs both.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import (
    case_from_parked,
    mean,
    parameters_of,
    parking_time,
    release_time,
    steps,
    swing,
)
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.plant.flywheel import DiscSpeed

if TYPE_CHECKING:
    import xarray as xr

READINGS = ("drop", "stick")
_CALM = 0.05  # time after the stop [s] in which wedge and current may still move

FIGURES = Figures(
    stopping_time=("s", "Time from the demand until the disc is at rest."),
    stopping_angle=("rad", "Angle that the disc turns in that time."),
    moment_before_stop=("N*m", "Mean moment in the last tenth of braking, including runout."),
    force_before_stop=("N", "Mean normal force in the last tenth of braking."),
    force_held=("N", f"Mean normal force from {_CALM:g} s after the stop to the release."),
    force_change=("N", "Peak-to-peak normal force in that time."),
    reference_change=(
        "rad",
        "Windup: travel of the common reference toward clamping while the disc is at rest.",
    ),
    hold_power=(
        "W",
        f"Mean input power from {_CALM:g} s after the stop to the release, including standby.",
    ),
)
_UNITS = {**FIGURES.units, "release_time": "s", "parking_time": "s"}


class Options(ParameterSet):
    """The maneuver."""

    M_brake: SomeMoment
    """moment demand"""
    Omega_0: DiscSpeed
    """initial disc speed; with the flywheel's inertia, it determines the energy to absorb"""
    t_hold: Duration
    """time from the start of braking until the demand falls to zero"""
    t_end: Duration
    """recording time after the release"""
    settle: Duration
    """time parked before braking"""


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return one run for each reading of the pads' effect on the wedge with the disc at rest."""
    levels = {0.0: options.M_brake, options.t_hold: 0.0}
    return tuple(
        case_from_parked(
            par,
            lambda t: {"M_set": steps(t, levels)},
            options.t_hold + options.t_end,
            {
                "flywheel.law": "coasting",
                "flywheel.Omega_0": options.Omega_0,
                "wedge_friction.stopped_disc": reading,
            },
            label=reading,
            settle=options.settle,
            keep=options.settle,
        )
        for reading in READINGS
    )


def stop_figures(run: xr.Dataset, options: Options) -> dict[str, float] | str:
    """Return a run's key figures around standstill, or the reason for not having any."""
    braked = run.sel(time=slice(-1e-9, options.t_hold - 1e-9))
    turns = np.abs(braked["Omega"].values) > parameters_of(run).flywheel.Omega_still
    if not turns[:1].any():
        return "the disc is at rest from the start"
    if turns[-1]:
        return "the disc is still turning when the demand falls to zero"
    k = int(np.flatnonzero(turns)[-1]) + 1
    turning, standing = braked.isel(time=slice(None, k)), braked.isel(time=slice(k, None))
    stop = float(standing["time"].values[0])
    begin, end = stop + _CALM, options.t_hold
    if begin > float(braked["time"].values[-1]):
        return f"the disc is at rest for less than {_CALM:g} s before the demand falls to zero"
    reference = np.abs(standing["theta_ref"].values)
    return {
        "stopping_time": stop,
        "stopping_angle": abs(float(standing["phi"].values[0] - turning["phi"].values[0])),
        "moment_before_stop": _last_tenth(turning, "M_B"),
        "force_before_stop": _last_tenth(turning, "F_N"),
        "force_held": mean(standing, "F_N", begin, end),
        "force_change": swing(standing, "F_N", begin, end),
        "reference_change": float(reference[-1] - reference[0]),
        "hold_power": mean(standing, "P_in", begin, end),
    }


def _last_tenth(turning: xr.Dataset, signal: str) -> float:
    """Return the mean magnitude of a signal over the last tenth of braking."""
    rows = np.abs(turning[signal].values)
    return float(rows[-max(1, rows.size // 10) :].mean())


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures of stop, hold and release for each reading."""
    kpis: list[Kpi] = []
    for reading in READINGS:
        run = recordings[reading]
        stop = stop_figures(run, options)
        if isinstance(stop, str):
            kpis += FIGURES(f"_{reading}", **dict.fromkeys(FIGURES.units, (math.nan, stop)))
        else:
            kpis += FIGURES(f"_{reading}", **stop)
        kpis.append(release_time(run, options.t_hold, f"release_time_{reading}"))
        kpis.append(parking_time(run, options.t_hold, f"parking_time_{reading}"))
    return tuple(kpis)


EXPERIMENT = Experiment(
    name="disc-stop",
    assembly="wedge-brake",
    summary="braking to a stop with {M_brake}, hold and release, with two models of a stopped disc",
    options=Options,
    defaults=Options(M_brake=300.0, Omega_0=5.0, t_hold=1.5, t_end=0.3, settle=0.05),
    cases=cases,
    judge=judge,
    kpis={f"{name}_{reading}": unit for reading in READINGS for name, unit in _UNITS.items()},
    figures=("time-traces", "energy-balance"),
)
