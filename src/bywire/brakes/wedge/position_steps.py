"""Position steps of a single motor on its rig: what its two experiments have in common."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any

from pydantic import Field

from bywire.bench.experiment import Case, Recordings
from bywire.bench.kpis import step_response
from bywire.bench.kpis.families import evaluate, units_of
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import parameters_of, steps
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.rig_case import Stimuli, peak, shaft_case, share_at
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency, Unit

SomeAngle = Annotated[float, Unit("rad", 0.5), Field(gt=0, le=100, allow_inf_nan=False)]

STEP = ("rise_time", "overshoot", "settling_time", "steady_state_error")
CURRENT = Figures(
    peak_current=("A", "Largest motor current."),
    current_limit=("%", "Share of the time after the step with the current demand at its limit."),
)
_EACH = {name: units_of("step_response", resolved={"level": "rad"})[name] for name in STEP}
_LOOPS, _SIZES = ("low", "high"), ("small", "medium", "large")
CASES = tuple(f"{loop}_{size}" for loop in _LOOPS for size in _SIZES)
UNITS = {f"{name}_{case}": unit for case in CASES for name, unit in (_EACH | CURRENT.units).items()}
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
    a_small=0.5,
    a_medium=1.0,
    a_large=2.0,
    f_low=12.0,
    f_high=60.0,
    duration=0.3,
    settle=0.01,
    record=2e-4,
)


def cases(par: WedgeParameters, options: Options, rig: Mapping[str, Any]) -> tuple[Case, ...]:
    """Return one run per bandwidth and amplitude.

    ``rig``: what the experiment sets of the rig, beside position control.
    """
    return tuple(
        shaft_case(
            f"{loop}_{size}",
            par,
            _stepped(_amplitude(options, size)),
            options.duration,
            {**rig, "rig.mode_1": "position", "control.position.f_n": _frequency(options, loop)},
            settle=options.settle,
            keep=options.settle,
            record=options.record,
        )
        for loop in _LOOPS
        for size in _SIZES
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the figures of all steps, their names with the case's label behind."""
    kpis: list[Kpi] = []
    for label in CASES:
        run, end = recordings[label], _amplitude(options, label.partition("_")[2])
        step = evaluate("step_response", run, step_response.Setting("theta_1", 0.0, 0.0, end))
        kpis += [replace(step[name], name=f"{name}_{label}") for name in STEP]
        limit = parameters_of(run).control.position.i_max
        kpis += CURRENT(
            f"_{label}",
            peak_current=peak(run, "i_1"),
            current_limit=share_at(run, "i_1_ref", limit),
        )
    return tuple(kpis)


def stiffness(par: WedgeParameters) -> float:
    """Return the torque per angle error [N m/rad] of the position loop."""
    law = par.control.position
    inertia = law.J_hat * par.motor_1.K_ref / law.K_hat
    return inertia * (2.0 * math.pi * law.f_n) ** 2


def _amplitude(options: Options, size: str) -> float:
    sizes = (options.a_small, options.a_medium, options.a_large)
    return sizes[_SIZES.index(size)]


def _frequency(options: Options, loop: str) -> float:
    return (options.f_low, options.f_high)[_LOOPS.index(loop)]


def _stepped(level: float) -> Stimuli:
    return lambda t: {"theta_1_set": steps(t, {0.0: level})}
