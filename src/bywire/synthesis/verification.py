"""A linear design on the nonlinear bench, and gains retuned there where it falls short."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Limit
from bywire.bench.running import run
from bywire.core.errors import ParameterError
from bywire.core.typing import Progress
from bywire.synthesis.bench_figures import BenchFigures
from bywire.synthesis.bench_tuning import GENERATIONS, Tuning, standing, tune
from bywire.synthesis.candidate import Candidate, judged, linear_slacks
from bywire.synthesis.designer import largest_error
from bywire.synthesis.floors import bench_floors, linear_floors
from bywire.synthesis.linear_case import LinearCase, values_of
from bywire.synthesis.optimizer import Problem
from bywire.synthesis.stages import stage
from bywire.synthesis.trial import Trial, corners_of, measured, wanted, worst_of


@dataclass(frozen=True)
class Verification:
    """What the nonlinear bench says of a design.

    Parameters
    ----------
    linear
        The linear design's gains there.
    tuning
        The search for better ones; None where the linear design's meet everything.
    kpis
        Key figures of the loop's experiment with the final gains.
    nominal
        All figures of the nominal linear model with the final gains.
    corners
        Corners that were looked at; the figures shown are those of the worst.
    kept
        What was kept of the linear design besides the requirements, see `floors`.
    """

    linear: Candidate
    tuning: Tuning | None
    kpis: tuple[Kpi, ...]
    nominal: Mapping[str, float]
    corners: int = 0
    kept: tuple[Limit, ...] = ()

    @property
    def final(self) -> Candidate:
        """The gains to use."""
        return self.linear if self.tuning is None else self.tuning.best

    @property
    def met(self) -> bool:
        """Whether the final gains meet every requirement on the bench."""
        return self.final.slack >= 0.0

    def conflict(self) -> tuple[str, str, list[tuple[float, float]]] | None:
        """Return the two requirements that are worst off, and the edge between them.

        None where everything is met, only one requirement counts, or no candidates are at hand.
        """
        if self.met or self.tuning is None or not self.tuning.tried:
            return None
        order = sorted(self.final.slacks, key=self.final.room)
        if len(order) < 2:
            return None
        first, second = order[:2]
        return first, second, self.tuning.curve(first, second)


def verify(
    gains: Mapping[str, float],
    requirements: Sequence[Limit],
    tunables: Mapping[str, tuple[float, float]],
    cases: Sequence[LinearCase],
    trial: Trial,
    *,
    corners: Sequence[LinearCase] = (),
    kept: Sequence[Limit] | None = None,
    seed: int = 0,
    generations: int = GENERATIONS,
    progress: Progress | None = None,
) -> Verification:
    """Try a design on the nonlinear bench, and retune there what falls short.

    Parameters
    ----------
    gains
        The linear design's.
    requirements, tunables, cases
        As in `designer.design`.
    trial
        What it is tried on.
    corners
        Further models at whose parameters and operating points it is tried as well; by default
        that corner of the ranges at which it is worst off on the bench.
    kept
        What retuned gains keep of the linear design's figures besides the requirements; by default
        what `floors.bench_floors` says of ``gains``.
    seed, generations
        Of the search, see `bench_tuning.tune`; no generation: only try.
    progress
        Called with a label and the finished share.

    Raises
    ------
    ParameterError
        When no amplitude is given.
    """
    if not trial.amplitudes:
        raise ParameterError(f"loop {trial.loop.name!r}: no amplitude is given to try it with")
    problem = Problem(tunables, tuple(requirements), tuple(cases))
    floors = tuple(kept or ())
    target = _target(requirements, cases[0], gains)
    trials = [trial, *(trial.at(corner) for corner in corners)]
    unseen = () if corners else corners_of(problem, gains)

    def on_bench(chosen: Mapping[str, float], label: str) -> dict[str, BenchFigures]:
        report = stage(progress, label)
        report(0.0)
        share = len(unseen) / (len(unseen) + len(trials) + 1)  # of what looks for the worst corner
        linear = linear_slacks(problem, chosen)
        known = {trial.label for trial in trials}
        worst = worst_of(
            trial, unseen, problem, chosen, linear, target, lambda part: report(share * part)
        )
        trials.extend(corner for corner in worst if corner.label not in known)
        (row,) = measured(
            trials,
            {name: [value] for name, value in chosen.items()},
            target,
            report=lambda part: report(share + (1.0 - share) * part),
        )
        return row

    figures = on_bench(gains, "trial on the bench")
    if kept is None:
        linear = linear_floors(requirements, largest_error(cases, gains))
        floors = bench_floors(requirements, linear, figures.values())
    problem = Problem(tunables, (*requirements, *floors), tuple(cases))
    first = judged(problem.requirements, gains, figures, linear_slacks(problem, gains))
    tuning = None
    if first.slack < 0.0 and generations > 0:
        tuning = tune(
            problem,
            gains,
            lambda sets, worth: wanted(trials, sets, target, worth, rough=True),
            seed=seed,
            generations=generations,
            progress=progress,
        )
        best = tuning.best.gains
        again = judged(
            problem.requirements,
            best,
            on_bench(best, "the retuned gains on the bench"),
            linear_slacks(problem, best),
        )
        tuning = replace(tuning, best=max(first, again, key=standing))
    final = gains if tuning is None else tuning.best.gains
    kpis: tuple[Kpi, ...] = ()
    if trial.bench is not None:
        kpis = run(trial.bench.with_overrides(dict(final))).kpis
    nominal = values_of(cases[0].figures(final, 4000))
    return Verification(first, tuning, kpis, nominal, len(corners) or len(unseen), floors)


def _target(requirements: Sequence[Limit], case: LinearCase, gains: Mapping[str, float]) -> float:
    """Return the frequency around which to measure: that required, or that of the linear loop."""
    for figure in ("bandwidth", "crossover"):
        limits = [w.bound for w in requirements if w.figure == figure and not w.is_upper]
        if limits:
            return limits[0]
    return case.figures(gains).crossover
