"""Current loop: current steps of a clamped motor for several windings and controller gains."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Annotated, Any

from pydantic import Field

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis import step_response
from bywire.bench.kpis.families import evaluate, units_of
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import check_current, shaft_case, steps
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Current, Duration, Unit

_Shares = tuple[Annotated[float, Field(gt=0, allow_inf_nan=False)], ...]
ThreeFactors = Annotated[_Shares, Unit("1", 2.0), Field(min_length=3, max_length=3)]

_WINDINGS, _GAINS = ("parallel", "single", "series"), ("soft", "usual", "sharp")
_FIGURES = ("rise_time", "overshoot", "settling_time")  # of the step response
_LABELS = tuple(f"{winding}_{gain}" for winding in _WINDINGS for gain in _GAINS)
LAG = Figures(bandwidth=("Hz", "Corner frequency of a first-order lag with this rise time."))
_UNITS = {name: units_of("step_response")[name] for name in _FIGURES} | LAG.units


class Options(ParameterSet):
    """The step, and the windings and gains at which it is repeated.

    A motor unit has two stators. They work in parallel, in series, or one of them alone.
    """

    i_step: Current
    """current demand after the step"""
    windings: ThreeFactors
    """resistance and inductance relative to the parameter set: parallel, single, series"""
    gains: ThreeFactors
    """current controller gains relative to the parameter set: low, nominal, high"""
    duration: Duration
    """recording time after the step"""
    record: Duration
    """recording interval"""


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return one run per winding and gain, with a clamped shaft."""
    check_current("i_step", options.i_step, par)
    factors = product(options.windings, options.gains)
    runs: list[Case] = []
    for label, (winding, gain) in zip(_LABELS, factors, strict=True):
        changes: dict[str, Any] = {
            "rig.load": "dummy",
            "rig.clamp": "closed",
            "rig.mode_1": "current",
            "motor_1.R_ref": winding * par.motor_1.R_ref,
            "motor_1.L_M": winding * par.motor_1.L_M,
            "drive.k_p": gain * par.drive.k_p,
            "drive.k_i": gain * par.drive.k_i,
        }
        runs.append(
            shaft_case(
                label,
                par,
                lambda t: {"i_1_set": steps(t, {0.0: options.i_step})},
                options.duration,
                changes,
                settle=par.control.T_fast,
                keep=par.control.T_fast,
                record=options.record,
            )
        )
    return tuple(runs)


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures of all steps. The label of the case follows each name."""
    kpis: list[Kpi] = []
    for label in _LABELS:
        setting = step_response.Setting("i_1", 0.0, 0.0, options.i_step)
        step = evaluate("step_response", recordings[label], setting)
        kpis += [replace(step[name], name=f"{name}_{label}") for name in _FIGURES]
        rise = step["rise_time"]
        # A first-order lag with corner frequency f rises from 10 to 90 % within ln(9) / (2 pi f).
        bandwidth = math.log(9.0) / (2.0 * math.pi * rise.value)
        kpis += LAG(f"_{label}", bandwidth=(bandwidth, rise.note))
    return tuple(kpis)


EXPERIMENT = Experiment(
    name="current-loop",
    assembly="wedge-brake",
    summary="current steps of a clamped motor for several windings and controller gains",
    options=Options,
    defaults=Options(
        i_step=5.0, windings=(1.0, 2.0, 4.0), gains=(0.5, 1.0, 2.0), duration=0.01, record=2e-5
    ),
    cases=cases,
    judge=judge,
    kpis={f"{name}_{label}": unit for label in _LABELS for name, unit in _UNITS.items()},
    figures=("time-traces",),
)
