"""Evaluates and retunes gains on the nonlinear bench, where friction and dither change the loop.

SciPy's differential evolution runs every generation as one ensemble. The bench includes effects
that the linear model omits (friction under dither, converter, limits). A candidate replaces a
member only if its worst slack is not smaller. The worst slack is a minimum, so partial results are
an upper bound of it, starting with the figures of the linear models. Candidates whose bound is too
low are not measured further, which does not change the search. Candidates that may come near the
best so far are always measured, because they form the displayed trade-off.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult, differential_evolution
from scipy.stats import qmc

from bywire.analysis.loop import Loop
from bywire.bench.bench import Bench
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Limit
from bywire.bench.running import run
from bywire.core.errors import ParameterError
from bywire.core.interrupts import interrupt_handled
from bywire.core.parameters import ParameterSet
from bywire.core.typing import Array, Progress
from bywire.synthesis.bench_figures import (
    STEP_FIGURES,
    BenchFigures,
    Worth,
    has_step,
    wanted_figures,
)
from bywire.synthesis.designer import (
    Problem,
    Report,
    bench_floors,
    largest_error,
    linear_floors,
    stage,
)
from bywire.synthesis.linear_case import NOMINAL, LinearCase, share_left, values_of

_LEAST = -3.0
MEASURED = frozenset({"bandwidth", "crossover", *STEP_FIGURES})
"""figures whose requirements only the bench decides, if it can measure them"""


@dataclass(frozen=True)
class Candidate:
    """Set of gains with its results.

    Parameters
    ----------
    gains
        Values by dotted name [SI].
    figures
        Figures on the bench at the nominal point.
    slacks
        Slack of each requirement, by its text, relative to the limit, for the worst amplitude and
        trial.
    corners
        Figures of further trials, by label.
    rooms
        Displayed values: as ``slacks``, but the slack of a bandwidth is that of its frequency. For
        requirements missing here, the value in ``slacks`` is displayed.
    shown
        For each requirement, by its text: the number of sines and steps from which the bench
        obtained the figure, and the number from which it could. If both are zero, only the linear
        model decides.
    """

    gains: Mapping[str, float]
    figures: BenchFigures
    slacks: Mapping[str, float]
    corners: Mapping[str, BenchFigures] = field(default_factory=dict)
    rooms: Mapping[str, float] = field(default_factory=dict)
    shown: Mapping[str, tuple[int, int]] = field(default_factory=dict)

    @property
    def slack(self) -> float:
        """The worst slack."""
        return min(self.slacks.values())

    def room(self, text: str) -> float:
        """Return the distance of a requirement's figure from its limit, relative to the limit."""
        return self.rooms.get(text, self.slacks[text])

    def standing(self, enough: float) -> tuple[float, float]:
        """Return the objective of the gains; larger is better.

        If a requirement is not met, this is the shortfall of the figures. Otherwise it is the worst
        slack and, once that slack is sufficient, the worst bandwidth.
        """
        if self.slack < 0.0:
            return min(-1e-12, *(self.room(text) for text in self.slacks)), self.slack
        return min(self.slack, enough), min(self.rooms.values(), default=0.0)


def bench_slacks(
    requirements: Sequence[Limit], figures: BenchFigures, linear: Mapping[str, float]
) -> dict[str, float]:
    """Return the slack of each requirement on the bench.

    The slack of a bandwidth is the margin of the gain above -3 dB at the worst amplitude. The phase
    margin is the worst of the linear model (the limit for large motion) and each describing
    function. Figures of the step are used if the experiment has a step. The linear model decides
    the remaining requirements.

    Parameters
    ----------
    requirements
        Requirements.
    figures
        Figures on the bench.
    linear
        Slack in the linear models by requirement's text.
    """
    slacks = {}
    for wanted in requirements:
        slack = _on_bench(wanted, figures)
        # The linear model decides figures that the bench cannot measure. For a phase margin, the
        # worse of both is used.
        if math.isinf(slack) or wanted.figure == "phase_margin":
            slack = min(slack, linear[str(wanted)])
        slacks[str(wanted)] = max(slack, _LEAST)
    return slacks


