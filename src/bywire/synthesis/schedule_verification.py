"""A gain schedule on the nonlinear bench, and regions retuned there one after the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from bywire.bench.requirements import Limit
from bywire.core.typing import Progress
from bywire.synthesis.bench_tuning import GENERATIONS, Tuning
from bywire.synthesis.linear_case import LinearCase
from bywire.synthesis.outcome import ScheduleDesign
from bywire.synthesis.schedule_designer import scheduled, slack_of
from bywire.synthesis.stages import suffixed
from bywire.synthesis.trial import Trial
from bywire.synthesis.verification import Verification, verify

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
    """Try a schedule on the nonlinear bench at every point it was designed for, and retune it.

    Of several models at a point, the worst linear one is tried. Regions are retuned one after the
    other, the main one first, each at its own points and in the experiment that may pass through
    all of them; the schedule as a whole is then tried again. A search over all gains at once has
    twice the dimensions and ends worse at the same expense.

    Parameters
    ----------
    design, tunables
        The schedule, and what may be chosen in each region.
    requirements
        As in `design_schedule`.
    trial
        At the first point of the main region, the schedule switched on.
    seed, generations, progress
        See `verification.verify`; generations of each region.
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
    """Return trial and models at a region's points, the gains of the other regions held."""
    bench = None if trial.bench is None else trial.bench.with_overrides(dict(gains))
    value = design.points[region][0]
    regional = replace(trial, par=trial.par.replace(gains), value=value, bench=bench)

    def held(case: LinearCase) -> LinearCase:
        return replace(case, build=lambda new: case.build({**gains, **new}))

    there = [case for case in design.cases if case.at in design.points[region]]
    first = next(case for case in there if case.at == value and not case.changes)
    return regional, tuple(held(case) for case in [first, *(c for c in there if c is not first)])
