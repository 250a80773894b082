"""How far gains meet requirements on the nonlinear bench, by the worst amplitude and trial."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from bywire.bench.requirements import Limit
from bywire.synthesis.bench_figures import STEP_FIGURES, BenchFigures
from bywire.synthesis.linear_case import NOMINAL
from bywire.synthesis.optimizer import Problem
from bywire.synthesis.requirement import share_left

_LEAST = -3.0
MEASURED = frozenset({"bandwidth", "crossover", *STEP_FIGURES})
"""figures that the bench alone decides on, where it shows them"""


@dataclass(frozen=True)
class Candidate:
    """A set of gains with what it showed.

    Parameters
    ----------
    gains
        By dotted name [SI].
    figures
        On the bench at the nominal point.
    slacks
        By requirement's text: share of the limit, worst amplitude and worst trial.
    corners
        Figures of further trials, by label.
    rooms
        The same as ``slacks``, but of a bandwidth by its frequency: what is shown. Those that are
        not named are as ``slacks`` has them.
    shown
        By requirement's text: in how many sines and steps the bench shows its figure, and in how
        many of them it might; without any, the linear model alone decides.
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
        """Return the distance of a requirement's figure from its limit, as a share of it."""
        return self.rooms.get(text, self.slacks[text])

    def standing(self, enough: float) -> tuple[float, float]:
        """Return what to prefer gains by, the larger the better.

        Where a requirement is missed, how far the figures are off; else the worst slack, and
        from a slack that is enough on the worst bandwidth.
        """
        if self.slack < 0.0:
            return min(-1e-12, *(self.room(text) for text in self.slacks)), self.slack
        return min(self.slack, enough), min(self.rooms.values(), default=0.0)


def bench_slacks(
    requirements: Sequence[Limit], figures: BenchFigures, linear: Mapping[str, float]
) -> dict[str, float]:
    """Return how far each requirement is met on the bench.

    Bandwidth counts at the worst amplitude, by the room of the gain above -3 dB; a phase margin
    in the linear model (what large motion comes near) and in each describing function; figures
    of the step where the experiment has one; the rest is the linear model's alone.

    Parameters
    ----------
    requirements
        What is required.
    figures
        Figures on the bench.
    linear
        Slack in the linear models by requirement's text.
    """
    slacks = {}
    for wanted in requirements:
        slack = _on_bench(wanted, figures)
        # What the bench does not show, the linear model says; of a phase margin the worse counts.
        if math.isinf(slack) or wanted.figure == "phase_margin":
            slack = min(slack, linear[str(wanted)])
        slacks[str(wanted)] = max(slack, _LEAST)
    return slacks


def ceiling(
    requirements: Sequence[Limit],
    known: Sequence[BenchFigures],
    linear: Mapping[str, float],
) -> float:
    """Return what the worst slack cannot exceed, whatever is still to be measured.

    Parameters
    ----------
    requirements, linear
        As in `bench_slacks`.
    known
        What is known of some trials; figures that are still unknown are NaN, or not there.
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
    """Return gains with what they showed, judged by the worst of several trials.

    Parameters
    ----------
    requirements, linear
        As in `bench_slacks`.
    gains
        By dotted name [SI].
    trials
        Figures by the trial's label, that of the nominal point among them.
    """
    # A trial without a step has the parameters of the nominal one: so is its step.
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
    """Return in how many sines and steps the bench shows a figure, and in how many it might."""
    sines = [s for figures in trials for s in figures.small]
    if wanted.figure == "bandwidth" and not wanted.is_upper:
        return len(sines), len(sines)
    if wanted.figure in ("bandwidth", "crossover", "phase_margin"):
        name = "bandwidth" if wanted.figure == "bandwidth" else "crossover"
        return sum(not math.isnan(getattr(s, name)) for s in sines), len(sines)
    steps = sum(bool(figures.step) for figures in trials) if wanted.figure in STEP_FIGURES else 0
    return steps, steps


def _room(wanted: Limit, rows: Sequence[BenchFigures], slack: float) -> float:
    """Return the distance of the worst bandwidth from its limit, of the same sign as its slack."""
    values = [s.bandwidth for row in rows for s in row.small]
    if not values:
        return slack
    room = share_left(wanted, min(values))
    return max(room, 0.0) if slack >= 0.0 else min(room, slack * 1e-3)


def _on_bench(wanted: Limit, figures: BenchFigures) -> float:
    """Return the slack of what the bench measures; infinity for what it does not."""
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
    """Return the slack of every requirement for the worst model, by its text."""
    slacks = problem.slacks(problem.point(gains), range(len(problem.cases))).min(axis=0)
    return {str(wanted): float(s) for wanted, s in zip(problem.requirements, slacks, strict=True)}
