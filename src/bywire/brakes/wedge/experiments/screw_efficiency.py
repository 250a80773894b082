"""Roller screw efficiency: two motors work against each other, with a force sensor between them.

Two such motors cannot back-drive each other at full current, because only 0.65 x 0.46 of a motor's
torque reaches the other. Therefore the motor in position control moves, and the motor in current
control follows or is driven back.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import (
    check_current,
    mean,
    parameters_of,
    screw_case,
    shaft_case,
    slope_of,
    torque_constant_of,
)
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Duration, Unit
from bywire.core.signals import Signal
from bywire.core.typing import Array

if TYPE_CHECKING:
    import xarray as xr

# --- Efficiency at two forces

SlowSpeed = Annotated[float, Unit("rad/s", 10.0), Field(gt=0, allow_inf_nan=False)]

_SETTLED = 0.3  # initial fraction of the time in motion that means omit
_LESS = 0.5  # ratio of currents in the motions under lower force
_SPEED = 0.05  # maximum relative error of mean speeds in steady motion
EFFICIENCY_FIGURES = Figures(
    eta_f=(
        "1",
        "Ratio of force torque to motor torque minus bearing torque, with motor 1 driving.",
    ),
    eta_f_no_load=("1", "Like eta_f, but subtracting only the no-load bearing torque."),
    eta_f_raw=("1", "Ratio of force torque to motor torque, with motor 1 driving."),
    eta_f_reverse=("1", "Like eta_f, with motor 2 driving."),
    eta_f_true=("1", "True value."),
    eta_b=(
        "1",
        "Ratio of holding torque plus bearing torque to force torque, with motor 2 driven back.",
    ),
    eta_b_no_load=("1", "Like eta_b, but adding only the no-load bearing torque."),
    eta_b_raw=("1", "Ratio of holding torque to force torque, with motor 2 driven back."),
    eta_b_reverse=("1", "Like eta_b, with motor 1 driven back."),
    eta_b_true=("1", "True value."),
    force=("N", "Mean force while motor 1 drives."),
    force_reverse=("N", "Mean force while motor 1 is driven back."),
    bearing_torque=("N*m", "No-load motor torque at the same speed."),
    bearing_growth=(
        "N*m/N**2",
        "Growth of the bearing torque with force squared, with motor 1 driving.",
    ),
    bearing_growth_true=("N*m/N**2", "True value."),
    undefined="the motion is not steady under compression. A motor cannot hold its speed or force",
)


class EfficiencyOptions(ParameterSet):
    """Currents and slow motion, above the speed range in which friction falls with speed."""

    i_drive: Current
    """current of motor 1 while it drives and motor 2 yields"""
    i_back: Current
    """current of motor 1 while motor 2 pushes it back; must be small enough for motor 2"""
    omega_slow: SlowSpeed
    """speed of the motion"""
    settle: Duration
    """time for the force to build up before the motion"""
    duration: Duration
    """time in motion"""


class Reading(NamedTuple):
    """Mean readings while a run is in motion. Friction opposes the motion."""

    F: Annotated[float, Signal("N", "force", 1000.0)]
    T_1: Annotated[float, Signal("N*m", "torque of motor 1 from its current", 1.0)]
    T_2: Annotated[float, Signal("N*m", "torque of motor 2 from its current", 1.0)]
    steady: Annotated[float, Signal("1", "1 in steady motion under compression, else NaN")]


def efficiency(
    par: WedgeParameters, options: EfficiencyOptions, _: object = None
) -> tuple[Case, ...]:
    """Return the motion without load, and motor 1 driving and driven back under two forces each.

    Notes
    -----
    Bearing friction grows with the square of the force. The no-load torque does not contain this
    growth, so subtracting only the no-load torque gives an efficiency that is too low by
    F C_2 / k, a percent or more. Each motion therefore runs under two forces. Torque per force,
    extrapolated to zero force, belongs only to the screw.
    """
    for name in ("i_drive", "i_back"):
        check_current(name, getattr(options, name), par)
    modes = {"rig.mode_1": "current", "rig.mode_2": "position"}
    alone = {"rig.mode_1": "position", "rig.load": "dummy", "rig.clamp": "open"}
    slow = options.omega_slow
    timing = {"settle": options.settle, "keep": options.settle}

    def turning(t: Array) -> dict[str, Array]:
        return {"theta_1_set": slow * np.maximum(t, 0.0)}

    pushed = {
        f"{label}{suffix}": _pushed(share * i, speed, options)
        for label, i, speed in (
            ("driving", options.i_drive, slow),
            ("driven_back", options.i_back, -slow),
        )
        for suffix, share in (("", 1.0), ("_less", _LESS))
    }
    return (
        shaft_case("no_load", par, turning, options.duration, alone, **timing),
        *(
            screw_case(label, par, stimulus, options.duration, modes, **timing)
            for label, stimulus in pushed.items()
        ),
    )


def judge_efficiency(recordings: Recordings, options: EfficiencyOptions) -> tuple[Kpi, ...]:
    """Return the efficiencies in both directions, with and without bearing friction."""
    no_load = recordings["no_load"]
    par = parameters_of(no_load)
    k = slope_of(par)
    T_b = torque_constant_of(par) * _mean(no_load, "i_1", options)
    slow = options.omega_slow
    there, there_less = (
        _read(recordings[f"driving{suffix}"], slow, options) for suffix in ("", "_less")
    )
    back, back_less = (
        _read(recordings[f"driven_back{suffix}"], -slow, options) for suffix in ("", "_less")
    )
    drive, growth = _without_force((there, there.T_1 - T_b), (there_less, there_less.T_1 - T_b))
    driven, _ = _without_force((there, T_b - there.T_2), (there_less, T_b - there_less.T_2))
    drive_2, _ = _without_force((back, -back.T_2 - T_b), (back_less, -back_less.T_2 - T_b))
    driven_1, _ = _without_force((back, back.T_1 + T_b), (back_less, back_less.T_1 + T_b))
    return EFFICIENCY_FIGURES(
        eta_f=_ratio(k, drive),
        eta_f_no_load=there.steady * _ratio(k * there.F, there.T_1 - T_b),
        eta_f_raw=there.steady * _ratio(k * there.F, there.T_1),
        eta_f_reverse=_ratio(k, drive_2),
        eta_f_true=par.screw.eta_f,
        eta_b=driven / k,
        eta_b_no_load=there.steady * _ratio(-there.T_2 + T_b, k * there.F),
        eta_b_raw=there.steady * _ratio(-there.T_2, k * there.F),
        eta_b_reverse=driven_1 / k,
        eta_b_true=par.screw.eta_b,
        bearing_growth=growth,
        bearing_growth_true=par.bearing.C_2,
        force=there.F,
        force_reverse=back.F,
        bearing_torque=T_b,
    )


def _pushed(i: float, speed: float, options: EfficiencyOptions) -> Any:
    """Return motor 1 pushing and, from time zero on, motor 2 moving."""

    def stimulus(t: Array) -> dict[str, Array]:
        rising = np.clip((t + options.settle) / (0.5 * options.settle), 0.0, 1.0)
        return {"i_1_set": i * rising, "theta_2_set": speed * np.maximum(t, 0.0)}

    return stimulus


def _read(run: xr.Dataset, speed: float, options: EfficiencyOptions) -> Reading:
    K = torque_constant_of(parameters_of(run))
    T_1, T_2 = (K * _mean(run, name, options) for name in ("i_1", "i_2"))
    steady = all(abs(_speed(run, name, options) / speed - 1.0) < _SPEED for name in ("q_1", "q_2"))
    F = _mean(run, "y_F", options)
    return Reading(F, T_1, T_2, 1.0 if steady and F > 0 else math.nan)


def _speed(run: xr.Dataset, name: str, options: EfficiencyOptions) -> float:
    """Return the mean speed [rad/s] from an encoder."""
    window = run.sel(time=slice(_SETTLED * options.duration, None))
    t, q = window["time"].values, window[name].values
    return float((q[-1] - q[0]) / (t[-1] - t[0])) if t.size > 1 else math.nan


def _mean(run: xr.Dataset, name: str, options: EfficiencyOptions) -> float:
    return mean(run, name, _SETTLED * options.duration, options.duration)


def _without_force(full: tuple[Reading, float], less: tuple[Reading, float]) -> tuple[float, float]:
    """Return torque per force, extrapolated to zero force, and its growth. NaN if not steady."""
    (there, T), (below, T_less) = full, less
    steady = there.steady * below.steady
    if not steady > 0 or there.F == below.F:
        return math.nan, math.nan
    growth = (T / there.F - T_less / below.F) / (there.F - below.F)
    return T / there.F - growth * there.F, growth


def _ratio(above: float, below: float) -> float:
    return above / below if below > 0 else math.nan


SCREW_EFFICIENCY = Experiment(
    name="screw-efficiency",
    assembly="wedge-brake",
    summary="roller screw efficiency, from motor currents and the force between two screws",
    options=EfficiencyOptions,
    defaults=EfficiencyOptions(i_drive=12.0, i_back=3.0, omega_slow=10.0, settle=0.4, duration=1.0),
    cases=efficiency,
    judge=judge_efficiency,
    kpis=EFFICIENCY_FIGURES.units,
    figures=("time-traces", "energy-balance"),
)


# --- Load sweep: several forces separate load-dependent friction from other friction

Levels = Annotated[int, Unit("1", 3.0), Field(ge=1, le=100)]

_TURN = 0.2  # rest after a stroke while the current changes, relative to the stroke time
_RAMP = 0.2  # fraction of the stroke time in which the speed rises, and in which it falls
_SWEEP_SETTLED = 0.4  # initial fraction of a stroke that means omit
LOAD_SWEEP_FIGURES = Figures(
    force_max=("N", "Maximum mean force of a stroke."),
    force_min=("N", "Minimum mean force of a stroke."),
    eta_f_slope=("1", "Slope of force torque versus motor torque, with motor 1 driving."),
    eta_f_true=("1", "True value."),
    eta_b_slope=("1", "Inverse of that slope, with motor 1 driven back."),
    eta_b_true=("1", "True value."),
    undefined="the force does not increase with the current. Set more levels",
)


class LoadSweepOptions(ParameterSet):
    """Strokes of motor 2 forward and back. The current of motor 1 increases from pair to pair."""

    i_drive: Current
    """maximum current of motor 1 while it drives"""
    i_back: Current
    """maximum current while motor 2 pushes motor 1 back; must be small enough for motor 2"""
    levels: Levels
    """number of currents, evenly spaced up to the maximum"""
    omega_slow: SlowSpeed
    """speed of the motion"""
    t_stroke: Duration
    """length of one stroke"""


class Stroke(NamedTuple):
    """One motion: its start [s], its direction, and the current of motor 1 [A]."""

    begin: float
    sign: float
    i: float


def strokes(options: LoadSweepOptions) -> tuple[Stroke, ...]:
    """Return the strokes. At each level, motor 1 drives once and is driven back once."""
    period = (1.0 + _TURN) * options.t_stroke
    moves = []
    for k in range(options.levels):
        share = (k + 1.0) / options.levels
        for way, (sign, i) in enumerate(((1.0, options.i_drive), (-1.0, options.i_back))):
            moves.append(Stroke((2 * k + way + _TURN) * period, sign, share * i))
    return tuple(moves)


def load_sweep(
    par: WedgeParameters, options: LoadSweepOptions, _: object = None
) -> tuple[Case, ...]:
    """Return the single run, with motor 1 in current control and motor 2 in position control."""
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
    """Return the travel of a stroke at speed one, with ramps of the speed at both ends."""
    ramp = _RAMP * T
    rising, falling = np.clip(t, 0.0, ramp), np.clip(t - (T - ramp), 0.0, ramp)
    steady = np.clip(t - ramp, 0.0, T - 2.0 * ramp)
    return np.asarray(0.5 * rising**2 / ramp + steady + falling - 0.5 * falling**2 / ramp)


def judge_load_sweep(recordings: Recordings, options: LoadSweepOptions) -> tuple[Kpi, ...]:
    """Return both efficiencies from the slope of motor 1's torque versus force."""
    run = recordings["run"]
    par = parameters_of(run)
    k, K = slope_of(par), torque_constant_of(par)
    rows = [
        (stroke.sign, *(_stroke_mean(run, stroke, name, options) for name in ("y_F", "i_1")))
        for stroke in strokes(options)
    ]
    driving = _line([row[1:] for row in rows if row[0] > 0])
    back = _line([row[1:] for row in rows if row[0] < 0])
    forces = [row[1] for row in rows]
    return LOAD_SWEEP_FIGURES(
        force_max=max(forces),
        force_min=min(forces),
        eta_f_slope=k / (K * driving) if driving > 0 else math.nan,
        eta_f_true=par.screw.eta_f,
        eta_b_slope=K * back / k,
        eta_b_true=par.screw.eta_b,
    )


def _stroke_mean(run: xr.Dataset, stroke: Stroke, name: str, options: LoadSweepOptions) -> float:
    begin, end = (
        stroke.begin + share * options.t_stroke for share in (_SWEEP_SETTLED, 1.0 - _RAMP)
    )
    return mean(run, name, begin, end)


def _line(rows: list[tuple[float, ...]]) -> float:
    """Return the slope of a line of current versus force."""
    F, i = np.array(rows).T
    return float(np.polyfit(F, i, 1)[0]) if len(rows) > 1 and np.ptp(F) > 0 else math.nan


LOAD_SWEEP = Experiment(
    name="load-sweep",
    assembly="wedge-brake",
    summary="screw driving and back-driven at increasing force: friction with and without load",
    options=LoadSweepOptions,
    defaults=LoadSweepOptions(i_drive=12.0, i_back=3.0, levels=6, omega_slow=10.0, t_stroke=0.6),
    cases=load_sweep,
    judge=judge_load_sweep,
    kpis=LOAD_SWEEP_FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