def ceiling(
    requirements: Sequence[Limit],
    known: Sequence[BenchFigures],
    linear: Mapping[str, float],
) -> float:
    """Return an upper bound of the worst slack for all possible results still missing.

    Parameters
    ----------
    requirements, linear
        As in `bench_slacks`.
    known
        Known figures of some trials; figures that are still unknown are NaN or absent.
    """
    highest = math.inf
    for wanted in requirements:
        highest = min([highest, *(_on_bench(wanted, figures) for figures in known)])
        if wanted.figure not in MEASURED:
            highest = min(highest, linear[str(wanted)])
    return max(highest, _LEAST)


def judged(
    requirements: Sequence[Limit],
    gains: Mapping[str, float],
    trials: Mapping[str, BenchFigures],
    linear: Mapping[str, float],
) -> Candidate:
    """Return gains with their results, evaluated for the worst of several trials.

    Parameters
    ----------
    requirements, linear
        As in `bench_slacks`.
    gains
        Values by dotted name [SI].
    trials
        Figures by the trial's label, including those of the nominal point.
    """
    # A trial without a step has the nominal parameters, and so the nominal step.
    nominal = trials[NOMINAL]
    each = [replace(figures, step=figures.step or nominal.step) for figures in trials.values()]
    rows = [bench_slacks(requirements, figures, linear) for figures in each]
    slacks = {str(wanted): min(row[str(wanted)] for row in rows) for wanted in requirements}
    corners = {label: figures for label, figures in trials.items() if label != NOMINAL}
    rooms = {
        str(wanted): _room(wanted, each, slacks[str(wanted)])
        for wanted in requirements
        if wanted.figure == "bandwidth" and not wanted.is_upper
    }
    shown = {str(wanted): shown_on_bench(wanted, each) for wanted in requirements}
    return Candidate(dict(gains), nominal, slacks, corners, rooms, shown)


def shown_on_bench(wanted: Limit, trials: Sequence[BenchFigures]) -> tuple[int, int]:
    """Return from how many sines and steps the bench obtained a figure, and could obtain it."""
    sines = [s for figures in trials for s in figures.small]
    if wanted.figure == "bandwidth" and not wanted.is_upper:
        return len(sines), len(sines)
    if wanted.figure in ("bandwidth", "crossover", "phase_margin"):
        name = "bandwidth" if wanted.figure == "bandwidth" else "crossover"
        return sum(not math.isnan(getattr(s, name)) for s in sines), len(sines)
    steps = sum(bool(figures.step) for figures in trials) if wanted.figure in STEP_FIGURES else 0
    return steps, steps


def _room(wanted: Limit, rows: Sequence[BenchFigures], slack: float) -> float:
    """Return the distance of the worst bandwidth from its limit, with the sign of its slack."""
    values = [s.bandwidth for row in rows for s in row.small]
    if not values:
        return slack
    room = share_left(wanted, min(values))
    return max(room, 0.0) if slack >= 0.0 else min(room, slack * 1e-3)


def _on_bench(wanted: Limit, figures: BenchFigures) -> float:
    """Return the slack of a measured figure, or infinity for other figures."""
    if wanted.figure == "bandwidth" and not wanted.is_upper:
        return min((s.least / math.sqrt(0.5) - 1.0 for s in figures.small), default=math.inf)
    if wanted.figure == "phase_margin":
        seen = [s for s in figures.small if not math.isnan(s.crossover)]
        return min((share_left(wanted, s.phase_margin) for s in seen), default=math.inf)
    if wanted.figure in ("bandwidth", "crossover"):
        values = [getattr(s, wanted.figure) for s in figures.small]
        return min((share_left(wanted, v) for v in values if not math.isnan(v)), default=math.inf)
    if wanted.figure not in STEP_FIGURES or not figures.step:
        return math.inf
    return share_left(wanted, figures.step[wanted.figure])


def linear_slacks(problem: Problem, gains: Mapping[str, float]) -> dict[str, float]:
    """Return the slack of every requirement, by its text, for the worst model that counts."""
    everything = range(len(problem.cases))
    slacks = problem.slacks(problem.point(gains), everything)
    slacks = problem.counted(slacks, everything).min(axis=0)
    return {str(wanted): float(s) for wanted, s in zip(problem.requirements, slacks, strict=True)}


