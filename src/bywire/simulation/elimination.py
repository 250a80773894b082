"""Symbolic elimination of the smooth states from the linear system of a substep."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca

from bywire.simulation.symbols import SX, depends


@dataclass(frozen=True)
class Form:
    """``sum_j coefficient_j x_j + rest``.

    The coefficients do not change from substep to substep, so that the kernel hoists them and
    the sum takes one product per state.

    Parameters
    ----------
    coefficients
        By index of the state.
    rest
        Everything else.
    """

    coefficients: dict[int, Any]
    rest: Any

    def value(self, x: Any) -> Any:
        """Return the number that the form stands for at the states x."""
        total = self.rest
        for index, coefficient in self.coefficients.items():
            total = total + coefficient * x[index]
        return total

    def plus(self, factor: Any, other: Form, x: Any, changing: Any) -> Form:
        """Return this form plus a factor times another one."""
        if depends(SX(factor), changing):
            return Form(self.coefficients, self.rest + factor * other.value(x))
        coefficients = dict(self.coefficients)
        for index, coefficient in other.coefficients.items():
            coefficients[index] = coefficients.get(index, SX(0)) + factor * coefficient
        return Form(coefficients, self.rest + factor * other.rest)

    def times(self, factor: Any, x: Any, changing: Any) -> Form:
        """Return a factor times this form."""
        return Form({}, SX(0)).plus(factor, self, x, changing)


def forms(f: Any, J: Any, x: Any, changing: Any, curved: list[bool]) -> list[Form]:
    """Return the rows of f as forms.

    Parameters
    ----------
    f
        Rows, as functions of the symbols x; shape (n,).
    J
        Jacobian of f with respect to x.
    changing
        Symbols that change from substep to substep.
    curved
        For each row whether it is nonlinear in x: it stays as it is.
    """
    at_zero = ca.substitute(f, x, SX.zeros(x.shape[0]))
    rows = []
    for i in range(f.shape[0]):
        if curved[i]:
            rows.append(Form({}, f[i]))
            continue
        fixed, moving = {}, at_zero[i]
        for j in range(x.shape[0]):
            if J[i, j].is_zero():
                continue
            if depends(J[i, j], changing):
                moving = moving + J[i, j] * x[j]
            else:
                fixed[j] = J[i, j]
        rows.append(Form(fixed, moving))
    return rows


# --- Elimination

Entries = dict[tuple[int, int], Any]


@dataclass(frozen=True)
class Step:
    """One eliminated row: pivot row's entries in the columns that were left, and its reciprocal.

    In the columns ``alike`` the right-hand side has the same factors, with the other sign.
    """

    pivot: int
    reciprocal: Any
    row: dict[int, Any]
    alike: frozenset[int]


@dataclass(frozen=True)
class Reduced:
    """System that is left for the kept rows, and what is needed to get the others back.

    Parameters
    ----------
    kept
        Indices of the kept rows, in the order of ``matrix``.
    matrix
        Schur complement, shape (m, m).
    right
        Right-hand sides of all rows as they stand after the elimination.
    x, changing
        The states that the forms are linear in; symbols that change from substep to substep.
    """

    kept: tuple[int, ...]
    matrix: Any
    steps: tuple[Step, ...]
    right: dict[int, Form]
    x: Any
    changing: Any

    def start(self, row: int, matrix: Any) -> Any:
        """Return the kept row's right-hand side plus a matrix times the kept states."""
        form = self.right[self.kept[row]]
        coefficients = dict(form.coefficients)
        for column, index in enumerate(self.kept):
            coefficients[index] = coefficients.get(index, SX(0)) + matrix[row, column]
        return Form(coefficients, form.rest).value(self.x)

    def back_substitute(self, known: dict[int, Any], middle: dict[int, Any]) -> None:
        """Add all unknowns to those of the kept rows, and the states plus the unknowns.

        Where a state and its unknown have one factor, their sum takes it.
        """
        for step in reversed(self.steps):
            value = self.right[step.pivot].times(step.reciprocal, self.x, self.changing)
            coefficients = dict(value.coefficients)
            total = value.rest
            for column, entry in step.row.items():
                factor = -entry * step.reciprocal
                joint = column in step.alike and coefficients.pop(column, None) is not None
                total = total + factor * (middle if joint else known)[column]
            total = Form(coefficients, total).value(self.x)
            known[step.pivot], middle[step.pivot] = total, self.x[step.pivot] + total


def eliminate(
    A: Any, right: dict[int, Form], keep: tuple[int, ...], x: Any, changing: Any
) -> Reduced:
    """Eliminate all rows but the kept ones, on the diagonal, least fill first.

    Parameters
    ----------
    A, right
        Matrix, shape (n, n), and right-hand sides by row.
    keep
        Rows that stay.
    x
        The states.
    changing
        Symbols that change from substep to substep: among pivots of equal fill, one that does
        not depend on them comes first, for then its reciprocal is hoisted.
    """
    n = A.shape[0]
    entries: Entries = {(i, j): A[i, j] for i in range(n) for j in range(n) if _present(A[i, j])}
    right = dict(right)
    # The matrix is a diagonal less what rows that are linear have before the states.
    alike = {(i, j) for i, form in right.items() for j in form.coefficients if j != i}
    left = [i for i in range(n) if i not in keep]
    steps = []
    while left:
        pivot = min(left, key=lambda i: _price(entries, i, changing))
        left.remove(pivot)
        steps.append(_pivot(entries, right, alike, pivot, x, changing))
    m = len(keep)
    S = ca.SX.zeros(m, m)
    for a, i in enumerate(keep):
        for b, j in enumerate(keep):
            S[a, b] = entries.get((i, j), 0)
    return Reduced(keep, S, tuple(steps), right, x, changing)


def _present(entry: Any) -> bool:
    return not entry.is_zero()


def _price(entries: Entries, pivot: int, changing: Any) -> tuple[int, bool, int]:
    rows = sum(1 for (i, j) in entries if j == pivot and i != pivot)
    columns = sum(1 for (i, j) in entries if i == pivot and j != pivot)
    return rows * columns, depends(entries[pivot, pivot], changing), pivot


def _pivot(
    entries: Entries,
    right: dict[int, Form],
    alike: set[tuple[int, int]],
    pivot: int,
    x: Any,
    changing: Any,
) -> Step:
    reciprocal = 1.0 / entries.pop((pivot, pivot))
    row = {j: e for (i, j), e in entries.items() if i == pivot}
    column = {i: e for (i, j), e in entries.items() if j == pivot}
    for j in row:
        del entries[pivot, j]
    for i, below in column.items():
        del entries[i, pivot]
        factor = below * reciprocal
        sums = not depends(SX(factor), changing)  # else the form becomes a number
        for j in (row.keys() | right[pivot].coefficients.keys()) - {i}:
            is_free = (i, j) not in entries and j not in right[i].coefficients
            if not (sums and (pivot, j) in alike and (is_free or (i, j) in alike)):
                alike.discard((i, j))
            elif is_free:
                alike.add((i, j))
        right[i] = right[i].plus(-factor, right[pivot], x, changing)
        for j, entry in row.items():
            entries[i, j] = entries.get((i, j), ca.SX(0)) - factor * entry
    return Step(pivot, reciprocal, row, frozenset(j for j in row if (pivot, j) in alike))
