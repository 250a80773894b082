"""Gains of a loop from requirements: linear design, trial and retuning on the nonlinear bench."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from bywire.analysis.loop import LOOPS
from bywire.api.design_answer import LoopDesign, LoopScheduleDesign
from bywire.api.design_drawn import (
    DRAWN,
    drawn_models,
    probability_of,
    probability_wanted,
)
from bywire.api.design_inputs import (
    for_ecu,
    left_to_choose,
    narrowed,
    requirements_of,
    trial_of,
    tunables_of,
)
from bywire.api.loop_case import loop_case, over_range, spread
from bywire.bench.requirements import Limit
from bywire.bench.running import Progress
from bywire.core.arguments import whole_number
from bywire.core.blas import on_one_thread
from bywire.core.errors import ParameterError
from bywire.report.answer import use_case
from bywire.synthesis import designer
from bywire.synthesis.linear_case import cases_of
from bywire.synthesis.outcome import Across
from bywire.synthesis.schedules import (
    design_schedule,
    frozen,
    points_by_region,
    scheduled,
    verify_schedule,
)
from bywire.synthesis.verification import verify


@use_case
@on_one_thread()
def design(
    loop: str,
    parameters: str = "",
    at: str = "",
    overrides: Mapping[str, Any] = MappingProxyType({}),
    *,
    require: Sequence[str] = (),
    requirements: str | Path | None = None,
    over: Sequence[str] = (),
    amplitudes: str = "",
    schedule: bool = False,
    linear_only: bool = False,
    free_derivative: bool = False,
    vary: str | Path = "",
    drawn: int = DRAWN,
    probability: str = "",
    seed: int = 0,
    progress: Progress | None = None,
    side: str = "",
) -> LoopDesign | LoopScheduleDesign:
    """Choose a loop's gains from requirements.

    Parameters
    ----------
    loop, parameters, at, overrides
        As of `bywire.margins`; parameters that are set are not chosen. With ``schedule``, ``at``
        lists points of all regions.
    require
        Requirements, for instance ``"bandwidth >= 10 Hz"``.
    requirements
        TOML file with a section ``requirements``.
    over
        Ranges to serve too, ``"NAME=LOW:HIGH:COUNT"`` each.
    amplitudes
        Of the sines on the bench, with units and commas; the loop's own by default.
    schedule
        Whether the gains are chosen by region.
    linear_only
        Whether the nonlinear bench is left out.
    free_derivative
        Whether the derivative's filter may be faster than the sampling and the set point be
        differentiated: better figures of gains that one would hardly put into an ECU.
    vary
        Study file: the gains are chosen for models that are drawn as its cases are, and judged by
        others.
    drawn
        How many models they are chosen for.
    probability
        With which all requirements are to be met together, for instance ``"99 %"``.
    seed
        Of the searches.
    progress
        Called with a label and the finished share, 0 to 1.
    side
        Of the linear models, as of `bywire.margins`.

    Returns
    -------
    LoopDesign or LoopScheduleDesign
        Gains in SI units, the figures that they give, which requirement binds, and what the bench
        shows of them.

    Raises
    ------
    InputError
        For names that are unknown, values out of range, and requirements that make no sense.
    """
    whole_number("seed", seed, 0, 2**63 - 1)
    if schedule and vary:
        raise ParameterError("schedule and vary: gains by region are not chosen for drawn models")
    if probability_wanted(probability) is not None and not vary:
        raise ParameterError("probability needs drawn models: name a study file, --vary FILE")
    if schedule:
        return _scheduled(
            loop,
            parameters,
            at,
            overrides,
            requirements_of(requirements, require),
            over,
            None if linear_only else amplitudes,
            free_derivative,
            seed,
            progress,
            side,
        )
    case = loop_case(loop, parameters, at, overrides, side)
    wanted = requirements_of(requirements, require)
    case, overrides, limits = for_ecu(case, overrides, free_derivative)
    tunables = left_to_choose(loop, narrowed(tunables_of(case), limits), overrides)
    ranges = dict(over_range(text, case)[::2] for text in over)
    models = drawn_models(case, vary, drawn) if vary else None
    cases = cases_of(case.loop, case.par, case.value, ranges)
    cases += () if models is None else models.cases
    trial = None if linear_only else trial_of(case, overrides, amplitudes)
    start = {name: case.par.leaves()[name] for name in tunables}
    tried = None
    designed = designer.design(tunables, wanted, cases, start, seed=seed, progress=progress)
    if trial is not None and designed.status == "met":
        tried = verify(designed.gains, wanted, tunables, cases, trial, seed=seed, progress=progress)
    final = designed.gains if tried is None else tried.final.gains
    told = None if models is None else probability_of(models, wanted, final, probability, progress)
    return LoopDesign(case, overrides, wanted, limits, tried, designed, told)


def _scheduled(
    name: str,
    parameters: str,
    at: str,
    overrides: Mapping[str, Any],
    wanted: tuple[Limit, ...],
    over: Sequence[str],
    amplitudes: str | None,
    free_derivative: bool,
    seed: int,
    progress: Progress | None,
    side: str,
) -> LoopScheduleDesign:
    schedule = scheduled(LOOPS.find(name))
    overrides = {**overrides, **schedule.changes}
    case = loop_case(name, parameters, "", overrides, side)
    loop = case.loop
    case, overrides, limits = for_ecu(case, overrides, free_derivative)
    given = spread(at, loop.at.unit, loop.at.name) if at else []
    points = points_by_region(loop, case.par, given)
    case = replace(case, value=points[schedule.main][0])
    tunables = {
        region: {n: span for n, span in narrowed(spans, limits).items() if n not in overrides}
        for region, spans in schedule.regions.items()
    }
    ranges = dict(over_range(text, case)[::2] for text in over)
    trial = None if amplitudes is None else trial_of(case, overrides, amplitudes)
    tried = None
    designed = design_schedule(
        loop, case.par, wanted, points, tunables, over=ranges, seed=seed, progress=progress
    )
    if trial is not None and designed.status == "met":
        tried = verify_schedule(designed, wanted, tunables, trial, seed=seed, progress=progress)
    retuned: tuple[Across, ...] = ()
    if tried is not None and tried.tuning is not None:
        every = [value for values in points.values() for value in values]
        retuned = frozen(loop, case.par, every, tried.final.gains, wanted)
    return LoopScheduleDesign(case, overrides, wanted, limits, tried, designed, retuned)
