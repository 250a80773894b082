"""Two fits that share unknowns, each telling its own part, in turn until they agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bywire.core.typing import Array
from bywire.identification.confidence import notes_of, uncertainty
from bywire.identification.estimate import Estimate, Kept
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.unknown import Unknown, moved

_SETTLED = 1e-6  # of a value


def in_turn(
    problems: tuple[Problem, Problem], groups: tuple[Sequence[int], Sequence[int]], most: int
) -> Estimate:
    r"""Estimate some unknowns by one fit and the others by another, each with the other's values.

    At the end :math:`Z^T r = 0` holds with Z the derivatives of either fit by its own unknowns
    alone: an instrumental-variable estimate, whose covariance knows that an error of one fit
    reaches the other.

    Parameters
    ----------
    problems
        Both with the same unknowns.
    groups
        Which of them either fit estimates; together all.
    most
        Turns at most; one is what leaves the second fit's values unknown to the first.

    Raises
    ------
    ParameterError
        When the data tells none of a fit's unknowns.
    """
    unknowns = problems[0].unknowns
    values = np.array([u.start for u in unknowns])
    parts: list[Estimate] = []
    turns, change = 0, np.inf
    while turns < most and change > _SETTLED:
        before = values.copy()
        parts = []
        for problem, mine in zip(problems, groups, strict=True):
            part = estimate(restricted(problem, mine, values))
            values[[_index(problem, label) for label in part.names]] = part.values
            parts.append(part)
        size = np.abs(values) + np.array([u.scale for u in unknowns])
        change, turns = float(np.max(np.abs(values - before) / size)), turns + 1
    notes = [f"{turns} turn{'s' if turns > 1 else ''} of two steps"]
    if change <= _SETTLED:
        best = _combined(problems, parts, values)
    else:
        best = _apart(problems, parts)
        notes.append(
            f"the two steps do not agree yet: the last turn changed the values by {change:.2g} of "
            "their size; each step's intervals take the other step's values as known"
        )
    return best.noted((*notes, *notes_of(best)))


def _index(problem: Problem, label: str) -> int:
    return [u.label for u in problem.unknowns].index(label)


def restricted(problem: Problem, mine: Sequence[int], values: Array) -> Problem:
    """Return a problem in some of its unknowns, the others held.

    Parameters
    ----------
    mine
        Indices of those that stay unknown.
    values
        Of all: where they begin, or are held.
    """
    chosen = list(mine)
    begin = moved([problem.unknowns[k] for k in chosen], values[chosen])
    held = values.copy()

    def evaluate(some: Array) -> tuple[Array, Array]:
        whole = held.copy()
        whole[chosen] = some
        r, J = problem.evaluate(whole)
        return r, J[:, chosen]

    return Problem(begin, evaluate)


def _apart(problems: tuple[Problem, Problem], parts: Sequence[Estimate]) -> Estimate:
    """Return both parts as one estimate, each with the covariance that it has alone."""
    first = len(parts[0].names)
    size = first + len(parts[1].names)
    covariance, spectrum = np.zeros((size, size)), np.zeros(size)
    for part, span in zip(parts, (slice(0, first), slice(first, size)), strict=True):
        covariance[span, span], spectrum[span] = part.covariance, part.singular_values
    return replace(
        parts[0],
        unknowns=_original(problems[0], parts),
        covariance=covariance,
        values=np.concatenate([part.values for part in parts]),
        singular_values=np.sort(spectrum)[::-1],
        residuals=np.concatenate([part.residuals for part in parts]),
        freedom=min(part.freedom for part in parts),
        colored=any(part.colored for part in parts),
        kept=_kept(problems[0], parts),
        notes=(),
    )


def _original(problem: Problem, parts: Sequence[Estimate]) -> tuple[Unknown, ...]:
    """Return the parts' unknowns with the starts they had before the first turn."""
    return tuple(problem.unknowns[_index(problem, label)] for part in parts for label in part.names)


def _kept(problem: Problem, parts: Sequence[Estimate]) -> tuple[Kept, ...]:
    first = {u.label: u for u in problem.unknowns}
    already = [k for part in parts for k in part.kept]
    return tuple(replace(k, unknown=first[k.unknown.label]) for k in already)


def _combined(
    problems: tuple[Problem, Problem], parts: Sequence[Estimate], values: Array
) -> Estimate:
    """Return both parts as one estimate with its joint covariance."""
    labels = [label for part in parts for label in part.names]
    columns = [_index(problems[0], label) for label in labels]
    residuals, jacobians, instruments = [], [], []
    first = 0
    for problem, part in zip(problems, parts, strict=True):
        r, J = problem.evaluate(values)
        Z = np.zeros((r.size, len(columns)))
        mine = slice(first, first + len(part.names))
        # Each fit weighs its residuals by their own size: what the noise really was.
        size = float(np.sqrt(r @ r / max(r.size - len(part.names), 1)))
        Z[:, mine] = J[:, columns[mine]] / size
        residuals.append(r / size)
        jacobians.append(J[:, columns] / size)
        instruments.append(Z)
        first += len(part.names)
    r, J, Z = np.concatenate(residuals), np.vstack(jacobians), np.vstack(instruments)
    unknowns = _original(problems[0], parts)
    scale = np.array([u.scale for u in unknowns])
    sure = uncertainty(J * scale, r, Z * scale)
    return Estimate(
        unknowns=unknowns,
        values=values[columns],
        covariance=sure.covariance * np.outer(scale, scale),
        singular_values=np.asarray(np.linalg.svd(J * scale, compute_uv=False), dtype=float),
        residuals=np.concatenate([part.residuals for part in parts]),
        freedom=sure.freedom,
        colored=sure.colored,
        kept=_kept(problems[0], parts),
    )
