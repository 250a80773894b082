"""Slow rotation: a motor's current during one slow revolution forward and back.

Cogging depends only on the angle, and dry friction only on the direction. Motion in both
directions therefore separates them.
"""

from __future__ import annotations

import math

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import parameters_of, shaft_case, torque_constant_of
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration
from bywire.core.typing import Array
from bywire.plant.axial_bearing import AngularSpeed

_STARTED = 0.05  # fraction of a stroke after which the motion is treated as steady
FIGURES = Figures(
    torque_forward=("N*m", "Mean torque from the current, forward."),
    torque_backward=("N*m", "Mean torque from the current, backward."),
    friction_torque=("N*m", "Half the difference between torque_forward and torque_backward."),
    ripple=("N*m", "Amplitude of a sine with the same RMS as the torque ripple."),
    cogging_true=("N*m", "True amplitude of the cogging torque."),
    undefined="the recording has no row during steady motion",
)


class Options(ParameterSet):
    """One revolution in each direction, too fast to stick and slow for the position loop."""

    omega_slow: AngularSpeed
    """speed of the motion"""
    settle: Duration
    """time at rest before the motion"""
    record: Duration
    """recording interval"""


def stroke(options: Options) -> float:
    """Return the time of one revolution [s]."""
    return 2.0 * math.pi / options.omega_slow


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the single run, on a dummy shaft."""
    T = stroke(options)

    def there_and_back(t: Array) -> dict[str, Array]:
        return {"theta_1_set": options.omega_slow * np.clip(np.minimum(t, 2.0 * T - t), 0.0, T)}

    rig = {"rig.mode_1": "position", "rig.load": "dummy", "rig.clamp": "open"}
    return (
        shaft_case(
            "run", par, there_and_back, 2.0 * T, rig, settle=options.settle, record=options.record
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return mean torques in both directions, half their difference as friction, and the ripple."""
    run, T = recordings["run"], stroke(options)
    par = parameters_of(run)
    K = torque_constant_of(par)
    ways = [
        K * run["i_1"].sel(time=slice((k + _STARTED) * T, (k + 1.0 - _STARTED) * T)).values
        for k in (0, 1)
    ]
    forward, backward = (float(way.mean()) if way.size else math.nan for way in ways)
    ripple = float(np.mean([way.std() for way in ways])) if all(w.size for w in ways) else math.nan
    return FIGURES(
        torque_forward=forward,
        torque_backward=backward,
        friction_torque=0.5 * (forward - backward),
        ripple=math.sqrt(2.0) * ripple,
        cogging_true=par.motor_1.T_cog,
    )


EXPERIMENT = Experiment(
    name="slow-rotation",
    assembly="wedge-brake",
    summary="one slow revolution forward and back: cogging torque and dry friction",
    options=Options,
    defaults=Options(omega_slow=0.5, settle=0.05, record=1e-3),
    cases=cases,
    judge=judge,
    kpis=FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
