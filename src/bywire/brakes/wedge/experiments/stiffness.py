"""Drive train stiffness, with a force sensor between the screws and in the brake heart."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import (
    Stimuli,
    case_from_parked,
    check_current,
    parameters_of,
    screw_case,
    slope_of,
    torque_constant_of,
)
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Duration, Length
from bywire.core.typing import Array
from bywire.plant import shaft_encoder
from bywire.plant.axial_bearing import AngularSpeed

if TYPE_CHECKING:
    import xarray as xr


def _heart_case(par: WedgeParameters, stimulus: Stimuli, duration: float, mode: str) -> Case:
    """Return a run of both motors in the brake heart, without offset and therefore without force.

    The command's ``mode`` is "current" or "position". The wedge stays in its clearance.
    """
    changes = {"command.mode": mode, "control.offset.delta_preload": 0.0}
    return case_from_parked(par, stimulus, duration, changes, "heart")


def _squeezing_current(run: xr.Dataset) -> Array:
    """Return the squeezing current [A], the mean of both motors."""
    return np.asarray(0.5 * (run["i_1"].values - run["i_2"].values))


# --- In current control: ramps of opposite currents

_UPPER = 0.35  # fraction of the maximum current below which bearings and free play bend the line
_HOLD = 0.2  # fraction of the ramp time, at the maximum current and between the directions
STIFFNESS_FIGURES = Figures(
    K_line_compression=("N/m", "Force per travel with the sensor, in compression."),
    K_line_tension=("N/m", "Force per travel with the sensor, in tension."),
    force_per_current=(
        "N/A",
        "Force per current while the current rises, mean of compression and tension.",
    ),
    K_S=("N/m", "Stiffness of one screw: line stiffness, corrected for the sensor."),
    K_S_true=("N/m", "True value."),
    K_heart_compression=("N/m", "Force from the current per travel, tip to tip."),
    K_heart_tension=("N/m", "Force from the current per travel, through the wedge."),
    K_W=(
        "N/m",
        "Stiffness of one interface to the wedge: stiffness in tension, corrected for the screws.",
    ),
    K_W_true=("N/m", "True value."),
    free_play=("m", "Travel between the zero crossings of the compression and tension lines."),
    free_play_true=("m", "True value."),
    undefined="the screws do not travel under load. Set a larger current",
)


class StiffnessOptions(ParameterSet):
    """Current ramps up and down, first in compression, then in tension."""

    i_max: Current
    """maximum current, with opposite signs in both motors"""
    t_ramp: Duration
    """time from zero to the maximum current"""


class Line(NamedTuple):
    """A straight line through readings, NaN if there are too few."""

    slope: float
    start: float
    """zero crossing of the line"""


def stiffness(
    par: WedgeParameters, options: StiffnessOptions, _: object = None
) -> tuple[Case, ...]:
    """Return both stages with the same currents. The wedge stays in its clearance.

    Notes
    -----
    The evaluation excludes friction as on a real rig. Stage 1 measures force and travel at the
    sensor, so friction has no effect. Stage 2 has no force sensor. There the force comes from the
    current and a calibration from stage 1, which includes the friction at rising current. The
    evaluation assumes symmetry, like the paper. Unequal motors drag the wedge along, and its
    friction is then treated as stiffness (K_W is 5 % too high if the torque constants differ by 10
    %).
    """
    check_current("i_max", options.i_max, par)
    t = options.t_ramp

    def opposite(time: Array) -> dict[str, Array]:
        i = np.interp(time, *_profile(options))
        return {"i_1_set": i, "i_2_set": -i}

    duration = _profile(options)[0][-1] + _HOLD * t
    modes = {"rig.mode_1": "current", "rig.mode_2": "current"}
    return (
        screw_case("sensor", par, opposite, duration, modes),
        _heart_case(par, opposite, duration, "current"),
    )


def judge_stiffness(recordings: Recordings, options: StiffnessOptions) -> tuple[Kpi, ...]:
    """Return the stiffnesses of screws and wedge and the free play, with their true values."""
    sensor, heart = recordings["sensor"], recordings["heart"]
    par = parameters_of(sensor)
    lines, calibrations, loaded = [], [], []
    for sign in (1.0, -1.0):
        F, i = sensor["y_F"].values, _squeezing_current(sensor)
        rising = _rising(sensor, sign, options)
        lines.append(_line(_closer(sensor)[rising], F[rising]))
        calibrations.append(_line(i[rising], F[rising]))
        seen = _rising(heart, sign, options)
        F_hat = calibrations[-1].slope * (_squeezing_current(heart)[seen] - calibrations[-1].start)
        loaded.append(_line(_closer(heart)[seen], F_hat))
    c_F = 1.0 / par.rig.sensor.K_F
    c_S = 0.5 * (0.5 * sum(1.0 / line.slope for line in lines) - c_F)
    c_W = 0.5 / loaded[1].slope - c_S
    truth = par.heart
    return STIFFNESS_FIGURES(
        K_line_compression=lines[0].slope,
        K_line_tension=lines[1].slope,
        force_per_current=0.5 * sum(line.slope for line in calibrations),
        K_S=1.0 / c_S,
        K_S_true=truth.K_S,
        K_heart_compression=loaded[0].slope,
        K_heart_tension=loaded[1].slope,
        K_W=1.0 / c_W,
        K_W_true=truth.K_W,
        free_play=loaded[0].start - loaded[1].start,
        free_play_true=truth.g_1 + truth.g_2 + truth.g_12,
    )


def _profile(options: StiffnessOptions) -> tuple[list[float], list[float]]:
    """Return times [s] and currents [A] of the breakpoints."""
    i, hold = options.i_max, _HOLD
    corners = [
        0.0,
        1.0,
        1.0 + hold,
        2.0 + hold,
        2.0 + 2 * hold,
        3.0 + 2 * hold,
        3.0 + 3 * hold,
        4.0 + 3 * hold,
    ]
    return [options.t_ramp * c for c in corners], [0.0, i, i, 0.0, 0.0, -i, -i, 0.0]


def _rising(run: xr.Dataset, sign: float, options: StiffnessOptions) -> Any:
    """Return the rows in the upper part of one direction's rising current."""
    times = _profile(options)[0]
    begin, end = (times[0], times[1]) if sign > 0 else (times[4], times[5])
    t, level = run["time"].values, sign * _squeezing_current(run)
    return (t >= begin) & (t <= end) & (level > _UPPER * options.i_max)


