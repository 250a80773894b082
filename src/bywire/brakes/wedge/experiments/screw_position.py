"""Position steps of a single motor on its rig at two bandwidths, with screw or dummy shaft."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis import step_response
from bywire.bench.kpis.families import evaluate, units_of
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import Stimuli, parameters_of, peak, shaft_case, steps
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rigs.shaft_rig import friction
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Frequency, Unit

if TYPE_CHECKING:
    import xarray as xr

SomeAngle = Annotated[float, Unit("rad", 0.5), Field(gt=0, le=100, allow_inf_nan=False)]

STEP = ("rise_time", "overshoot", "settling_time", "steady_state_error")
CURRENT = Figures(
    peak_current=("A", "Maximum motor current."),
    current_limit=("%", "Fraction of time after the step with the current demand at its limit."),
)
_EACH = {name: units_of("step_response", resolved={"level": "rad"})[name] for name in STEP}
_LOOPS, _SIZES = ("low", "high"), ("small", "medium", "large")
_CASES = tuple(f"{loop}_{size}" for loop in _LOOPS for size in _SIZES)
_UNITS = {
    f"{name}_{case}": unit for case in _CASES for name, unit in (_EACH | CURRENT.units).items()
}
"""units of the key figures of :func:`judge_steps`"""


class StepsOptions(ParameterSet):
    """Steps of three amplitudes at a low and a high bandwidth."""

    a_small: SomeAngle
    """minimum step"""
    a_medium: SomeAngle
    """middle step"""
    a_large: SomeAngle
    """maximum step"""
    f_low: Frequency
    """natural frequency of the low-bandwidth controller"""
    f_high: Frequency
    """natural frequency of the high-bandwidth controller"""
    duration: Duration
    """recording time after each step"""
    settle: Duration
    """time at rest before each step"""
    record: Duration
    """recording interval"""


_DEFAULTS = StepsOptions(
    a_small=0.5,
    a_medium=1.0,
    a_large=2.0,
    f_low=12.0,
    f_high=60.0,
    duration=0.3,
    settle=0.01,
    record=2e-4,
)


def _step_cases(
    par: WedgeParameters, options: StepsOptions, rig: Mapping[str, Any]
) -> tuple[Case, ...]:
    """Return one run per bandwidth and amplitude.

    ``rig``: parameters of the rig that the experiment sets in addition to position control.
    """
    return tuple(
        shaft_case(
            f"{loop}_{size}",
            par,
            _stepped(options.value(f"a_{size}")),
            options.duration,
            {**rig, "rig.mode_1": "position", "control.position.f_n": options.value(f"f_{loop}")},
            settle=options.settle,
            keep=options.settle,
            record=options.record,
        )
        for loop in _LOOPS
        for size in _SIZES
    )


def judge_steps(recordings: Recordings, options: StepsOptions) -> tuple[Kpi, ...]:
    """Return the key figures of all steps. The label of the case follows each name."""
    kpis: list[Kpi] = []
    for label in _CASES:
        run, end = recordings[label], options.value(f"a_{label.partition('_')[2]}")
        step = evaluate("step_response", run, step_response.Setting("theta_1", 0.0, 0.0, end))
        kpis += [replace(step[name], name=f"{name}_{label}") for name in STEP]
        limit = parameters_of(run).control.position.i_max
        kpis += CURRENT(
            f"_{label}",
            peak_current=peak(run, "i_1"),
            current_limit=_share_at(run, "i_1_ref", limit),
        )
    return tuple(kpis)


def _share_at(run: xr.Dataset, name: str, limit: float) -> float:
    """Return the fraction of time after zero with a signal's magnitude at a limit [%]."""
    after = np.abs(run[name].sel(time=slice(-1e-9, None)).values)
    return 100.0 * float(np.mean(after >= limit * (1.0 - 1e-9)))


def _stepped(level: float) -> Stimuli:
    return lambda t: {"theta_1_set": steps(t, {0.0: level})}


# --- Preloaded roller screw

BAND = Figures(
    dead_band=("rad", "Maximum angle error that friction and cogging can hold at rest."),
)


def judge_screw_position(recordings: Recordings, options: StepsOptions) -> tuple[Kpi, ...]:
    """Return the key figures of all steps, and the angle error that friction can hold."""
    bands: list[Kpi] = []
    for loop in _LOOPS:
        par = parameters_of(recordings[f"{loop}_small"])
        held = max(abs(bound) for bound in friction(0.0, 0.0, par))
        band = (held + par.motor_1.T_cog) / _stiffness(par)
        bands += BAND(f"_{loop}", dead_band=band)
    return (*judge_steps(recordings, options), *bands)


def _stiffness(par: WedgeParameters) -> float:
    """Return the torque per angle error [N m/rad] of the position loop."""
    law = par.control.position
    inertia = law.J_hat * par.motor_1.K_ref / law.K_hat
    return inertia * (2.0 * math.pi * law.f_n) ** 2


SCREW_POSITION = Experiment(
    name="screw-position",
    assembly="wedge-brake",
    summary="position steps of a single motor with a preloaded roller screw, at two bandwidths",
    options=StepsOptions,
    defaults=_DEFAULTS,
    cases=lambda par, options, _: _step_cases(
        par, options, {"rig.load": "screw", "rig.clamp": "open"}
    ),
    judge=judge_screw_position,
    kpis=_UNITS | BAND.ending(*(f"_{loop}" for loop in _LOOPS)),
    figures=("time-traces", "energy-balance"),
)


# --- Dummy shaft

DUMMY_SHAFT = Experiment(
    name="dummy-shaft",
    assembly="wedge-brake",
    summary="position steps of a single motor with a dummy shaft, at two bandwidths",
    options=StepsOptions,
    defaults=_DEFAULTS,
    cases=lambda par, options, _: _step_cases(
        par, options, {"rig.load": "dummy", "rig.clamp": "open"}
    ),
    judge=judge_steps,
    kpis=_UNITS,
    figures=("time-traces", "energy-balance"),
)
