"""Load sweep: the screw drives and is driven back under many forces, at a slow, steady speed.

Like the screw-efficiency test, with the force varied: friction that is there without load and
friction that grows with it then part.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import mean, parameters_of
from bywire.brakes.wedge.experiments.moment_pulses import Count
from bywire.brakes.wedge.experiments.screw_efficiency import SlowSpeed
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.rig_case import (
    check_current,
    screw_case,
    slope_of,
    torque_constant_of,
)
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Duration
from bywire.core.typing import Array

_TURN = 0.2  # of a stroke's time, at rest after it, while the current changes
_RAMP = 0.2  # of a stroke's time, in which the speed rises, and falls again
_SETTLED = 0.4  # of a stroke, left out of the means
FIGURES = Figures(
    force_max=("N", "Largest mean force of a stroke."),
    force_min=("N", "Smallest mean force of a stroke."),
    eta_f_slope=("1", "Torque by the force over motor torque, by their growth; motor 1 driving."),
    eta_f_true=("1", "What was put in."),
    eta_b_slope=("1", "The same, inverse, motor 1 driven back."),
    eta_b_true=("1", "What was put in."),
    undefined="the force does not grow with the current: more levels",
)


class Options(ParameterSet):
    """Strokes of motor 2 there and back, at currents of motor 1 that grow from pair to pair."""

    i_drive: Current
    """largest current of motor 1 while it drives"""
    i_back: Current
    """largest current while motor 2 pushes it back; small, see the screw-efficiency test"""
    levels: Count
    """how many currents, evenly spaced up to the largest"""
    omega_slow: SlowSpeed
    """speed of the motion"""
    t_stroke: Duration
    """time of one stroke"""


class Stroke(NamedTuple):
    """One motion: when it begins [s], its direction, and the current of motor 1 [A]."""

    begin: float
    sign: float
    i: float


def strokes(options: Options) -> tuple[Stroke, ...]:
    """Return the strokes: at every level one that motor 1 drives, and one that drives it back."""
    period = (1.0 + _TURN) * options.t_stroke
    moves = []
    for k in range(options.levels):
        share = (k + 1.0) / options.levels
        for way, (sign, i) in enumerate(((1.0, options.i_drive), (-1.0, options.i_back))):
            moves.append(Stroke((2 * k + way + _TURN) * period, sign, share * i))
    return tuple(moves)


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the one run; motor 1 in current, motor 2 in position control."""
    for name in ("i_drive", "i_back"):
        check_current(name, getattr(options, name), par)
    moves = strokes(options)
    corners = [
        0.0,
        *(t for stroke in moves for t in (stroke.begin, stroke.begin + options.t_stroke)),
    ]
    levels = [0.0, *(i for stroke in moves for i in (stroke.i, stroke.i))]

    def stimulus(t: Array) -> dict[str, Array]:
        moved = np.zeros(t.shape)
        for stroke in moves:
            moved = moved + stroke.sign * _moved(t - stroke.begin, options.t_stroke)
        return {
            "i_1_set": np.interp(t, corners, levels),
            "theta_2_set": options.omega_slow * moved,
        }

    modes = {"rig.mode_1": "current", "rig.mode_2": "position"}
    return (screw_case("run", par, stimulus, corners[-1], modes),)


def _moved(t: Array, T: float) -> Array:
    """Return the way of a stroke at speed one, whose speed rises and falls gently."""
    ramp = _RAMP * T
    rising, falling = np.clip(t, 0.0, ramp), np.clip(t - (T - ramp), 0.0, ramp)
    steady = np.clip(t - ramp, 0.0, T - 2.0 * ramp)
    return np.asarray(0.5 * rising**2 / ramp + steady + falling - 0.5 * falling**2 / ramp)


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the efficiencies by the slope of motor 1's torque over the force, both ways."""
    run = recordings["run"]
    par = parameters_of(run)
    k, K = slope_of(par), torque_constant_of(par)
    rows = [
        (stroke.sign, *(_mean(run, stroke, name, options) for name in ("y_F", "i_1")))
        for stroke in strokes(options)
    ]
    driving = _line([row[1:] for row in rows if row[0] > 0])
    back = _line([row[1:] for row in rows if row[0] < 0])
    forces = [row[1] for row in rows]
    return FIGURES(
        force_max=max(forces),
        force_min=min(forces),
        eta_f_slope=k / (K * driving) if driving > 0 else math.nan,
        eta_f_true=par.screw.eta_f,
        eta_b_slope=K * back / k,
        eta_b_true=par.screw.eta_b,
    )


def _mean(run: xr.Dataset, stroke: Stroke, name: str, options: Options) -> float:
    begin, end = (stroke.begin + share * options.t_stroke for share in (_SETTLED, 1.0 - _RAMP))
    return mean(run, name, begin, end)


def _line(rows: list[tuple[float, ...]]) -> float:
    """Return current over force, the slope of a line."""
    F, i = np.array(rows).T
    return float(np.polyfit(F, i, 1)[0]) if len(rows) > 1 and np.ptp(F) > 0 else math.nan


EXPERIMENT = Experiment(
    name="load-sweep",
    assembly="wedge-brake",
    summary="screw driving and driven back under growing forces: friction with and without load",
    options=Options,
    defaults=Options(i_drive=12.0, i_back=3.0, levels=6, omega_slow=10.0, t_stroke=0.6),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