def _closer(run: xr.Dataset) -> Array:
    """Return the approach of the nuts from the encoders [m]."""
    par = parameters_of(run)
    angles: list[Any] = [run["theta_1"].values, run["theta_2"].values]
    q_1, q_2 = (shaft_encoder.reading(angle, par.encoder) for angle in angles)
    return np.asarray(slope_of(par) * (q_1 - q_2))


def _line(x: Array, y: Array) -> Line:
    if x.size < 3 or not np.ptp(x) > 0 or not np.ptp(y) > 0:
        return Line(math.nan, math.nan)
    slope, level = np.polyfit(x, y, 1)
    return Line(float(slope), float(-level / slope))


STIFFNESS = Experiment(
    name="stiffness",
    assembly="wedge-brake",
    summary="screw and wedge stiffness, and free play, with the motors working against each other",
    options=StiffnessOptions,
    defaults=StiffnessOptions(i_max=15.0, t_ramp=2.0),
    cases=stiffness,
    judge=judge_stiffness,
    kpis=STIFFNESS_FIGURES.units,
    figures=("time-traces", "energy-balance"),
)


# --- In position control: a slow cycle of travel

LABELS = ("sensor", "heart")
FORCE_CYCLE_FIGURES = Figures(
    force_compression=("N", "Maximum force on the sensor."),
    force_tension=("N", "Maximum tension on the sensor."),
    stiffness=("N/m", "Slope of force versus travel with the sensor."),
    peak_current_sensor=("A", "Maximum mean current of both motors, with the sensor."),
    peak_current_heart=("A", "Maximum mean current of both motors, in the brake heart."),
    hysteresis=("N*m", "Friction torque: half the width of the loop, mean over the cycle."),
    undefined="the screws do not travel. Increase options.c_sensor",
)


class ForceCycleOptions(ParameterSet):
    """Travel of one nut toward the other: zero, compression, tension, zero."""

    c_sensor: Length
    """maximum travel in each direction with the force sensor between the screws"""
    c_close: Length
    """maximum travel of the screws toward each other in the brake heart, tip to tip"""
    c_apart: Length
    """maximum travel of the screws away from each other in the brake heart, through the wedge"""
    omega_slow: AngularSpeed
    """speed of both motors"""


def force_cycle(
    par: WedgeParameters, options: ForceCycleOptions, _: object = None
) -> tuple[Case, ...]:
    """Return both stages. The wedge stays in its clearance.

    Steadily turning motors do not stick. Force versus current shows the friction hysteresis, and
    force versus travel shows the stiffness, in both directions and through the free play.
    """
    modes = {"rig.mode_1": "position", "rig.mode_2": "position"}
    squeeze, t_sensor = _cycle(par, options.c_sensor, options.c_sensor, options)
    seize, t_heart = _cycle(par, options.c_close, options.c_apart, options)
    return (
        screw_case("sensor", par, squeeze, t_sensor, modes),
        _heart_case(par, seize, t_heart, "position"),
    )


def _cycle(
    par: WedgeParameters, close: float, apart: float, options: ForceCycleOptions
) -> tuple[Stimuli, float]:
    """Return the stimulus of one stage, and its duration [s]."""
    k = slope_of(par)
    angles = np.array([0.0, 0.5 * close / k, -0.5 * apart / k, 0.5 * close / k, 0.0])
    times = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(angles)) / options.omega_slow)))

    def opposite(t: Array) -> dict[str, Array]:
        angle = np.interp(t, times, angles)
        return {"theta_1_set": angle, "theta_2_set": -angle}

    return opposite, math.ceil(1e3 * float(times[-1])) * 1e-3


def judge_force_cycle(recordings: Recordings, options: ForceCycleOptions) -> tuple[Kpi, ...]:
    """Return the maximum forces, the line's stiffness, and the hysteresis of a cycle."""
    run = recordings["sensor"]
    par = parameters_of(run)
    F, i = run["y_F"].values, _squeezing_current(run)
    d = slope_of(par) * (run["q_1"].values - run["q_2"].values)
    work = 0.5 * abs(float(np.trapezoid(torque_constant_of(par) * i, F)))
    return FORCE_CYCLE_FIGURES(
        force_compression=F.max(),
        force_tension=-F.min(),
        stiffness=np.polyfit(d, F, 1)[0] if np.ptp(d) > 0 else math.nan,
        peak_current_sensor=np.abs(i).max(),
        peak_current_heart=np.abs(_squeezing_current(recordings["heart"])).max(),
        hysteresis=work / max(float(np.ptp(F)), 1e-9),
    )


FORCE_CYCLE = Experiment(
    name="force-cycle",
    assembly="wedge-brake",
    summary="two motors squeeze and pull in position control: stiffness, free play, calibration",
    options=ForceCycleOptions,
    defaults=ForceCycleOptions(c_sensor=1.5e-4, c_close=1.4e-4, c_apart=3e-4, omega_slow=0.3),
    cases=force_cycle,
    judge=judge_force_cycle,
    kpis=FORCE_CYCLE_FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