# --- Tuning

Promising = Callable[[int, Sequence[BenchFigures]], bool]
Measure = Callable[
    [Mapping[str, Sequence[float]], Promising], Sequence[Mapping[str, BenchFigures] | None]
]
"""``measure(gains, worth)``: figures by label for each of several sets of gains, or None for sets
dropped because ``worth(k, known figures)`` was false"""

_ENOUGH = 0.02  # worst slack at which the search stops
_NEAR = 0.03  # candidates within this distance of the best worst slack are measured completely
_MEMBERS = 36
GENERATIONS = 60
"""maximum number of generations of a search"""
_REACH = 0.5  # part of the linear ranges (logarithmic) searched around the linear design


@dataclass(frozen=True)
class Tuning:
    """Result of a tuning.

    Parameters
    ----------
    best
        The candidate with the largest worst slack. If several have sufficient slack, it is the one
        with the largest worst bandwidth. If none meets the requirements, it is the one whose
        figures are nearest to the limits.
    tried
        All completely measured candidates, in the order of their runs.
    interrupted
        Whether the user interrupted the search.
    untold
        Number of further candidates that were evaluated with only a part of the trials.
    """

    best: Candidate
    tried: tuple[Candidate, ...]
    interrupted: bool
    untold: int = 0

    @property
    def count(self) -> int:
        """Number of evaluated candidates."""
        return len(self.tried) + self.untold

    def curve(self, first: str, second: str) -> list[tuple[float, float]]:
        """Return the trade-off between two figures if all other requirements are met.

        Parameters
        ----------
        first, second
            Texts of two requirements.

        Returns
        -------
        list of (float, float)
            Pairs of distances from the limits, sorted by the first. No pair is dominated by
            another.
        """
        pairs = sorted(
            (
                (c.room(first), c.room(second))
                for c in self.tried
                if all(s >= 0.0 for text, s in c.slacks.items() if text not in (first, second))
            ),
            reverse=True,
        )
        edge: list[tuple[float, float]] = []
        for room_1, room_2 in pairs:
            if not edge or room_2 > edge[-1][1]:
                edge.append((room_1, room_2))
        return edge[::-1]


def tune(
    problem: Problem,
    start: Mapping[str, float],
    measure: Measure,
    *,
    seed: int = 0,
    generations: int = GENERATIONS,
    progress: Progress | None = None,
) -> Tuning:
    """Search, around a linear design, for gains that meet the requirements on the bench.

    Parameters
    ----------
    problem
        Requirements, tunables and linear models. All models must stay stable.
    start
        Gains of the linear design. They are a member of the first generation.
    measure
        See `Measure`.
    seed
        Seed of the random numbers.
    generations
        Maximum number of generations. The search stops earlier once the worst slack is 2 %.
    progress
        Called with a label and the finished share.
    """
    center, n = problem.point(start), len(problem.tunables)
    low, high = np.clip(center - _REACH, 0.0, 1.0), np.clip(center + _REACH, 0.0, 1.0)
    first = low + (high - low) * qmc.LatinHypercube(n, rng=np.random.default_rng(seed)).random(
        _MEMBERS
    )
    first[0] = center  # the linear design itself, so that the search cannot end worse
    tried: list[Candidate] = []
    count, left = [0], [0]
    to_beat = np.full(_MEMBERS, -np.inf)

    def cost(points: Array) -> Array:
        rows = [problem.gains(z) for z in np.atleast_2d(points.T)]
        new = _candidates(problem, rows, measure, to_beat)
        tried.extend(each for each in new if isinstance(each, Candidate))
        left[0] += sum(isinstance(each, float) for each in new)
        return -np.array([each if isinstance(each, float) else each.slack for each in new])

    def passed(intermediate_result: OptimizeResult) -> bool:
        count[0] += 1
        if progress is not None:
            progress("tuning on the bench", count[0] / generations)
        members = -intermediate_result.population_energies
        to_beat[:] = np.minimum(members, members.max() - _NEAR)
        return bool(intermediate_result.fun <= -_ENOUGH)

    interrupted = False
    try:
        evolution: Any = differential_evolution  # its type stubs do not cover vectorized costs
        evolution(
            cost,
            list(zip(low, high, strict=True)),
            init=first,
            maxiter=generations,
            vectorized=True,
            updating="deferred",
            polish=False,
            tol=1e-6,
            rng=np.random.default_rng(seed),
            callback=passed,
        )
    except KeyboardInterrupt:
        interrupt_handled()
        interrupted = True
        if not tried:
            raise
    return Tuning(max(tried, key=standing), tuple(tried), interrupted, left[0])


