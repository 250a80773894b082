"""Design of gain schedules: region by region, then jointly retuned on the nonlinear bench."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bywire.analysis.loop import Loop, LoopSchedule
from bywire.analysis.loop_figures import LoopFigures
from bywire.bench.requirements import Limit
from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Progress
from bywire.core.units import shown
from bywire.synthesis.designer import design, suffixed
from bywire.synthesis.linear_case import LinearCase, cases_of, room, values_of
from bywire.synthesis.outcome import Across, Design, ScheduleDesign
from bywire.synthesis.verification import GENERATIONS, Trial, Tuning, Verification, verify

_FINE = 4000  # points of the grid for reported figures
_ACROSS = 15
"""operating points of the scheduled loop that are checked between the designed ones"""


def scheduled(loop: Loop) -> LoopSchedule:
    """Return the schedule of a loop.

    Raises
    ------
    ParameterError
        When the loop has no schedule.
    """
    if loop.schedule is None:
        raise ParameterError(
            f"loop {loop.name!r} has no gain schedule. Remove {option('schedule', True)}",
            name="schedule",
        )
    return loop.schedule


def points_by_region(
    loop: Loop, par: ParameterSet, points: Sequence[float]
) -> dict[str, tuple[float, ...]]:
    """Return operating points [SI] by their region.

    Parameters
    ----------
    loop, par
        Loop, and the parameters that contain the boundaries.
    points
        At least one in each region; if empty, the loop's own points, if the boundaries allow them.

    Raises
    ------
    ParameterError
        When a region has no point.
    """
    schedule, at = scheduled(loop), loop.at
    by_region: dict[str, list[float]] = {name: [] for name in schedule.regions}
    for value in points or schedule.points:
        by_region[schedule.region(par, value)].append(value)
    for name, inside in by_region.items():
        if not inside:
            leaves = par.leaves()
            borders = " and ".join(shown(leaves[each], at.unit) for each in schedule.borders)
            given = ", ".join(shown(each, at.unit) for each in points or schedule.points)
            raise ParameterError(
                f"the region {name!r} contains no operating point. The boundaries are {borders}, "
                f"and the points are {given}. Specify one {at.name} in each region with "
                f"{option('at')}, or move the boundaries ({', '.join(schedule.borders)})",
                name=at.name,
                value=given,
            )
    return {name: tuple(sorted(inside)) for name, inside in by_region.items()}


def design_schedule(
    loop: Loop,
    par: ParameterSet,
    requirements: Sequence[Limit],
    points: Mapping[str, Sequence[float]],
    tunables: Mapping[str, Mapping[str, tuple[float, float]]],
    *,
    over: Mapping[str, Sequence[float]] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> ScheduleDesign:
    """Design the gains of every region, the main region first, and check the loop across them.

    The regions share parameters that only the main region chooses, for example a filter. A region
    starts with the gains of the main region. Models have frozen gains, so they describe small
    motion about an equilibrium and slow motion between equilibria.

    Parameters
    ----------
    loop, par
        Loop, and parameters with the schedule switched on.
    requirements
        See `linear_case.read`.
    points
        See `points_by_region`.
    tunables
        Tunable gains by region; empty for a region with fixed gains.
    over
        Ranges for which every region must also meet the requirements; see `cases_of`.
    seed, progress
        See `designer.design`.

    Raises
    ------
    ParameterError
        See `designer.design` and `cases_of`; also when no region has tunable gains.
    """
    schedule = scheduled(loop)
    if not any(tunables.values()):
        raise ParameterError("all gains of every region are fixed. Set fewer of them", name="gains")
    order = [schedule.main, *(name for name in schedule.regions if name != schedule.main)]
    order = [name for name in order if tunables[name]]
    gains: dict[str, float] = {}
    designs: dict[str, Design] = {}
    for region in order:
        tuned = par.replace(gains)
        cases = cases_of(loop, tuned, points[region][0], _ranges(loop, points[region], over or {}))
        start = _start(tuned, schedule, region, tunables[region])
        designs[region] = design(
            tunables[region],
            requirements,
            cases,
            start,
            seed=seed,
            progress=suffixed(progress, region),
        )
        gains |= designs[region].gains
        if designs[region].status == "interrupted":
            rest = [name for name in order if name not in designs]
            gains |= {
                k: v
                for r in rest
                for k, v in _start(par.replace(gains), schedule, r, tunables[r]).items()
            }
            break
    return _seen_whole(loop, par, requirements, (points, designs, gains), over or {})


def _seen_whole(
    loop: Loop,
    par: ParameterSet,
    requirements: Sequence[Limit],
    designed: tuple[Mapping[str, Sequence[float]], Mapping[str, Design], Mapping[str, float]],
    over: Mapping[str, Sequence[float]],
) -> ScheduleDesign:
    points, designs, gains = designed
    schedule = scheduled(loop)
    every = [point for name in schedule.regions for point in points[name]]
    middle = points[schedule.main][0]
    cases = cases_of(loop, par, middle, _ranges(loop, every, over))
    nominal = cases[0].figures(gains, _FINE)
    return ScheduleDesign(
        {name: designs[name] for name in schedule.regions if name in designs},
        {name: tuple(points[name]) for name in schedule.regions},
        gains,
        values_of(nominal),
        cases,
        frozen(loop, par, every, gains, requirements),
    )


def frozen(
    loop: Loop,
    par: ParameterSet,
    points: Sequence[float],
    gains: Mapping[str, float],
    requirements: Sequence[Limit],
) -> tuple[Across, ...]:
    """Return the scheduled loop from the lowest to the highest point and across the boundaries.

    Parameters
    ----------
    loop, par, requirements
        See `design_schedule`.
    points
        Operating points [SI], at least one.
    gains
        By dotted name [SI].
    """
    schedule = scheduled(loop)
    values = _between(par, schedule, points)
    dense = cases_of(loop, par, points[0], {loop.at.name: values})[1:]
    return tuple(
        _across(case, schedule.region(par, case.at or 0.0), requirements, gains) for case in dense
    )


def _across(
    case: LinearCase, region: str, requirements: Sequence[Limit], gains: Mapping[str, float]
) -> Across:
    figures = case.figures(gains, _FINE)
    slack = slack_of(figures, requirements)
    return Across(case.label, case.at or 0.0, region, values_of(figures), slack)


def slack_of(figures: LoopFigures, requirements: Sequence[Limit]) -> float:
    """Return the slack of the worst requirement; negative infinity if unstable."""
    if not figures.is_stable:
        return -math.inf
    return float(min(room(figures, requirement) for requirement in requirements))


def _ranges(
    loop: Loop, points: Sequence[float], over: Mapping[str, Sequence[float]]
) -> dict[str, Sequence[float]]:
    if loop.at.name in over:
        raise ParameterError(
            f"the schedule depends on {loop.at.name}. Specify operating points with {option('at')}",
            name=loop.at.name,
        )
    return {loop.at.name: points, **over} if len(points) > 1 or over else {}


def _between(par: ParameterSet, schedule: LoopSchedule, points: Sequence[float]) -> list[float]:
    """Return evenly spaced operating points, the designed points and the boundaries."""
    leaves = par.leaves()
    spread = np.linspace(min(points), max(points), _ACROSS)
    borders = [leaves[name] for name in schedule.borders]
    return sorted({*map(float, spread), *map(float, points), *borders})


def _start(
    par: ParameterSet, schedule: LoopSchedule, region: str, tunables: Mapping[str, Any]
) -> dict[str, float]:
    """Return initial gains of a region: those of the main region, matched by their last names."""
    leaves = par.leaves()
    main = {name.rpartition(".")[2]: leaves[name] for name in schedule.regions[schedule.main]}
    return {name: main[name.rpartition(".")[2]] for name in tunables}


# --- On the nonlinear bench: regions retuned one after the other

Spans = Mapping[str, tuple[float, float]]


def verify_schedule(
    design: ScheduleDesign,
    requirements: Sequence[Limit],
    tunables: Mapping[str, Spans],
    trial: Trial,
    *,
    seed: int = 0,
    generations: int = GENERATIONS,
    progress: Progress | None = None,
) -> Verification:
    """Try a schedule on the nonlinear bench at every designed point, and retune it.

    Of several models at a point, the worst linear model is tried. Regions are retuned one after the
    other, the main region first, each at its own points and in the experiment, which may pass
    through all of them. The schedule as a whole is then tried again. A search over all gains
    together has twice the dimensions, and finds worse gains at the same cost.

    Parameters
    ----------
    design, tunables
        The schedule, and the tunable gains of each region.
    requirements
        See `design_schedule`.
    trial
        Trial at the first point of the main region, with the schedule switched on.
    seed, generations, progress
        See `verification.verify`; generations count for each region.
    """
    spans = {name: span for regional in tunables.values() for name, span in regional.items()}
    corners = _corners(design, requirements, trial)

    def whole(gains: Mapping[str, float], kept: Sequence[Limit] | None = None) -> Verification:
        return verify(
            gains,
            requirements,
            spans,
            design.cases,
            trial,
            corners=corners,
            kept=kept,
            generations=0,
            progress=progress,
        )

    first = whole(design.gains)
    if first.met or generations == 0:
        return first
    gains, count, stopped = dict(design.gains), 0, False
    schedule = scheduled(trial.loop)
    for region in sorted(tunables, key=lambda name: name != schedule.main):
        if not tunables[region] or stopped:
            continue
        regional, models = _in_region(design, region, gains, trial)
        start = {name: gains[name] for name in tunables[region]}
        retuned = verify(
            start,
            requirements,
            tunables[region],
            models,
            regional,
            corners=[c for c in models[1:] if c.at != regional.value or c.changes],
            kept=first.kept,
            seed=seed,
            generations=generations,
            progress=suffixed(progress, region),
        )
        gains |= retuned.final.gains
        if retuned.tuning is not None:
            count, stopped = count + retuned.tuning.count, retuned.tuning.interrupted
    last = whole(gains, first.kept)
    return replace(
        first, tuning=Tuning(last.linear, (), stopped, count), kpis=last.kpis, nominal=last.nominal
    )


def _corners(
    design: ScheduleDesign, requirements: Sequence[Limit], trial: Trial
) -> list[LinearCase]:
    worst: dict[float | None, tuple[float, LinearCase]] = {}
    for case in design.cases[1:]:
        if case.at == trial.value and not case.changes:
            continue
        slack = slack_of(case.figures(design.gains), requirements)
        if case.at not in worst or slack < worst[case.at][0]:
            worst[case.at] = (slack, case)
    return [case for _, case in worst.values()]


def _in_region(
    design: ScheduleDesign, region: str, gains: Mapping[str, float], trial: Trial
) -> tuple[Trial, tuple[LinearCase, ...]]:
    """Return trial and models at a region's points, with the gains of the other regions fixed."""
    bench = None if trial.bench is None else trial.bench.with_overrides(dict(gains))
    value = design.points[region][0]
    regional = replace(trial, par=trial.par.replace(gains), value=value, bench=bench)

    def held(case: LinearCase) -> LinearCase:
        return replace(case, build=lambda new: case.build({**gains, **new}))

    there = [case for case in design.cases if case.at in design.points[region]]
    first = next(case for case in there if case.at == value and not case.changes)
    return regional, tuple(held(case) for case in [first, *(c for c in there if c is not first)])
