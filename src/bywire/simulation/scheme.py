"""One substep, symbolically: implicit midpoint with set-valued forces on the velocity level.

The state carries the last increment, from which the midpoint is predicted; bounds of frictions,
geometry and contact sets are taken there, everything that is linear is solved exactly, and what
is nonlinear gets one Newton step. Second order in smooth phases and through stick-slip.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca

from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.simulation.contacts import overlaps, stiffness, violations
from bywire.simulation.set_valued import Problem, Projection, project_fast, sliding
from bywire.simulation.symbols import SX, column, depends, nonlinear, scalars, symbol_tuple


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
        for other, index in enumerate(self.kept):
            coefficients[index] = coefficients.get(index, SX(0)) + matrix[row, other]
        return Form(coefficients, form.rest).value(self.x)

    def back_substitute(self, known: dict[int, Any], middle: dict[int, Any]) -> None:
        """Add all unknowns to those of the kept rows, and the states plus the unknowns.

        Where a state and its unknown have one factor, their sum takes it.
        """
        for step in reversed(self.steps):
            value = self.right[step.pivot].times(step.reciprocal, self.x, self.changing)
            coefficients = dict(value.coefficients)
            total = value.rest
            for other, entry in step.row.items():
                factor = -entry * step.reciprocal
                joint = other in step.alike and coefficients.pop(other, None) is not None
                total = total + factor * (middle if joint else known)[other]
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
    # The matrix is a diagonal minus the coefficients of the states in linear rows.
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


# --- The substep

NEVER = 1e30  # bound of a one-sided limit's reaction


@dataclass(frozen=True)
class Symbols:
    """Arguments of a substep: state, predicted half increment, memory, parameters, step.

    Half of what the state gains over the substep is what the equations use everywhere: x + d is
    the midpoint.
    """

    x: Any
    d: Any
    m: Any
    p: Any
    h: Any


@dataclass(frozen=True)
class Pass:
    """Results of one pass through a substep.

    Parameters
    ----------
    x, d
        State at the end and half the increment, shape (nx,) each.
    reaction
        Forces of the frictions, then of the limits.
    flow
        Rates of the integrals at the midpoint.
    doubt
        Positive where the pass must be repeated: a contact set changed, a limit was crossed, or the
        projection of the frictions failed.
    jump
        By how much half the increment of each velocity with dry friction is less behind a change
        of its sign, by its mass alone, shape (m,).
    turn
        Positive where a velocity with dry friction does: where that jumps, the substep is cut.
    problem
        Problem to solve outside an exact pass; None in other passes.
    """

    x: Any
    d: Any
    reaction: Any
    flow: Any
    doubt: Any
    jump: Any
    turn: Any
    problem: Problem | None


@dataclass(frozen=True)
class _Linearized:
    """The model's smooth part and its Jacobian, evaluated where the substep needs them.

    ``rows[i] + J[i, :] d`` is the balance at the midpoint x + d: exactly in rows that are linear,
    to second order in the error of the predicted midpoint in the others.
    """

    rows: list[Form]
    J: Any


def build_pass(model: Model, par: ParameterSet, s: Symbols, exact: bool) -> Pass:
    """Build one pass.

    Parameters
    ----------
    model
        The system.
    par
        Its parameters with the entries of ``s.p`` as numbers.
    s
        Arguments of the pass.
    exact
        False: the pass of nearly every substep, which leaves one-sided limits alone and only
        checks them, and keeps at rest what rests. True: the repeated pass, with limits, in which
        every combination of signs is tried: outside, see `Problem`.
    """
    y = s.x + s.d
    changing = ca.vertcat(s.x, s.d)
    gaps = overlaps(model, par)
    closed = gaps(y, y)
    K = stiffness(model, par, closed, exact)
    at_y = K @ closed
    linear = _linearize(model, par, s, y, K, gaps)
    bounds = _bounds(model, par, s, y, at_y)
    mass = column(model.mass(symbol_tuple(model.State, y), par))
    rubbing = [_index(model, name) for name in model.frictions]
    jump = column(
        [0.5 * s.h * (high - low) / mass[k] for k, (low, high) in zip(rubbing, bounds, strict=True)]
    )
    A = ca.diag(2.0 / s.h * mass) - linear.J
    right = dict(enumerate(linear.rows))
    kept = _set_valued_states(model, exact)
    reduced = eliminate(A, right, kept, s.x, changing)
    projection, reaction, problem = _project(model, s, reduced, bounds, exact)
    d, middle = _increments(s, reduced, projection)
    x = column(
        [projection.w[kept.index(k)] if k in kept else middle[k] + d[k] for k in range(d.shape[0])]
    )
    overlap = gaps(middle, y)
    contact = K @ overlap
    flow = model.powers(
        symbol_tuple(model.State, middle),
        symbol_tuple(model.State, y),
        symbol_tuple(model.State, 2.0 / s.h * d),
        symbol_tuple(model.Memory, s.m),
        par,
        scalars(contact),
        scalars(reaction),
    )
    doubts = violations(model, par, overlap, contact, exact)
    doubts.append(ca.if_else(projection.failed, 1, 0))
    if not exact:
        doubts += [-x[_index(model, name)] for name in model.limits]
    # A maximum and no logical or: compilers do not vectorize selections between truth values.
    doubt = SX(0)
    for one in doubts:
        doubt = ca.fmax(doubt, one)
    turn = _turn(model, s.x, x)
    return Pass(x, d, reaction, column(flow), doubt, jump, turn, problem)


def _turn(model: Model, start: Any, end: Any) -> Any:
    """Return values that are positive where a velocity with dry friction changes its sign."""
    turn = SX(0)
    for name in model.frictions:
        k = _index(model, name)
        turn = ca.fmax(turn, -start[k] * end[k])
    return turn


def _linearize(
    model: Model, par: ParameterSet, s: Symbols, y: Any, K: Any, gaps: Callable[[Any, Any], Any]
) -> _Linearized:
    n = s.x.shape[0]
    x, xe = SX.sym("x_", n), SX.sym("xe_", n)
    force = SX.sym("contact_", K.shape[0])
    state, fixed = symbol_tuple(model.State, x), symbol_tuple(model.State, xe)
    memory = symbol_tuple(model.Memory, s.m)
    f = column(model.balance(state, fixed, memory, par, scalars(force)))
    variables = ca.vertcat(x, force)
    curved = nonlinear(f, variables)[:n]
    bent = [any(nonlinear(f[i], variables)) for i in range(n)]
    pressed = K @ gaps(x, y)
    at = column([y[k] if curved[k] else s.x[k] for k in range(n)])
    pressed = ca.densify(pressed)
    with_contact = ca.substitute(f, force, pressed)
    J = ca.jacobian(f, x) + ca.jacobian(f, force) @ ca.jacobian(pressed, x)
    J = ca.substitute(J, force, pressed)
    changing = ca.vertcat(x, xe, s.x, s.d)
    slopes = ca.substitute(J, ca.vertcat(x, xe), ca.vertcat(at, y))
    rows = []
    for i, row in enumerate(forms(with_contact, J, x, changing, bent)):
        # Linear rows start from x. The others were taken at the predicted midpoint in the states
        # that they are nonlinear in, so the part of J d that leads there comes off again.
        point = at if bent[i] else s.x
        rest = ca.substitute(row.rest, ca.vertcat(x, xe), ca.vertcat(point, y))
        if bent[i]:
            for j in range(n):
                rest = rest - slopes[i, j] * s.d[j] if curved[j] else rest
        fixed = {j: ca.substitute(c, xe, y) for j, c in row.coefficients.items()}
        rows.append(Form(fixed, rest))
    return _Linearized(rows, slopes)


def _bounds(model: Model, par: ParameterSet, s: Symbols, y: Any, contact: Any) -> list[Any]:
    """Return (low, high) of every friction."""
    state = symbol_tuple(model.State, y)
    memory = symbol_tuple(model.Memory, s.m)
    pairs = model.bounds(state, state, memory, par, scalars(contact))
    return [(ca.fmin(SX(low), 0), ca.fmax(SX(high), 0)) for low, high in pairs]


def _set_valued_states(model: Model, exact: bool) -> tuple[int, ...]:
    names = model.frictions + (model.limits if exact else ())
    return tuple(_index(model, name) for name in names)


def _index(model: Model, name: str) -> int:
    return model.State._fields.index(name)


def _acting(v: Any, low: Any, high: Any) -> tuple[Any, Any]:
    """Return the bounds of a friction at rest, where it moves twice the force that acts."""
    moving = sliding(v, low, high)
    return ca.if_else(v == 0, low, moving), ca.if_else(v == 0, high, moving)


def _project(
    model: Model, s: Symbols, reduced: Reduced, bounds: list[Any], exact: bool
) -> tuple[Projection, Any, Problem | None]:
    """Return end-of-step values of the set-valued states, all reactions, and what is left open."""
    pairs = bounds
    if exact:
        pairs = [_acting(s.x[k], *pair) for k, pair in zip(reduced.kept, bounds, strict=False)]
        pairs += [(SX(0), SX(NEVER)) for _ in model.limits]
    low, high = column([p[0] for p in pairs]), column([p[1] for p in pairs])
    # The unknowns are d = (w - x) / 2, so that S d = c + force is (S/2) w = c + (S/2) x + force.
    half = 0.5 * reduced.matrix
    c = column([reduced.start(row, half) for row in range(len(reduced.kept))])
    problem = None
    if exact:
        m = len(reduced.kept)
        w, force = SX.sym("w", m), SX.sym("force", m)
        projection = Projection(w, force, SX.sym("failed"))
        problem = Problem(half, c, low, high, projection)
    else:
        projection = project_fast(half, c, low, high, [s.x[k] for k in reduced.kept])
    reaction = ca.SX(projection.force)
    first = len(model.frictions)
    for k in range(first, reaction.shape[0]):  # away from its limit a state feels nothing of it
        reaction[k] = ca.if_else(projection.w[k] > 0, 0, ca.fmax(reaction[k], 0))
    if not exact:
        reaction = ca.vertcat(reaction, SX.zeros(len(model.limits)))
    return projection, reaction, problem


def _increments(s: Symbols, reduced: Reduced, projection: Projection) -> tuple[Any, Any]:
    """Return half the increments, and the midpoints: the mean of start and end comes sooner."""
    ends = {k: projection.w[a] for a, k in enumerate(reduced.kept)}
    known = {k: 0.5 * (w - s.x[k]) for k, w in ends.items()}
    middle = {k: 0.5 * (s.x[k] + w) for k, w in ends.items()}
    reduced.back_substitute(known, middle)
    every = range(s.x.shape[0])
    return column([known[k] for k in every]), column([middle[k] for k in every])
