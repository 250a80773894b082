"""What a design is tried on: the nonlinear bench at the nominal point, and at worst corners."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from bywire.analysis.loop import Loop
from bywire.bench.bench import Bench
from bywire.core.parameters import ParameterSet
from bywire.synthesis.bench_figures import BenchFigures, Worth, has_step, wanted_figures
from bywire.synthesis.candidate import judged
from bywire.synthesis.linear_case import NOMINAL, LinearCase
from bywire.synthesis.optimizer import Problem
from bywire.synthesis.stages import Report

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
