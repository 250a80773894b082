"""Friction sweep: a closed-loop moment step at several pad friction coefficients.

Above tan(alpha) the wedge is unstable without control. The paper announces tests with extreme
coefficients (Roberts et al. 2003, sections "Introduction" and "Programme status").
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.families import evaluate, units_of
from bywire.bench.kpis.kpi import Figures, Kpi, Undefined
from bywire.bench.kpis.step_response import Setting
from bywire.brakes.wedge.case import (
    FRICTIONLESS,
    Coefficients,
    case_from_parked,
    mean,
    steps,
    tag,
    with_friction,
)
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.panels import COMPARED
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration

if TYPE_CHECKING:
    import xarray as xr

_BAND = 0.05  # half width of a stable loop's final band, relative to the step
_LAST = 0.2  # evaluated last fraction of the hold
_NO_ROW = "the recording has no row in this time. Record more often"

EACH = Figures(
    stable=(
        "1",
        "1 if the moment stays within 5 % of the step in the last fifth of the hold, without an "
        "end stop.",
    ),
    hold_power=("W", "Mean input power in the last fifth of the hold, including standby."),
    undefined=_NO_ROW,
)
ALL = Figures(
    unstable=("1", "Number of friction coefficients at which the loop is not stable."),
    overshoot_max=("%", "Maximum overshoot."),
    settling_time_max=("s", "Maximum settling time (2 %)."),
    hold_power_min=("W", "Minimum hold power."),
    hold_power_max=("W", "Maximum hold power."),
    undefined=_NO_ROW,
)


class Options(ParameterSet):
    """The step, and the variations.

    ``slope``: with ``"known"``, the controller uses the correct slope of moment versus angle for
    each coefficient. With ``"fixed"``, it uses the slope from the parameter set.
    ``friction``: ``"none"`` removes the brake's dry friction, which helps to hold the moment.
    """

    M_step: SomeMoment
    """moment demand"""
    t_hold: Duration
    """recording time after the step"""
    mu_B: Coefficients
    """pad friction coefficients"""
    slope: Literal["known", "fixed"]
    """whether the controller uses the true friction coefficient"""
    friction: Literal["kept", "none"]
    """whether the brake has dry friction"""
    settle: Duration
    """time parked before the step"""


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return one run per friction coefficient, without runout, which would mask other effects."""
    levels = {0.0: options.M_step}
    changes: dict[str, Any] = {"flywheel.runout": 0.0}
    if options.friction == "none":
        changes |= FRICTIONLESS
    return tuple(
        case_from_parked(
            par,
            lambda t: {"M_set": steps(t, levels)},
            options.t_hold,
            changes | with_friction(par, mu_B, options.slope == "known"),
            label=tag(mu_B),
            settle=options.settle,
            keep=options.settle,
        )
        for mu_B in options.mu_B
    )


def _stable(run: xr.Dataset, options: Options) -> tuple[float, str]:
    """Return 1 if the moment ends within 5 % of the step, without the help of an end stop."""
    last = run.sel(time=slice((1.0 - _LAST) * options.t_hold, None))
    if not last.sizes["time"]:
        return math.nan, _NO_ROW
    if not last["F_N"].values.any():
        return math.nan, "the pads are not applied, so the moment loop is open"
    away = np.abs(np.abs(last["M_B"].values) - options.M_step).max()
    return float(away <= _BAND * options.M_step and not run["F_end"].values.any()), ""


def _each(run: xr.Dataset, mu_B: float, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures of one friction coefficient."""
    backward = float(run["Omega"].values[0]) < 0
    end = -options.M_step if backward else options.M_step
    step = evaluate("step_response", run, Setting("M_B", t_step=0.0, start=0.0, end=end))
    begin, at = (1.0 - _LAST) * options.t_hold, f"_{tag(mu_B)}"
    return (
        *EACH(at, stable=_stable(run, options)),
        replace(step["overshoot"], name="overshoot" + at),
        replace(step["settling_time"], name="settling_time" + at),
        *EACH(at, hold_power=mean(run, "P_in", begin, options.t_hold)),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the key figures of each friction coefficient, and the worst values."""
    each = {mu_B: _each(recordings[tag(mu_B)], mu_B, options) for mu_B in options.mu_B}
    stable, overshoot, settling, power = (
        [kpi.value for kpi in column] for column in zip(*each.values(), strict=True)
    )
    unknown = [f"{m:g}" for m, y in zip(options.mu_B, overshoot, strict=True) if math.isnan(y)]
    slow = [f"{m:g}" for m, t in zip(options.mu_B, settling, strict=True) if math.isnan(t)]
    unjudged = sum(math.isnan(value) for value in stable)
    overall = ALL(
        unstable=(math.nan, f"stability is undefined at {unjudged} coefficients")
        if unjudged
        else float(sum(value == 0 for value in stable)),
        overshoot_max=Undefined(f"open at mu_B = {', '.join(unknown)}", is_open=True)
        if unknown
        else max(overshoot),
        settling_time_max=(math.nan, f"not settled at mu_B = {', '.join(slow)}")
        if slow
        else max(settling),
        hold_power_min=min(power),
        hold_power_max=max(power),
    )
    return (*(kpi for kpis in each.values() for kpi in kpis), *overall)


def named(options: Options) -> dict[str, str]:
    """Return the unit of every key figure."""
    units = units_of("step_response") | EACH.units
    each = ("stable", "overshoot", "settling_time", "hold_power")
    return {f"{k}_{tag(mu_B)}": units[k] for mu_B in options.mu_B for k in each} | ALL.units


_DEFAULTS = Options(
    M_step=200.0,
    t_hold=1.0,
    mu_B=(0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6),
    slope="known",
    friction="kept",
    settle=0.05,
)

EXPERIMENT = Experiment(
    name="friction-sweep",
    assembly="wedge-brake",
    summary="{M_step} steps at pad friction coefficients of {mu_B}: stability, overshoot, "
    "settling, hold power",
    options=Options,
    defaults=_DEFAULTS,
    cases=cases,
    judge=judge,
    kpis=named(_DEFAULTS),
    figures=("overlaid-traces",),
    compared=COMPARED,
    named=named,
)
