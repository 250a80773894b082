"""Force fight: two unequal motors on one reference, with a force sensor between their screws."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import mean, peak, screw_case
from bywire.brakes.wedge.experiments.screw_position import SomeAngle
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency, Unit
from bywire.core.typing import Array

Share = Annotated[float, Unit("1", 0.05), Field(gt=-1, le=10, allow_inf_nan=False)]
SomeSpeed = Annotated[float, Unit("rad/s", 50.0), Field(gt=0, allow_inf_nan=False)]

_MOTIONS = ("step", "ramp", "sine")
_LABELS = tuple(f"{motion}_{pair}" for motion in _MOTIONS for pair in ("equal", "unequal"))
_PAIRS = tuple(f"_{pair}" for pair in ("equal", "unequal"))
PEAK = Figures(peak_force=("N", "Maximum magnitude of the measured force."))
HELD = Figures(
    static_force=("N", "Magnitude of the mean force in the last tenth of the recording."),
)
APART = Figures(peak_difference=("rad", "Maximum difference between the encoders."))


class Options(ParameterSet):
    """Three motions of the common reference, and relative changes of motor 2."""

    a_step: SomeAngle
    """step of the reference"""
    omega_ramp: SomeSpeed
    """speed of the ramp"""
    a_sine: SomeAngle
    """amplitude of the sine"""
    f_sine: Frequency
    """frequency of the sine"""
    more_K: Share
    """relative deviation of motor 2's torque constant from the parameter set"""
    more_J: Share
    """relative deviation of motor 2's inertia from the parameter set"""
    more_R: Share
    """relative deviation of motor 2's resistance from the parameter set"""
    more_D: Share
    """relative deviation of motor 2's viscous damping from the parameter set"""
    duration: Duration
    """recording time of each motion"""
    record: Duration
    """recording interval"""


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return each motion with equal motors and with a different motor 2."""
    modes = {"rig.mode_1": "position", "rig.mode_2": "position"}
    motor = par.motor_2
    different = {
        "motor_2.K_ref": motor.K_ref * (1.0 + options.more_K),
        "motor_2.J_M": motor.J_M * (1.0 + options.more_J),
        "motor_2.R_ref": motor.R_ref * (1.0 + options.more_R),
        "motor_2.D_M": motor.D_M * (1.0 + options.more_D),
    }
    return tuple(
        screw_case(
            f"{motion}_{pair}",
            par,
            _reference(motion, options),
            options.duration,
            modes | changes,
            record=options.record,
        )
        for motion in _MOTIONS
        for pair, changes in (("equal", {}), ("unequal", different))
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the maximum forces with equal and unequal motors."""
    kpis: list[Kpi] = []
    for label in _LABELS:
        kpis += PEAK(f"_{label}", peak_force=peak(recordings[label], "y_F"))
    for pair in _PAIRS:
        run = recordings[f"step{pair}"]
        held = abs(mean(run, "y_F", 0.9 * options.duration, options.duration))
        kpis += HELD(pair, static_force=held)
    run = recordings["sine_unequal"]
    apart = np.abs(run["q_1"].values - run["q_2"].values).max()
    return (*kpis, *APART("_sine_unequal", peak_difference=apart))


def _reference(motion: str, options: Options) -> Any:
    """Return the common reference of both motors for one motion."""
    w = 2.0 * math.pi * options.f_sine

    def stimulus(t: Array) -> dict[str, Array]:
        after = np.maximum(t, 0.0)
        theta = {
            "step": np.where(t >= -1e-9, options.a_step, 0.0),
            "ramp": options.omega_ramp * after,
            "sine": options.a_sine * np.sin(w * after),
        }[motion]
        return {"theta_1_set": theta, "theta_2_set": theta}

    return stimulus


EXPERIMENT = Experiment(
    name="force-fight",
    assembly="wedge-brake",
    summary="force between two equal or unequal motors that follow one reference",
    options=Options,
    defaults=Options(
        a_step=1.0,
        omega_ramp=60.0,
        a_sine=0.5,
        f_sine=20.0,
        more_K=-0.05,
        more_J=0.05,
        more_R=0.10,
        more_D=0.50,
        duration=0.3,
        record=2e-4,
    ),
    cases=cases,
    judge=judge,
    kpis=PEAK.ending(*(f"_{label}" for label in _LABELS))
    | HELD.ending(*_PAIRS)
    | APART.ending("_sine_unequal"),
    figures=("time-traces", "energy-balance"),
)
