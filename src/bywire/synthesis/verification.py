"""A linear design on the nonlinear bench, and gains retuned there where it falls short."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from bywire.analysis.loop import Loop
from bywire.bench.bench import Bench
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Limit
from bywire.bench.running import run
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Progress
from bywire.synthesis.bench_figures import BenchFigures, Worth, has_step, wanted_figures
from bywire.synthesis.bench_tuning import (
    GENERATIONS,
    Candidate,
    Tuning,
    judged,
    linear_slacks,
    standing,
    tune,
)
from bywire.synthesis.designer import bench_floors, largest_error, linear_floors
from bywire.synthesis.linear_case import NOMINAL, LinearCase, values_of
from bywire.synthesis.optimizer import Problem, Report, stage

MOST = 8
"""corners that are tried, at most"""


@dataclass(frozen=True)
class Trial:
    """What a design is tried on.

    Parameters
    ----------
    loop, par, value
        Loop, parameters and operating point; nothing switched off.
    amplitudes
        Of the sines, SI.
    bench
        The loop's experiment with the same parameters; None where it has none.
    label
        What distinguishes it.
    """

    loop: Loop
    par: ParameterSet
    value: float
    amplitudes: tuple[float, ...]
    bench: Bench | None
    label: str = NOMINAL

    def at(self, case: LinearCase) -> Trial:
        """Return the trial of a model's own parameters and operating point.

        Its experiment is left out where the parameters are the same: so is then its outcome.
        """
        bench = None
        if self.bench is not None and case.changes:
            bench = self.bench.with_overrides(dict(case.changes))
        value = self.value if case.at is None else case.at
        par = self.par.replace(case.changes)
        return Trial(self.loop, par, value, self.amplitudes, bench, case.label)

    def measure(
        self,
        gains: Mapping[str, Sequence[float]],
        target: float,
        worth: Worth = lambda k, known: True,
        *,
        rough: bool = False,
    ) -> tuple[BenchFigures | None, ...]:
        """Return the figures of the sets of gains that are worth it, see `wanted_figures`."""
        bench = self.bench if self.bench is not None and has_step(self.bench) else None
        return wanted_figures(
            self.loop,
            self.par,
            self.value,
            self.amplitudes,
            gains,
            bench,
            target,
            worth,
            rough=rough,
        )


def measured(
    trials: Sequence[Trial],
    gains: Mapping[str, Sequence[float]],
    target: float,
    *,
    report: Report = lambda share: None,
) -> list[dict[str, BenchFigures]]:
    """Return the figures of every set of gains, by the label of each trial."""
    rows = wanted(trials, gains, target, lambda k, known: True, report=report)
    return [row for row in rows if row is not None]


def wanted(
    trials: Sequence[Trial],
    gains: Mapping[str, Sequence[float]],
    target: float,
    worth: Callable[[int, Sequence[BenchFigures]], bool],
    *,
    rough: bool = False,
    report: Report = lambda share: None,
) -> list[dict[str, BenchFigures] | None]:
    """Return the figures of the sets of gains that stay worth it through all trials.

    Parameters
    ----------
    trials, gains, target, rough
        As in `bench_figures.wanted_figures`.
    worth
        ``worth(k, figures)``: whether set k is measured on, with what is known of it so far.
    report
        Called with the share that is done.

    Returns
    -------
    list
        By the label of each trial; None for the sets that were left.
    """
    rows: dict[int, dict[str, BenchFigures]] = {
        k: {} for k in range(len(next(iter(gains.values()))))
    }
    count = len(rows)
    for n, trial in enumerate(trials):
        sets = list(rows)

        def still(j: int, known: BenchFigures, sets: Sequence[int] = sets) -> bool:
            return worth(sets[j], [*rows[sets[j]].values(), known])

        chosen = {name: [values[k] for k in sets] for name, values in gains.items()}
        figures = trial.measure(chosen, target, still, rough=rough) if sets else ()
        for k, each in zip(sets, figures, strict=True):
            if each is None:
                del rows[k]
            else:
                rows[k][trial.label] = each
        report((n + 1) / len(trials))
    return [rows.get(k) for k in range(count)]


def corners_of(problem: Problem, gains: Mapping[str, float]) -> list[LinearCase]:
    """Return the models at the ends of all ranges, and the one that is worst off among all.

    Of more than `MOST`, those that the linear models say are worst. Where these do not tell
    corners apart (dry friction is not in them), the bench does.

    Parameters
    ----------
    problem
        Its cases, the nominal one first.
    gains
        By dotted name [SI].
    """
    others = problem.cases[1:]
    if not others:
        return []
    slacks = problem.slacks(problem.point(gains), range(1, len(problem.cases))).min(axis=1)
    order = [others[k] for k in slacks.argsort(kind="stable")]
    values = [_coordinates(case) for case in others]
    ends = {
        name: (min(row[name] for row in values), max(row[name] for row in values))
        for name in values[0]
    }
    corners = [
        case
        for case in order
        if case is order[0] or all(v in ends[name] for name, v in _coordinates(case).items())
    ]
    return corners[:MOST]


def worst_of(
    trial: Trial,
    corners: Sequence[LinearCase],
    problem: Problem,
    gains: Mapping[str, float],
    linear: Mapping[str, float],
    target: float,
    report: Report = lambda share: None,
) -> list[Trial]:
    """Return the trial, at one of several corners, in which gains are worst off; none of none.

    Parameters
    ----------
    trial
        At the nominal point.
    corners
        See `corners_of`.
    problem, gains
        As there.
    linear
        Slack in the linear models, see `candidate.linear_slacks`.
    target
        Frequency around which is measured [Hz].
    report
        Called with the share that is done.
    """
    trials = [trial.at(corner) for corner in corners]
    if not trials:
        return []
    sets = {name: [value] for name, value in gains.items()}
    (row,) = measured([trial, *trials], sets, target, report=report)
    nominal = row[trial.label]
    slacks = []
    for corner in trials:
        figures = row[corner.label]
        alone = {NOMINAL: replace(figures, step=figures.step or nominal.step)}
        slacks.append(judged(problem.requirements, gains, alone, linear).slack)
    return [trials[slacks.index(min(slacks))]]


def _coordinates(case: LinearCase) -> dict[str, float]:
    return {**case.changes, "": case.at or 0.0}


# --- Verification


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
