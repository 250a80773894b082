"""Disc stop: a disc of little energy is braked to standstill, held, and released.

Roberts et al. (2003), section "Wedge and calliper", drop the pad's friction on the wedge once the
disc stands; that the standing pad sticks is the other reading. Both are run.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.stimuli.registry import Stimulus
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

READINGS = ("drop", "stick")
_CALM = 0.05  # time after the stop [s] in which wedge and current may still move

_UNITS = {
    "stopping_time": "s",
    "stopping_angle": "rad",
    "moment_before_stop": "N*m",
    "force_before_stop": "N",
    "force_held": "N",
    "force_change": "N",
    "reference_change": "rad",
    "hold_power": "W",
    "release_time": "s",
    "parking_time": "s",
}


class Options(ParameterSet):
    """The maneuver."""

    M_brake: SomeMoment
    """moment demanded"""
    Omega_0: DiscSpeed
    """speed of the disc at the start; with the flywheel's inertia the energy to take"""
    t_hold: Duration
    """time from the start of braking until the demand falls to zero"""
    t_end: Duration
    """time recorded after it"""
    settle: Duration
    """time parked before braking"""


def cases(par: WedgeParameters, options: Options, _: Stimulus | None = None) -> tuple[Case, ...]:
    """Return one run for each reading of what the pads do to the wedge on a standing disc."""
    levels = {0.0: options.M_brake, options.t_hold: 0.0}
    return tuple(
        case_from_parked(
            par, lambda t: {"M_set": steps(t, levels)}, options.t_hold + options.t_end,
            {
                "flywheel.law": "coasting",
                "flywheel.Omega_0": options.Omega_0,
                "wedge_friction.stopped_disc": reading,
            },
            label=reading, settle=options.settle, keep=options.settle,
        )
        for reading in READINGS
    )  # fmt: skip


@dataclass(frozen=True)
class Stop:
    """The rows of a run around its standstill: braking, and standing until the release."""

    run: xr.Dataset
    turning: xr.Dataset
    standing: xr.Dataset
    t_release: float

    @property
    def begin(self) -> float:
        """Time [s] from which the held brake is judged."""
        return float(self.standing["time"].values[0]) + _CALM

    def moved(self, name: str) -> float:
        """Return how far a signal moves away from zero, from the standstill to the release."""
        values = np.abs(self.standing[name].values)
        return float(values[-1] - values[0])


def find_stop(run: xr.Dataset, options: Options) -> Stop | str:
    """Return the standstill of a run, or why there is none to judge."""
    braked = run.sel(time=slice(-1e-9, options.t_hold - 1e-9))
    turns = np.abs(braked["Omega"].values) > parameters_of(run).flywheel.Omega_still
    if not turns[:1].any():
        return "the disc stands from the start"
    if turns[-1]:
        return "the disc still turns when the demand falls to zero"
    stop = int(np.flatnonzero(turns)[-1]) + 1
    found = Stop(
        run,
        braked.isel(time=slice(None, stop)),
        braked.isel(time=slice(stop, None)),
        options.t_hold,
    )
    if found.begin > float(braked["time"].values[-1]):
        return f"the disc stands for less than {_CALM:g} s before the demand falls to zero"
    return found


def _held(stop: Stop) -> float:
    return mean(stop.standing, "F_N", stop.begin, stop.t_release)


def _last(signal: str) -> Callable[[Stop], float]:
    """Return the mean magnitude of a signal over the last tenth of braking."""

    def of(stop: Stop) -> float:
        rows = np.abs(stop.turning[signal].values)
        return float(rows[-max(1, rows.size // 10) :].mean())

    return of


_FIGURES: dict[str, tuple[Callable[[Stop], float], str]] = {
    "stopping_time": (
        lambda s: float(s.standing["time"].values[0]),
        "Time from the demand until the disc stands.",
    ),
    "stopping_angle": (
        lambda s: abs(float(s.standing["phi"].values[0] - s.turning["phi"].values[0])),
        "Angle of the disc until then.",
    ),
    "moment_before_stop": (
        _last("M_B"),
        "Mean moment in the last tenth of braking; the run-out is in it.",
    ),
    "force_before_stop": (_last("F_N"), "Mean normal force in the last tenth of braking."),
    "force_held": (_held, f"Mean normal force from {_CALM:g} s after the stop to the release."),
    "force_change": (
        lambda s: swing(s.standing, "F_N", s.begin, s.t_release),
        "Normal force peak to peak in that time.",
    ),
    "reference_change": (
        lambda s: s.moved("theta_ref"),
        "How far the common reference moves toward clamping while the disc stands: wind-up.",
    ),
    "hold_power": (
        lambda s: mean(s.standing, "P_in", s.begin, s.t_release),
        "Mean input power in the time of the held force, standby included.",
    ),
}  # fmt: skip


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return how the disc stops, what is held on it, and how the brake lets go, per reading."""
    return tuple(kpi for reading in READINGS for kpi in _judge_one(recordings, reading, options))


def _judge_one(recordings: Recordings, reading: str, options: Options) -> tuple[Kpi, ...]:
    run = recordings[reading]
    stop = find_stop(run, options)
    found = [
        Kpi(
            f"{name}_{reading}",
            math.nan if isinstance(stop, str) else figure(stop),
            _UNITS[name],
            text,
            stop if isinstance(stop, str) else "",
        )
        for name, (figure, text) in _FIGURES.items()
    ]
    return (
        *found,
        release_time(run, options.t_hold, f"release_time_{reading}"),
        parking_time(run, options.t_hold, f"parking_time_{reading}"),
    )


EXPERIMENT = Experiment(
    name="disc-stop",
    assembly="wedge-brake",
    summary="300 N m until the disc stands, held and released; both readings of a stopped disc",
    options=Options,
    defaults=Options(M_brake=300.0, Omega_0=5.0, t_hold=1.5, t_end=0.3, settle=0.05),
    cases=cases,
    judge=judge,
    kpis={f"{name}_{reading}": unit for reading in READINGS for name, unit in _UNITS.items()},
    figures=("time-traces", "energy-balance"),
)
