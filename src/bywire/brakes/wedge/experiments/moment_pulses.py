"""Moment pulses: a step of the moment demand, then pulses to 80 % (Roberts 2003, Fig. 7)."""

from __future__ import annotations

import math
from typing import Annotated

import xarray as xr
from pydantic import Field

from bywire.bench.experiment import Case, Experiment, Recordings
from bywire.bench.kpis.kpi import Figures, Kpi
from bywire.brakes.wedge.case import (
    BRAKING,
    braking,
    case_from_parked,
    mean,
    steps,
    swing,
)
from bywire.brakes.wedge.laws.moment_control import SomeMoment
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.rows import along_disc, last_turn, too_coarse
from bywire.core.parameters import ParameterSet
from bywire.core.quantities import Duration, Fraction, Unit

Count = Annotated[int, Unit("1", 3.0), Field(ge=1, le=100)]

_OVER = "over the disc's last revolution of the hold; over its second half where that is shorter"
FIGURES = Figures(
    hold_moment=("N*m", f"Mean moment {_OVER}."),
    hold_error=(
        "%",
        "That moment less the demand, over the demand: far below 0 where the demand is beyond "
        "the brake.",
    ),
    hold_ripple=("N*m", f"Moment peak to peak {_OVER}: the disc's run-out."),
    hold_power=("W", f"Mean input power {_OVER}, standby included."),
    brake_power=("W", f"Mean braking power {_OVER}."),
    pulse_moment=(
        "N*m",
        "Mean moment over the disc's last revolution of the first pulse; over the pulse's "
        "last fifth where it is shorter.",
    ),
)


class Options(ParameterSet):
    """The braking maneuver; its times are ours, the figure's text gives none."""

    M_high: SomeMoment
    """moment demanded"""
    low: Fraction
    """share of it to which the pulses fall"""
    t_hold: Duration
    """time from the step to the first pulse"""
    t_low: Duration
    """length of each pulse"""
    t_high: Duration
    """time between pulses, and after the last one"""
    pulses: Count
    """number of pulses"""
    settle: Duration
    """time parked before the step"""


def _end(options: Options) -> float:
    return options.t_hold + options.pulses * (options.t_low + options.t_high)


def cases(par: WedgeParameters, options: Options, _: object = None) -> tuple[Case, ...]:
    """Return the one run."""
    levels = {0.0: options.M_high}
    for k in range(options.pulses):
        begin = options.t_hold + k * (options.t_low + options.t_high)
        levels[begin] = options.low * options.M_high
        levels[begin + options.t_low] = options.M_high
    return (
        case_from_parked(
            par,
            lambda t: {"M_set": steps(t, levels)},
            _end(options),
            settle=options.settle,
            keep=options.settle,
        ),
    )


def judge(recordings: Recordings, options: Options) -> tuple[Kpi, ...]:
    """Return the figures of the braking, of its hold and of its pulses."""
    run = along_disc(recordings["run"])
    begin, end = _turn(run, 0.0, options.t_hold, 0.5)
    held = too_coarse(run, begin, end)
    hold, power = (math.nan if held else mean(run, name, begin, end) for name in ("M_B", "P_in"))
    ripple = math.nan if held else swing(run, "M_B", begin, end)
    pulses = FIGURES(
        hold_moment=(hold, held),
        hold_error=(100.0 * (hold / options.M_high - 1.0), held),
        hold_ripple=(ripple, held),
        hold_power=(power, held),
        brake_power=(hold * mean(run, "Omega", begin, end), held),
        pulse_moment=_pulse(run, options),
    )
    return (*braking(run, options.M_high, options.t_hold), *pulses)


def _turn(run: xr.Dataset, begin: float, end: float, last: float) -> tuple[float, float]:
    """Return begin and end of what counts of a time [s], the rows at its ends left out.

    The disc's last revolution in it, over which the run-out averages out; where there is none,
    the ``last`` share of it.
    """
    turn = last_turn(run, begin, end)
    start = end - last * (end - begin) if turn is None else turn
    return start + 2e-9, end - 2e-9


def _pulse(run: xr.Dataset, options: Options) -> tuple[float, str]:
    """Return the moment in the first pulse; over less than a revolution the run-out would show."""
    begin, end = _turn(run, options.t_hold, options.t_hold + options.t_low, 0.2)
    problem = too_coarse(run, begin, end)
    return math.nan if problem else mean(run, "M_B", begin, end), problem


EXPERIMENT = Experiment(
    name="moment-pulses",
    assembly="wedge-brake",
    summary="moment step to {M_high}, then pulses to {low:%} (Fig. 7)",
    options=Options,
    defaults=Options(
        M_high=200.0, low=0.8, t_hold=0.5, t_low=0.2, t_high=0.2, pulses=3, settle=0.05
    ),
    cases=cases,
    judge=judge,
    kpis=BRAKING.units | FIGURES.units,
    figures=("time-traces", "energy-balance"),
)
