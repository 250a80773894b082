"""How far gains meet requirements on the nonlinear bench, by the worst amplitude and trial."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from bywire.synthesis.bench_figures import STEP_FIGURES, BenchFigures
from bywire.synthesis.linear_case import NOMINAL
from bywire.synthesis.optimizer import Problem
from bywire.synthesis.requirement import Requirement

_LEAST = -3.0


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
    """

    gains: Mapping[str, float]
    figures: BenchFigures
    slacks: Mapping[str, float]
    corners: Mapping[str, BenchFigures] = field(default_factory=dict)
    rooms: Mapping[str, float] = field(default_factory=dict)

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
    requirements: Sequence[Requirement], found: BenchFigures, linear: Mapping[str, float]
) -> dict[str, float]:
    """Return how far each requirement is met on the bench.

    Bandwidth counts at the worst amplitude, by the room of the gain above -3 dB; a phase margin
    in the linear model (what large motion comes near) and in each describing function; figures
    of the step where the experiment has one; the rest is the linear model's alone.

    Parameters
    ----------
    requirements
        What is required.
    found
        Figures on the bench.
    linear
        Slack in the linear models by requirement's text.
    """
    slacks = {}
    for one in requirements:
        slack = _on_bench(one, found)
        if math.isinf(slack) or one.figure == "phase_margin":
            slack = min(slack, linear[one.text])
        slacks[one.text] = max(slack, _LEAST)
    return slacks


def judged(
    requirements: Sequence[Requirement],
    gains: Mapping[str, float],
    found: Mapping[str, BenchFigures],
    linear: Mapping[str, float],
) -> Candidate:
    """Return gains with what they showed, judged by the worst of several trials.

    Parameters
    ----------
    requirements, linear
        As in `bench_slacks`.
    gains
        By dotted name [SI].
    found
        Figures by the trial's label, that of the nominal point among them.
    """
    # A trial without a step has the parameters of the nominal one: so is its step.
    steps = [replace(one, step=one.step or found[NOMINAL].step) for one in found.values()]
    rows = [bench_slacks(requirements, one, linear) for one in steps]
    slacks = {one.text: min(row[one.text] for row in rows) for one in requirements}
    corners = {label: one for label, one in found.items() if label != NOMINAL}
    rooms = {one.text: _room(one, steps, slacks[one.text]) for one in requirements
             if one.figure == "bandwidth" and one.sense > 0}  # fmt: skip
    return Candidate(dict(gains), found[NOMINAL], slacks, corners, rooms)


def _room(one: Requirement, found: Sequence[BenchFigures], slack: float) -> float:
    """Return the distance of the worst bandwidth from its limit, of the same sign as its slack."""
    values = [s.bandwidth for row in found for s in row.small]
    if not values:
        return slack
    room = one.slack(min(values))
    return max(room, 0.0) if slack >= 0.0 else min(room, slack * 1e-3)


def _on_bench(one: Requirement, found: BenchFigures) -> float:
    """Return the slack of what the bench measures; infinity for what it does not."""
    if one.figure == "bandwidth" and one.sense > 0:
        return min((s.least / math.sqrt(0.5) - 1.0 for s in found.small), default=math.inf)
    if one.figure == "phase_margin":
        seen = [s for s in found.small if not math.isnan(s.crossover)]
        return min((one.slack(s.phase_margin) for s in seen), default=math.inf)
    if one.figure in ("bandwidth", "crossover"):
        values = [getattr(s, one.figure) for s in found.small]
        return min((one.slack(v) for v in values if not math.isnan(v)), default=math.inf)
    if one.figure not in STEP_FIGURES or not found.step:
        return math.inf
    return one.slack(found.step[one.figure])


def linear_slacks(problem: Problem, gains: Mapping[str, float]) -> dict[str, float]:
    """Return the slack of every requirement for the worst model, by its text."""
    slacks = problem.slacks(problem.point(gains), range(len(problem.cases))).min(axis=0)
    return {one.text: float(s) for one, s in zip(problem.requirements, slacks, strict=True)}
