"""Symbolic elimination of the smooth states from the linear system of a substep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from bywire.simulation.symbols import depends

Entries = dict[tuple[int, int], Any]


@dataclass(frozen=True)
class Step:
    """One eliminated row: pivot row's entries in the columns that were left, and its reciprocal."""

    pivot: int
    reciprocal: Any
    row: dict[int, Any]


@dataclass(frozen=True)
class Reduced:
    """System that is left for the kept rows, and what is needed to get the others back.

    Parameters
    ----------
    kept
        Indices of the kept rows, in the order of ``matrix``.
    matrix, rhs
        Schur complement and its right-hand side, shapes (m, m) and (m,).
    """

    kept: tuple[int, ...]
    matrix: Any
    rhs: Any
    steps: tuple[Step, ...]
    right: dict[int, Any]

    def back_substitute(self, solution: dict[int, Any]) -> dict[int, Any]:
        """Return all unknowns, given those of the kept rows."""
        known = dict(solution)
        for step in reversed(self.steps):
            value = self.right[step.pivot]
            for column, entry in step.row.items():
                value = value - entry * known[column]
            known[step.pivot] = value * step.reciprocal
        return known


def eliminate(A: Any, r: Any, keep: tuple[int, ...], changing: Any) -> Reduced:
    """Eliminate all rows but the kept ones, on the diagonal, least fill first.

    Parameters
    ----------
    A, r
        Matrix and right-hand side, shapes (n, n) and (n,).
    keep
        Rows that stay.
    changing
        Symbols that change from substep to substep: among pivots of equal fill, one that does
        not depend on them comes first, for then its reciprocal is hoisted.
    """
    n = A.shape[0]
    entries: Entries = {
        (i, j): A[i, j] for i in range(n) for j in range(n) if _present(A[i, j])
    }
    right = {i: r[i] for i in range(n)}
    left = [i for i in range(n) if i not in keep]
    steps = []
    while left:
        pivot = min(left, key=lambda i: _price(entries, i, changing))
        left.remove(pivot)
        steps.append(_pivot(entries, right, pivot))
    m = len(keep)
    S = ca.SX.zeros(m, m)
    for a, i in enumerate(keep):
        for b, j in enumerate(keep):
            S[a, b] = entries.get((i, j), 0)
    rhs = ca.vertcat(*(right[i] for i in keep)) if keep else ca.SX(0, 1)
    return Reduced(keep, S, rhs, tuple(steps), right)


def _present(entry: Any) -> bool:
    return not entry.is_zero()


def _price(entries: Entries, pivot: int, changing: Any) -> tuple[int, bool, int]:
    rows = sum(1 for (i, j) in entries if j == pivot and i != pivot)
    columns = sum(1 for (i, j) in entries if i == pivot and j != pivot)
    return rows * columns, depends(entries[pivot, pivot], changing), pivot


def _pivot(entries: Entries, right: dict[int, Any], pivot: int) -> Step:
    reciprocal = 1.0 / entries.pop((pivot, pivot))
    row = {j: e for (i, j), e in entries.items() if i == pivot}
    column = {i: e for (i, j), e in entries.items() if j == pivot}
    for j in row:
        del entries[pivot, j]
    for i, below in column.items():
        del entries[i, pivot]
        factor = below * reciprocal
        right[i] = right[i] - factor * right[pivot]
        for j, entry in row.items():
            entries[i, j] = entries.get((i, j), ca.SX(0)) - factor * entry
    return Step(pivot, reciprocal, row)
