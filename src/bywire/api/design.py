"""Gains of a loop from requirements: linear design, trial and retuning on the nonlinear bench."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from bywire.analysis.loop import LOOPS
from bywire.api.design_answer import LoopScheduleDesign
from bywire.api.design_inputs import (
    for_ecu,
    narrowed,
    trial_of,
)
from bywire.api.loop_case import loop_case, over_range, spread
from bywire.bench.requirements import Limit
from bywire.bench.running import Progress
from bywire.synthesis.outcome import Across
from bywire.synthesis.schedules import (
    design_schedule,
    frozen,
    points_by_region,
    scheduled,
    verify_schedule,
)


def designed_by_region(
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
    """Return gains by region of the operating point.

    ``wanted``: the requirements; ``amplitudes``: None without the nonlinear bench; all else as of
    `bywire.design`.
    """
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
