"""Corners of the ranges that a design serves: where the bench looks beside the nominal point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from bywire.synthesis.candidate import judged
from bywire.synthesis.linear_case import NOMINAL, LinearCase
from bywire.synthesis.optimizer import Problem
from bywire.synthesis.trial import Trial, measured

MOST = 8
"""corners that are tried, at most"""


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
    values = [_coordinates(one) for one in others]
    ends = {name: (min(row[name] for row in values), max(row[name] for row in values))
            for name in values[0]}  # fmt: skip
    found = [
        one for one in order
        if one is order[0] or all(v in ends[name] for name, v in _coordinates(one).items())
    ]  # fmt: skip
    return found[:MOST]


def worst_of(
    trial: Trial,
    corners: Sequence[LinearCase],
    problem: Problem,
    gains: Mapping[str, float],
    linear: Mapping[str, float],
    target: float,
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
    """
    trials = [trial.at(one) for one in corners]
    if not trials:
        return []
    (row,) = measured([trial, *trials], {name: [value] for name, value in gains.items()}, target)
    nominal = row[trial.label]
    slacks = []
    for one in trials:
        own = row[one.label]
        alone = {NOMINAL: replace(own, step=own.step or nominal.step)}
        slacks.append(judged(problem.requirements, gains, alone, linear).slack)
    return [trials[slacks.index(min(slacks))]]


def _coordinates(case: LinearCase) -> dict[str, float]:
    return {**case.changes, "": case.at or 0.0}