def standing(candidate: Candidate) -> tuple[float, float]:
    """Return the objective of the search, see `Candidate.standing`."""
    return candidate.standing(_ENOUGH)


def _candidates(
    problem: Problem,
    rows: Sequence[Mapping[str, float]],
    measure: Measure,
    to_beat: Array,
) -> list[Candidate | float]:
    """Return each candidate, or an upper bound of its slack if it was dropped.

    Gains with which a linear model is unstable are not run.

    Parameters
    ----------
    problem, measure
        See `tune`.
    rows
        Gains of each candidate.
    to_beat
        For each candidate, the worst slack below which it is dropped.
    """
    linear = [linear_slacks(problem, row) for row in rows]
    bounds = [ceiling(problem.requirements, (), slacks) for slacks in linear]
    stable = [min(slacks.values()) > -10.0 for slacks in linear]
    tried = [k for k in range(len(rows)) if stable[k] and bounds[k] >= to_beat[k]]

    def worth(j: int, known: Sequence[BenchFigures]) -> bool:
        k = tried[j]
        bounds[k] = ceiling(problem.requirements, known, linear[k])
        return bool(bounds[k] >= to_beat[k])

    nothing: Mapping[str, BenchFigures] = {NOMINAL: BenchFigures((), {})}
    figures: dict[int, Mapping[str, BenchFigures] | None] = {
        k: nothing for k in range(len(rows)) if not stable[k]
    }
    if tried:
        sets = {name: [rows[k][name] for k in tried] for name in rows[0]}
        figures |= dict(zip(tried, measure(sets, worth), strict=True))
    candidates: list[Candidate | float] = []
    for k, row in enumerate(rows):
        known = figures.get(k)
        left = float(bounds[k])
        candidates.append(
            left if known is None else judged(problem.requirements, row, known, linear[k])
        )
    return candidates


# --- Verification

MOST = 8
"""maximum number of corners run on the bench"""


