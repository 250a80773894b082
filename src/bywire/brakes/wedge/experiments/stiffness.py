"""Drive-train stiffness in two stages: screws on a force sensor, then in the brake heart.

Friction is kept out as on a real rig: stage 1 reads force and travel both at the line, beyond all
friction. Stage 2 has no force sensor; there the current tells the force, by a calibration of
stage 1 that holds for rising current, with the friction of rising current in it. As in the paper,
symmetry is assumed: unequal motors drag the wedge along, and its friction then counts as stiffness
(K_W reads 5 % high where the torque constants are 10 % apart).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.stimuli.registry import Stimulus
from bywire.brakes.wedge.model import WedgeBrake, state_at
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.rig_case import check_current, parameters_of, screw_case, slope_of
from bywire.brakes.wedge.start import memory_at
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Duration
from bywire.core.typing import Array
from bywire.plant import shaft_encoder

_UPPER = 0.35  # of the largest current: below, bearings and free-play bend the line
_HOLD = 0.2  # of the ramp's time, at the largest current and between the directions
_UNITS = {
    "K_line_compression": "N/m",
    "K_line_tension": "N/m",
    "force_per_current": "N/A",
    "K_S": "N/m",
    "K_S_true": "N/m",
    "K_heart_compression": "N/m",
    "K_heart_tension": "N/m",
    "K_W": "N/m",
    "K_W_true": "N/m",
    "free_play": "m",
    "free_play_true": "m",
}


class Options(ParameterSet):
    """Ramps of the current, up and down: first compression, then tension."""

    i_max: Current
    """largest current, with opposite signs in both motors"""
    t_ramp: Duration
    """time from zero to the largest current"""


class Line(NamedTuple):
    """A straight line through readings; NaN where there are too few."""

    slope: float
    start: float
    """where it crosses zero"""


def cases(par: WedgeParameters, options: Options, _: Stimulus | None = None) -> tuple[Case, ...]:
    """Return both stages under the same currents; the wedge stays in its clearance."""
    check_current("i_max", options.i_max, par)
    t = options.t_ramp

    def opposite(time: Array) -> dict[str, Array]:
        i = np.interp(time, *_profile(options))
        return {"i_1_set": i, "i_2_set": -i}

    duration = _profile(options)[0][-1] + _HOLD * t
    modes = {"rig.mode_1": "current", "rig.mode_2": "current"}
    # Without an offset of the screws, so that the test begins without force.
    own = par.replace({"command.mode": "current", "control.offset.delta_preload": 0.0})
    heart = Case(
        "heart", WedgeBrake(), own, state_at(0.0, own), memory_at(0.0, own), opposite, duration
    )
    return (screw_case("sensor", par, opposite, duration, modes), heart)


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the stiffnesses of screws and wedge, and the free-play, beside what was put in."""
    sensor, heart = recordings["sensor"], recordings["heart"]
    par = parameters_of(sensor)
    lines, calibrations, loaded = [], [], []
    for sign in (1.0, -1.0):
        F, i = sensor["y_F"].values, _current(sensor)
        rising = _rising(sensor, sign, options)
        lines.append(_line(_closer(sensor)[rising], F[rising]))
        calibrations.append(_line(i[rising], F[rising]))
        seen = _rising(heart, sign, options)
        F_hat = calibrations[-1].slope * (_current(heart)[seen] - calibrations[-1].start)
        loaded.append(_line(_closer(heart)[seen], F_hat))
    c_F = 1.0 / par.rig.sensor.K_F
    c_S = 0.5 * (0.5 * sum(1.0 / line.slope for line in lines) - c_F)
    c_W = 0.5 / loaded[1].slope - c_S
    own = par.heart
    values: dict[str, tuple[float, str]] = {
        "K_line_compression": (lines[0].slope, "Force over travel, sensor between, compression."),
        "K_line_tension": (lines[1].slope, "Force over travel, sensor between, tension."),
        "force_per_current": (0.5 * sum(line.slope for line in calibrations),
                              "Force over rising current, mean of compression and tension."),
        "K_S": (1.0 / c_S, "Stiffness of one screw: the line's, the sensor allowed for."),
        "K_S_true": (own.K_S, "What was put in."),
        "K_heart_compression": (loaded[0].slope, "Force by current over travel, tip to tip."),
        "K_heart_tension": (loaded[1].slope, "Force by current over travel, through the wedge."),
        "K_W": (1.0 / c_W, "Stiffness of one interface to the wedge: tension, less the screws."),
        "K_W_true": (own.K_W, "What was put in."),
        "free_play": (loaded[0].start - loaded[1].start,
                      "Travel between the lines of compression and tension at no force."),
        "free_play_true": (own.g_1 + own.g_2 + own.g_12, "What was put in."),
    }  # fmt: skip
    return tuple(_kpi(name, *values[name]) for name in _UNITS)


def _profile(options: Options) -> tuple[list[float], list[float]]:
    """Return times [s] and currents [A] of the corners."""
    i, hold = options.i_max, _HOLD
    corners = [0.0, 1.0, 1.0 + hold, 2.0 + hold, 2.0 + 2 * hold, 3.0 + 2 * hold, 3.0 + 3 * hold,
               4.0 + 3 * hold]  # fmt: skip
    return [options.t_ramp * c for c in corners], [0.0, i, i, 0.0, 0.0, -i, -i, 0.0]


def _rising(run: xr.Dataset, sign: float, options: Options) -> Any:
    """Return which rows lie in the upper part of one direction's rising current."""
    times = _profile(options)[0]
    begin, end = (times[0], times[1]) if sign > 0 else (times[4], times[5])
    t, level = run["time"].values, sign * _current(run)
    return (t >= begin) & (t <= end) & (level > _UPPER * options.i_max)


def _current(run: xr.Dataset) -> Array:
    """Return the current [A] that squeezes, the mean of both motors."""
    return np.asarray(0.5 * (run["i_1"].values - run["i_2"].values))


def _closer(run: xr.Dataset) -> Array:
    """Return how much closer the encoders say the nuts are [m]."""
    par = parameters_of(run)
    angles: list[Any] = [run["theta_1"].values, run["theta_2"].values]
    q_1, q_2 = (shaft_encoder.reading(angle, par.encoder) for angle in angles)
    return np.asarray(slope_of(par) * (q_1 - q_2))


def _line(x: Array, y: Array) -> Line:
    if x.size < 3 or not np.ptp(x) > 0 or not np.ptp(y) > 0:
        return Line(math.nan, math.nan)
    slope, level = np.polyfit(x, y, 1)
    return Line(float(slope), float(-level / slope))


def _kpi(name: str, value: float, text: str) -> Kpi:
    note = "" if math.isfinite(value) else "no travel under load: take a larger current"
    return Kpi(name, value, _UNITS[name], text, note)


EXPERIMENT = Experiment(
    name="stiffness",
    assembly="wedge-brake",
    summary="stiffnesses of screws and wedge and the free-play, motors against each other",
    options=Options,
    defaults=Options(i_max=15.0, t_ramp=2.0),
    cases=cases,
    judge=judge,
    kpis=_UNITS,
    figures=("time-traces", "energy-balance"),
)
