"""Force cycle: both motors squeeze and pull slowly by position, on a force sensor and in the heart.

Turning steadily they neither stick nor slip, so that force over current shows the friction's
hysteresis, and force over travel the stiffness, up and down and through the free-play.
"""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.stimuli.registry import Stimulus
from bywire.brakes.wedge.model import WedgeBrake, state_at
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.rig_case import (
    Stimuli,
    parameters_of,
    screw_case,
    slope_of,
    torque_constant_of,
)
from bywire.brakes.wedge.start import memory_at
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length
from bywire.core.typing import Array
from bywire.plant.axial_bearing import AngularSpeed

LABELS = ("sensor", "heart")
_UNITS = {
    "force_compression": "N",
    "force_tension": "N",
    "stiffness": "N/m",
    "peak_current_sensor": "A",
    "peak_current_heart": "A",
    "hysteresis": "N*m",
}


class Options(ParameterSet):
    """Travels of one nut toward the other: zero, compression, tension, zero."""

    c_sensor: Length
    """closest, and farthest, with the force sensor between the screws"""
    c_close: Length
    """closest in the brake heart, tip to tip"""
    c_apart: Length
    """farthest in the brake heart, through the wedge"""
    omega_slow: AngularSpeed
    """speed of both motors"""


def cases(par: WedgeParameters, options: Options, _: Stimulus | None = None) -> tuple[Case, ...]:
    """Return both stages; the wedge stays in its clearance."""
    modes = {"rig.mode_1": "position", "rig.mode_2": "position"}
    # Without an offset of the screws, so that the test begins without force.
    own = par.replace({"command.mode": "position", "control.offset.delta_preload": 0.0})
    squeeze, t_sensor = _cycle(par, options.c_sensor, options.c_sensor, options)
    seize, t_heart = _cycle(par, options.c_close, options.c_apart, options)
    heart = Case(
        "heart", WedgeBrake(), own, state_at(0.0, own), memory_at(0.0, own), seize, t_heart
    )
    return (screw_case("sensor", par, squeeze, t_sensor, modes), heart)


def _cycle(
    par: WedgeParameters, close: float, apart: float, options: Options
) -> tuple[Stimuli, float]:
    """Return the stimulus of one stage, and its duration [s]."""
    k = slope_of(par)
    angles = np.array([0.0, 0.5 * close / k, -0.5 * apart / k, 0.5 * close / k, 0.0])
    times = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(angles)) / options.omega_slow)))

    def opposite(t: Array) -> dict[str, Array]:
        angle = np.interp(t, times, angles)
        return {"theta_1_set": angle, "theta_2_set": -angle}

    return opposite, math.ceil(1e3 * float(times[-1])) * 1e-3


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the forces reached, the line's stiffness, and what friction makes of a cycle."""
    run = recordings["sensor"]
    par = parameters_of(run)
    F, i = run["y_F"].values, _current(run)
    d = slope_of(par) * (run["q_1"].values - run["q_2"].values)
    work = 0.5 * abs(float(np.trapezoid(torque_constant_of(par) * i, F)))
    width = work / max(float(np.ptp(F)), 1e-9)
    values = {
        "force_compression": (float(F.max()), "Largest force on the sensor."),
        "force_tension": (float(-F.min()), "Largest tension on the sensor."),
        "stiffness": (float(np.polyfit(d, F, 1)[0]) if np.ptp(d) > 0 else math.nan,
                      "Force over travel with the sensor between, by a straight line."),
        "peak_current_sensor": (_peak(run), "Largest mean current of both motors, on the sensor."),
        "peak_current_heart": (_peak(recordings["heart"]), "The same in the brake heart."),
        "hysteresis": (width, "Friction torque, half the loop's width, mean over the cycle."),
    }  # fmt: skip
    return tuple(_kpi(name, *values[name]) for name in _UNITS)


def _current(run: xr.Dataset) -> Array:
    """Return the current [A] that squeezes, the mean of both motors."""
    return np.asarray(0.5 * (run["i_1"].values - run["i_2"].values))


def _peak(run: xr.Dataset) -> float:
    return float(np.abs(_current(run)).max())


def _kpi(name: str, value: float, text: str) -> Kpi:
    note = "" if math.isfinite(value) else "no travel: ask for more"
    return Kpi(name, value, _UNITS[name], text, note)


EXPERIMENT = Experiment(
    name="force-cycle",
    assembly="wedge-brake",
    summary="two motors squeeze and pull by position: stiffness, free-play, force over current",
    options=Options,
    defaults=Options(c_sensor=1.5e-4, c_close=1.4e-4, c_apart=3e-4, omega_slow=0.3),
    cases=cases,
    judge=judge,
    kpis=_UNITS,
    figures=("time-traces", "energy-balance"),
)