@dataclass(frozen=True)
class Trial:
    """Conditions for the trial of a design.

    Parameters
    ----------
    loop, par, value
        Loop, parameters and operating point. No effect is switched off.
    amplitudes
        Amplitudes of the sines, SI.
    bench
        The loop's experiment with the same parameters, or None if it has no experiment.
    label
        Label that identifies the trial.
    """

    loop: Loop
    par: ParameterSet
    value: float
    amplitudes: tuple[float, ...]
    bench: Bench | None
    label: str = NOMINAL

    def at(self, case: LinearCase) -> Trial:
        """Return the trial with the parameters and operating point of a model.

        If the parameters are the same, it has no experiment, because the result would be the same.
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
        """Return the figures of each set of gains that stays promising, see `wanted_figures`."""
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
    """Return the figures of every set of gains, by the label of the trial."""
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
    """Return the figures of each set of gains that stays promising in all trials.

    Parameters
    ----------
    trials, gains, target, rough
        As in `bench_figures.wanted_figures`.
    worth
        ``worth(k, figures)``: whether to continue with set k, from its figures so far.
    report
        Called with the finished share.

    Returns
    -------
    list
        For each set, its figures by the label of the trial, or None if the set was dropped.
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
    """Return the models at the ends of all ranges, and the worst of all models.

    If there are more than `MOST`, only those that are worst in the linear models are returned. The
    linear models contain no dry friction. If they do not distinguish the corners, the bench does.

    If a requirement has a probability, drawn models are not included, because some of them may miss
    it. A study of the bench tests such requirements.

    Parameters
    ----------
    problem
        Design problem; its first case is the nominal one.
    gains
        Values by dotted name [SI].
    """
    may_miss = any(wanted.probability is not None for wanted in problem.requirements)
    places = [k for k, case in enumerate(problem.cases) if k and not (may_miss and case.draws)]
    if not places:
        return []
    others = [problem.cases[k] for k in places]
    slacks = problem.slacks(problem.point(gains), places).min(axis=1)
    order = [others[k] for k in slacks.argsort(kind="stable")]
    values: dict[str, list[float]] = {}
    for case in others:
        for name, value in _coordinates(case).items():
            values.setdefault(name, []).append(value)
    ends = {name: (min(each), max(each)) for name, each in values.items()}
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
    """Return the trial at the worst of several corners, or an empty list without corners.

    Parameters
    ----------
    trial
        Trial at the nominal point.
    corners
        See `corners_of`.
    problem, gains
        See `corners_of`.
    linear
        Slack in the linear models, see `linear_slacks`.
    target
        Center of the measured frequencies [Hz].
    report
        Called with the finished share.
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
    """Results of a design on the nonlinear bench.

    Parameters
    ----------
    linear
        Results with the gains of the linear design.
    tuning
        The search for better gains, or None if the linear design meets all requirements.
    kpis
        Key figures of the loop's experiment with the final gains.
    nominal
        All figures of the nominal linear model with the final gains.
    corners
        Number of corners checked. The displayed figures are those of the worst one.
    kept
        Constraints from the linear design that were also enforced, see `designer.bench_floors`.
    """

    linear: Candidate
    tuning: Tuning | None
    kpis: tuple[Kpi, ...]
    nominal: Mapping[str, float]
    corners: int = 0
    kept: tuple[Limit, ...] = ()

    @property
    def final(self) -> Candidate:
        """The final gains."""
        return self.linear if self.tuning is None else self.tuning.best

    @property
    def met(self) -> bool:
        """Whether the final gains meet every requirement on the bench."""
        return self.final.slack >= 0.0

    def conflict(self) -> tuple[str, str, list[tuple[float, float]]] | None:
        """Return the two worst requirements and the trade-off between them.

        The result is None if all requirements are met, if there is only one requirement, or if no
        candidate was measured.
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
    """Run a design on the nonlinear bench, and retune it if it does not meet the requirements.

    Parameters
    ----------
    gains
        Gains of the linear design.
    requirements, tunables, cases
        As in `designer.design`.
    trial
        Conditions of the trial.
    corners
        Further models whose parameters and operating points are run. By default, this is the corner
        of the ranges that is worst on the bench.
    kept
        Constraints from the linear design that retuned gains must also meet. By default, these are
        the `designer.bench_floors` of ``gains``.
    seed, generations
        Seed and number of generations of the search, see `tune`. With zero generations, the design
        is only run and not retuned.
    progress
        Called with a label and the finished share.

    Raises
    ------
    ParameterError
        When no amplitude is given.
    """
    if not trial.amplitudes:
        raise ParameterError(
            f"loop {trial.loop.name!r} needs an amplitude for the bench", name="amplitude"
        )
    problem = Problem(tunables, tuple(requirements), tuple(cases))
    floors = tuple(kept or ())
    target = _target(requirements, cases[0], gains)
    trials = [trial, *(trial.at(corner) for corner in corners)]
    unseen = () if corners else corners_of(problem, gains)

    def on_bench(chosen: Mapping[str, float], label: str) -> dict[str, BenchFigures]:
        report = stage(progress, label)
        report(0.0)
        share = len(unseen) / (
            len(unseen) + len(trials) + 1
        )  # share of the search for the worst corner
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
    """Return the center of the measured frequencies.

    This is the required frequency, or the crossover of the linear loop if none is required.
    """
    for figure in ("bandwidth", "crossover"):
        limits = [w.bound for w in requirements if w.figure == figure and not w.is_upper]
        if limits:
            return limits[0]
    return case.figures(gains).crossover
