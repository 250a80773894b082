"""Position steps of a single motor on its rig: what its two experiments have in common."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from bywire.bench.experiment import Case, Recordings
from bywire.bench.kpis import step_response
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.kpis.registry import evaluate
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.rig_case import parameters_of, peak, shaft_case, share_at
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency, Unit
from bywire.core.typing import Array

SomeAngle = Annotated[float, Unit("rad", 0.5), Field(gt=0, le=100, allow_inf_nan=False)]

_STEP = {
    "rise_time": "s",
    "overshoot": "%",
    "settling_time": "s",
    "steady_state_error": "rad",
}
_OWN = {"peak_current": "A", "current_limit": "%"}
_LOOPS, _SIZES = ("low", "high"), ("small", "medium", "large")
CASES = tuple(f"{loop}_{size}" for loop in _LOOPS for size in _SIZES)
UNITS = {f"{name}_{case}": unit for case in CASES for name, unit in (_STEP | _OWN).items()}
"""units of the key figures of :func:`judge`"""


class Options(ParameterSet):
    """Steps of three amplitudes with a low and a high bandwidth."""

    a_small: SomeAngle
    """smallest step"""
    a_medium: SomeAngle
    """middle step"""
    a_large: SomeAngle
    """largest step"""
    f_low: Frequency
    """natural frequency of the low-bandwidth controller"""
    f_high: Frequency
    """natural frequency of the high-bandwidth controller"""
    duration: Duration
    """time recorded after each step"""
    settle: Duration
    """time at rest before each step"""
    record: Duration
    """recording interval"""


DEFAULTS = Options(
    a_small=0.5, a_medium=1.0, a_large=2.0, f_low=12.0, f_high=60.0,
    duration=0.3, settle=0.01, record=2e-4,
)  # fmt: skip


def cases(par: WedgeParameters, options: Options, rig: Mapping[str, Any]) -> tuple[Case, ...]:
    """Return one run per bandwidth and amplitude.

    Parameters
    ----------
    rig
        What the experiment sets of the rig, beside position control.
    """
    return tuple(
        shaft_case(
            f"{loop}_{size}", par, _step(_amplitude(options, size)), options.duration,
            {**rig, "rig.mode_1": "position", "control.position.f_n": _frequency(options, loop)},
            settle=options.settle, keep=options.settle, record=options.record,
        )
        for loop in _LOOPS for size in _SIZES
    )  # fmt: skip


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the figures of all steps, their names with the case's label behind."""
    found: list[Kpi] = []
    for label in CASES:
        run, end = recordings[label], _amplitude(options, label.partition("_")[2])
        step = evaluate("step_response", run, step_response.Setting("theta_1", 0.0, 0.0, end))
        found += [
            Kpi(f"{name}_{label}", own.value, own.unit, own.definition, own.note)
            for name, own in ((name, step[name]) for name in _STEP)
        ]
        limit = parameters_of(run).control.position.i_max
        found += [
            Kpi(f"peak_current_{label}", peak(run, "i_1"), "A", "Largest motor current."),
            Kpi(f"current_limit_{label}", share_at(run, "i_1_ref", limit), "%",
                "Share of the time after the step with the current demand at its limit."),
        ]  # fmt: skip
    return tuple(found)


def stiffness(par: WedgeParameters) -> float:
    """Return the torque per angle error [N m/rad] of the position loop."""
    own = par.control.position
    inertia = own.J_hat * par.motor_1.K_ref / own.K_hat
    return inertia * (2.0 * math.pi * own.f_n) ** 2


def _amplitude(options: Options, size: str) -> float:
    sizes = (options.a_small, options.a_medium, options.a_large)
    return sizes[_SIZES.index(size)]


def _frequency(options: Options, loop: str) -> float:
    return (options.f_low, options.f_high)[_LOOPS.index(loop)]


def _step(level: float) -> Any:
    def stimulus(t: Array) -> dict[str, Array]:
        return {"theta_1_set": np.where(t >= -1e-9, level, 0.0)}

    return stimulus
