"""Force cycle: both motors squeeze and pull slowly by position, on a force sensor and in the heart.

Turning steadily they neither stick nor slip, so that force over current shows the friction's
hysteresis, and force over travel the stiffness, up and down and through the free-play.
"""

from __future__ import annotations

import math

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import parameters_of
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.rig_case import (
    Stimuli,
    heart_case,
    screw_case,
    slope_of,
    squeezing_current,
    torque_constant_of,
)
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Length
from bywire.core.typing import Array
from bywire.plant.axial_bearing import AngularSpeed

LABELS = ("sensor", "heart")
FIGURES = Figures(
    force_compression=("N", "Largest force on the sensor."),
    force_tension=("N", "Largest tension on the sensor."),
    stiffness=("N/m", "Force over travel with the sensor between, by a straight line."),
    peak_current_sensor=("A", "Largest mean current of both motors, on the sensor."),
    peak_current_heart=("A", "The same in the brake heart."),
    hysteresis=("N*m", "Friction torque, half the loop's width, mean over the cycle."),
    undefined="no travel: ask for more",
)


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


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return both stages; the wedge stays in its clearance."""
    modes = {"rig.mode_1": "position", "rig.mode_2": "position"}
    squeeze, t_sensor = _cycle(par, options.c_sensor, options.c_sensor, options)
    seize, t_heart = _cycle(par, options.c_close, options.c_apart, options)
    return (
        screw_case("sensor", par, squeeze, t_sensor, modes),
        heart_case(par, seize, t_heart, "position"),
    )


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
    F, i = run["y_F"].values, squeezing_current(run)
    d = slope_of(par) * (run["q_1"].values - run["q_2"].values)
    work = 0.5 * abs(float(np.trapezoid(torque_constant_of(par) * i, F)))
    return FIGURES(
        force_compression=F.max(),
        force_tension=-F.min(),
        stiffness=np.polyfit(d, F, 1)[0] if np.ptp(d) > 0 else math.nan,
        peak_current_sensor=np.abs(i).max(),
        peak_current_heart=np.abs(squeezing_current(recordings["heart"])).max(),
        hysteresis=work / max(float(np.ptp(F)), 1e-9),
    )


EXPERIMENT = Experiment(
    name="force-cycle",
    assembly="wedge-brake",
    summary="two motors squeeze and pull by position: stiffness, free-play, force over current",
    options=Options,
    defaults=Options(c_sensor=1.5e-4, c_close=1.4e-4, c_apart=3e-4, omega_slow=0.3),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
