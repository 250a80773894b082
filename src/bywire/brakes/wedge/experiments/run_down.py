"""Run-down: a motor coasts to rest alone, with a known added inertia, and with a known torque.

A plain run-down determines only the ratios of friction and damping to inertia. A known inertia on
the shaft, or the torque of a known current, sets the scale.
"""

from __future__ import annotations

import math
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import (
    Stimuli,
    check_current,
    parameters_of,
    shaft_case,
    torque_constant_of,
)
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Duration, Inertia
from bywire.core.typing import Array

if TYPE_CHECKING:
    import xarray as xr

LABELS = ("free", "added", "braked")
_HALF = 0.5  # fraction of the initial speed at which the range for decelerations ends
STOPPING = Figures(
    stopping_time=("s", "Time from the end of the spin-up until the shaft is at rest."),
    undefined="the shaft turns for too short a time, or does not come to rest",
)
FIGURES = Figures(
    speed=("rad/s", "Speed at the end of the spin-up."),
    inertia_by_added=(
        "kg*m**2",
        "Inertia of shaft and motor, from mean decelerations in the same speed range with and "
        "without the added inertia.",
    ),
    inertia_by_torque=("kg*m**2", "The same inertia, from the known current's torque."),
    inertia_true=("kg*m**2", "True value."),
    undefined=STOPPING.undefined,
)


class Options(ParameterSet):
    """Spin-up by a current, then coasting."""

    i_spin: Current
    """current of the spin-up"""
    t_spin: Duration
    """time of the spin-up; proportionally longer with the added inertia"""
    J_added: Inertia
    """inertia added to the shaft in the second run"""
    i_brake: Current
    """braking current in the third run; friction must hold this current's torque at rest"""
    duration: Duration
    """recording time after the end of the spin-up"""
    record: Duration
    """recording interval"""


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the three runs of a single motor on its dummy shaft."""
    for name in ("i_spin", "i_brake"):
        check_current(name, getattr(options, name), par)
    rig = {"rig.mode_1": "current", "rig.load": "dummy", "rig.clamp": "open"}
    J = par.rig.J_dummy
    ratio = 1.0 + options.J_added / (par.motor_1.J_M + J)
    kinds = (
        ("free", J, 1.0, 0.0),
        ("added", J + options.J_added, ratio, 0.0),
        ("braked", J, 1.0, -options.i_brake),
    )
    return tuple(
        shaft_case(
            label,
            par,
            _spun(options, i_after),
            options.duration,
            rig | {"rig.J_dummy": J_dummy},
            settle=longer * options.t_spin,
            keep=0.0,
            record=options.record,
        )
        for label, J_dummy, longer, i_after in kinds
    )


def _spun(options: Options, i_after: float) -> Stimuli:
    """Return the current during spin-up and coasting."""

    def stimulus(t: Array) -> dict[str, Array]:
        return {"i_1_set": np.where(t < -1e-9, options.i_spin, i_after)}

    return stimulus


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the stopping times, and the inertia from the added inertia and from the torque."""
    par = parameters_of(recordings["free"])
    rate = {label: _deceleration(recordings, label) for label in LABELS}
    J = par.motor_1.J_M + par.rig.J_dummy
    by_added = _over(options.J_added * rate["added"], rate["free"] - rate["added"])
    torque = torque_constant_of(par) * options.i_brake
    by_torque = _over(torque, rate["braked"] - rate["free"])
    stops = [STOPPING(f"_{label}", stopping_time=_stop(recordings[label])) for label in LABELS]
    return (
        *chain.from_iterable(stops),
        *FIGURES(
            speed=_first(recordings["free"]),
            inertia_by_added=by_added,
            inertia_by_torque=by_torque,
            inertia_true=J,
        ),
    )


def _speed(run: xr.Dataset) -> Array:
    return np.asarray(np.abs(run.sel(time=slice(-1e-9, None))["omega_1"].values))


def _first(run: xr.Dataset) -> float:
    return float(_speed(run)[0])


def _deceleration(recordings: Recordings, label: str) -> float:
    """Return the mean deceleration [rad/s^2] between two speeds that occur in all runs."""
    high = min(_first(recordings[each]) for each in LABELS)
    speed = _speed(recordings[label])
    t = recordings[label]["time"].sel(time=slice(-1e-9, None)).values
    if not high > 0.0 or speed.min() > _HALF * high:
        return math.nan
    ends = np.interp([-high, -_HALF * high], -speed, t)
    return float((1.0 - _HALF) * high / (ends[1] - ends[0]))


def _stop(run: xr.Dataset) -> float:
    rest = np.flatnonzero(_speed(run) == 0.0)
    t = run["time"].sel(time=slice(-1e-9, None)).values
    return float(t[rest[0]]) if rest.size else math.nan


def _over(above: float, below: float) -> float:
    return above / below if below > 0 else math.nan


EXPERIMENT = Experiment(
    name="run-down",
    assembly="wedge-brake",
    summary="a motor coasts to rest: alone, with an added inertia, and against a known torque",
    options=Options,
    defaults=Options(i_spin=4.0, t_spin=0.1, J_added=1e-4, i_brake=0.5, duration=0.5, record=2e-4),
    cases=cases,
    judge=judge,
    kpis=STOPPING.ending(*(f"_{label}" for label in LABELS)) | FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
