"""Symbolic substep: implicit midpoint rule with set-valued forces at velocity level.

The state contains the last increment, which predicts the midpoint. At this midpoint, the scheme
evaluates friction bounds, geometry and contact sets. It solves linear terms exactly, and nonlinear
terms with one Newton step. The scheme is of second order in smooth phases and through stick-slip.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any

import casadi as ca

from bywire.core.errors import ModelError
from bywire.core.model import Model
from bywire.core.parameters import ParameterSet
from bywire.simulation.contacts import overlaps, stiffness, violations
from bywire.simulation.symbols import SX, column, depends, nonlinear, scalars, symbol_tuple

# --- Set-valued forces on a few coupled velocities
# Find the velocities w at the end of the step from ``S w = c + lambda``, where ``lambda_k = lo_k``
# if w_k > 0, ``hi_k`` if w_k < 0, and any value in [lo_k, hi_k] if w_k = 0.


NEVER = 1e30  # exceeds every misfit
NOTHING = 1e-318  # rounds a misfit below 1e-6 to exactly zero
FITTING = 1e-12  # misfit, relative to a row's scale, below which guessed signs are accepted
RESIDUAL = 1e-9  # misfit, relative to a row's scale, above which a projection is treated as failed


@dataclass(frozen=True)
class Projection:
    """Final velocities and forces, shape (m,) each, and whether they are a solution.

    ``failed`` is 1.0 if they are not. Forces are clipped to their bounds, so rounding cannot turn
    an energy loss into a gain.
    """

    w: Any
    force: Any
    failed: Any


@dataclass(frozen=True)
class Problem:
    """An exact pass's problem for the set-valued forces, and the symbols of its solution.

    Parameters
    ----------
    matrix, start, low, high
        S, c and bounds, shapes (m, m) and (m,).
    solution
        Velocities and forces, shape (m,) each, and whether the solution failed.
    """

    matrix: Any
    start: Any
    low: Any
    high: Any
    solution: Projection


def _within(force: Any, low: Any, high: Any) -> Any:
    return ca.fmin(ca.fmax(force, low), high)


def soft(z: Any, a: Any, b: Any) -> Any:
    """Return max(z + a, 0) + min(z + b, 0), the row's solution times its diagonal; a <= 0 <= b."""
    return ca.fmax(z + a, 0) + ca.fmin(z + b, 0)


def sliding(v: Any, low: Any, high: Any) -> Any:
    """Return the force on moving rows, whose velocities keep their sign during the substep.

    If a velocity would change sign, the substep is cut.
    """
    return ca.if_else(v > 0, low, high)


def project_fast(S: Any, c: Any, low: Any, high: Any, v: list[Any]) -> Projection:
    """Solve with all resting rows at rest, and check that their bounds can hold them.

    The solution of a single row is exact. Several rows need one linear solve, whose matrix depends
    only on the set of rows at rest. If a holding force exceeds its bounds, a body breaks away, and
    ``failed`` is set.

    Parameters
    ----------
    S, c
        Matrix and right-hand side, shapes (m, m) and (m,).
    low, high
        Bounds, shape (m,).
    v
        Velocity of each row at the start of the substep. Rows with zero velocity are at rest.
    """
    m = c.shape[0]
    if m == 0:
        return Projection(ca.SX(0, 1), ca.SX(0, 1), ca.SX(0))
    resting = [speed == 0 for speed in v]
    slide = [sliding(v[k], low[k], high[k]) for k in range(m)]
    if m == 1:
        # Compilers turn this into a branch that skips the holding forces of moving bodies.
        force = ca.if_else(resting[0], _within(-c, low, high), slide[0])
        return Projection((c + force) / S, force, ca.SX(0))
    M, b = ca.SX(S), ca.SX(c)
    for k in range(m):
        b[k] = ca.if_else(resting[k], 0, c[k] + slide[k])
        for j in range(m):
            M[k, j] = ca.if_else(resting[k], 1.0 if j == k else 0.0, S[k, j])
    w = solve_small(M, b)
    force = S @ w - c
    wrong = ca.SX(0)
    for k in range(m):
        beyond = ca.fmax(force[k] - high[k], low[k] - force[k])
        wrong = ca.fmax(wrong, ca.if_else(resting[k], beyond, 0))
        force[k] = ca.if_else(resting[k], _within(force[k], low[k], high[k]), slide[k])
        # Without this line, the velocity of a row at rest would be zero only to within rounding.
        w[k] = ca.if_else(resting[k], 0, w[k])
    return Projection(w, force, wrong > 0)


def project_exact(S: Any, c: Any, low: Any, high: Any) -> Projection:
    """Try every combination of signs, and choose the one that fits best.

    There are 3^m combinations. They are needed only in the rare substeps where ``project_fast``
    fails.
    """
    m = c.shape[0]
    if m == 0:
        return Projection(ca.SX(0, 1), ca.SX(0, 1), ca.SX(0))
    return Projection(*_exact(m)(S, c, low, high))


@cache
def _exact(m: int) -> Any:
    """Return the projection of m rows as a function of S, c, low, high.

    The function of symbols is cached, because building all combinations would take half of a
    model's setup time.
    """
    S = ca.SX.sym("S", m, m)
    c, low, high = (ca.SX.sym(name, m) for name in ("c", "low", "high"))
    # If both bounds are equal, the force does not jump at zero. A velocity that happens to end at
    # zero is then not at rest, and its derivatives are those of a moving body.
    forced = [ca.if_else(low[k] < high[k], 0, 1) for k in range(m)]
    best, best_misfit = ca.SX.zeros(m), ca.SX(NEVER)
    for signs in product((0, 1, -1), repeat=m):
        w = _with_signs(S, c, low, high, signs)
        misfit = _misfit(S, c, low, high, w)
        for k in range(m):
            misfit = misfit + forced[k] if not signs[k] else misfit
        better = misfit < best_misfit
        best = ca.if_else(better, w, best)
        best_misfit = ca.if_else(better, misfit, best_misfit)
    # NaN forces must not be treated as rest, but compilers may compare NaN incorrectly. For NaN
    # forces, the misfit of the chosen combination is NaN. Otherwise, it adds exactly zero.
    best = best + _misfit(S, c, low, high, best) * NOTHING
    results = [best, _within(S @ best - c, low, high), best_misfit > RESIDUAL]
    return ca.Function("exact_projection", [S, c, low, high], results)


def _row(S: Any, c: Any, low: Any, high: Any, w: Any, k: int) -> Any:
    others = sum((S[k, j] * w[j] for j in range(c.shape[0]) if j != k), ca.SX(0))
    return soft(c[k] - others, low[k], high[k]) / S[k, k]


def _with_signs(S: Any, c: Any, low: Any, high: Any, signs: tuple[int, ...]) -> Any:
    moving = [k for k, s in enumerate(signs) if s]
    w = ca.SX.zeros(len(signs))
    if moving:
        bound = [low[k] if signs[k] > 0 else high[k] for k in moving]
        part = solve_small(S[moving, moving], c[moving] + ca.vertcat(*bound))
        for a, k in enumerate(moving):
            w[k] = part[a]
    return w


def _misfit(S: Any, c: Any, low: Any, high: Any, w: Any) -> Any:
    # A row's scale depends on its terms: if forces cancel (a body squeezed from both sides), the
    # remainder is rounding error. The scale is a sum of magnitudes, because a maximum ignores NaN.
    total = ca.SX(0)
    m = c.shape[0]
    for k in range(m):
        parts = sum((ca.fabs(S[k, j] * w[j]) for j in range(m) if j != k), ca.fabs(c[k]))
        scale = parts / S[k, k] + 1e-300
        total = total + ca.fabs(_row(S, c, low, high, w, k) - w[k]) / scale
    return total


def solve_small(M: Any, b: Any) -> Any:
    """Return M^-1 b, shape (m,), by elimination on the diagonal without branches."""
    m = b.shape[0]
    M, b = ca.SX(M), ca.SX(b)
    for k in range(m):
        reciprocal = 1.0 / M[k, k]
        for i in range(k + 1, m):
            factor = M[i, k] * reciprocal
            for j in range(k + 1, m):
                M[i, j] = M[i, j] - factor * M[k, j]
            b[i] = b[i] - factor * b[k]
    x = ca.SX.zeros(m)
    for k in reversed(range(m)):
        x[k] = (b[k] - sum((M[k, j] * x[j] for j in range(k + 1, m)), ca.SX(0))) / M[k, k]
    return x


# --- Stop operators
# A stop operator's state z follows a motion, and slips at its width. Its force counts with its mean
# over the motion. The stored energy and the loss, width times slip, are then exact, even in a
# substep in which slip begins. This mean is a smooth function of the motion, so Newton's method
# converges fast. The fast pass avoids it: an operator holds or slips for the whole substep.


TINY = 1e-300  # positive where a stop operator does not move
EVEN = 1e-12  # share of width and motion below which two states of a stop operator are equal


@dataclass(frozen=True)
class Stop:
    """A stop operator in a substep, during which its width changes linearly.

    Parameters
    ----------
    start
        State at the start.
    first, last
        Widths at start and end.
    """

    start: Any
    first: Any
    last: Any

    def held_or_slipping(self, half: Any, assumed: Any) -> tuple[Stopped, Any]:
        """Return the result of a motion, if the operator holds or slips for the whole substep.

        Parameters
        ----------
        half
            Half the motion.
        assumed
            The same for the motion that determines whether it slips, and where.

        Returns
        -------
        tuple
            The result, and a value that is positive if the operator does neither.
        """
        ahead, free = self.start + 2.0 * assumed, self.start + 2.0 * half
        slips, is_up = ca.fabs(ahead) > self.last, ahead > 0
        edge = ca.if_else(is_up, self.last, -self.last)
        slip = free - edge
        room = self.first - ca.if_else(is_up, self.start, -self.start)
        # A predicted width is not exactly the width at the next start.
        room = room - (EVEN * self.last + ca.fabs(self.last - self.first))
        inward = ca.fmin(ca.if_else(is_up, -slip, slip), self.last)  # 0 without a width
        doubt = ca.if_else(slips, ca.fmax(room, inward), ca.fabs(free) - self.last)
        origin = ca.if_else(slips, 0.5 * (self.start + edge), self.start)
        result = Stopped(
            end=ca.if_else(slips, edge, free),
            slip=ca.if_else(slips, slip, 0),
            mean=ca.if_else(slips, origin, self.start + half),
            slope=ca.if_else(slips, 0, 1),
            origin=origin,
        )
        return result, doubt

    def after(self, half: Any) -> Stopped:
        """Return the result of a motion, given by its half."""
        free = self.start + 2.0 * half
        end = _within(free, -self.last, self.last)
        slip = free - end
        # A width below the state, for example after a change of a parameter, becomes effective
        # during the substep.
        first = ca.fmax(self.first, ca.fabs(self.start))
        room = ca.if_else(slip > 0, first - self.start, first + self.start)
        share = ca.fabs(slip) / ca.fmax(ca.fabs(slip) + room, TINY)
        mean = self.start + (half - 0.5 * slip * share)
        slope = (1.0 - share) * (1.0 - share)
        return Stopped(end, slip, mean, slope, mean - slope * half)

    def misfit(self, half: Any, assumed: Stopped, result: Stopped) -> Any:
        """Return a positive value if a motion's mean is not on the assumed tangent."""
        scale = self.first + ca.fabs(self.start) + ca.fabs(half)
        return ca.fabs(result.mean - (assumed.origin + assumed.slope * half)) - EVEN * scale


@dataclass(frozen=True)
class Stopped:
    """State of a stop operator after a motion, its slip, and the mean of the state.

    ``origin`` and ``slope``: tangent of the mean as a function of half the motion.
    """

    end: Any
    slip: Any
    mean: Any
    slope: Any
    origin: Any


# --- Linear forms


@dataclass(frozen=True)
class Form:
    """Linear form ``sum_j coefficient_j x_j + rest``.

    The coefficients are constant over all substeps. The kernel therefore hoists them, and the sum
    needs one product per state.

    Parameters
    ----------
    coefficients
        Coefficients by index of the state.
    rest
        Remaining terms.
    """

    coefficients: dict[int, Any]
    rest: Any

    def value(self, x: Any) -> Any:
        """Return the value of the form at the states x."""
        total = self.rest
        for index, coefficient in self.coefficients.items():
            total = total + coefficient * x[index]
        return total

    def plus(self, factor: Any, other: Form, x: Any, changing: Any) -> Form:
        """Return this form plus a factor times another form."""
        if depends(SX(factor), changing):
            return Form(self.coefficients, self.rest + factor * other.value(x))
        coefficients = dict(self.coefficients)
        for index, coefficient in other.coefficients.items():
            coefficients[index] = coefficients.get(index, SX(0)) + factor * coefficient
        return Form(coefficients, self.rest + factor * other.rest)

    def times(self, factor: Any, x: Any, changing: Any) -> Form:
        """Return a factor times this form."""
        return Form({}, SX(0)).plus(factor, self, x, changing)


def forms(
    f: Any, J: Any, x: Any, changing: Any, curved: list[bool], stops: Collection[int]
) -> list[Form]:
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
        Whether each row is nonlinear in x. Nonlinear rows stay unchanged.
    stops
        Entries of x with coefficients that change.
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
            if j in stops or depends(J[i, j], changing):
                moving = moving + J[i, j] * x[j]
            else:
                fixed[j] = J[i, j]
        rows.append(Form(fixed, moving))
    return rows


# --- Elimination

Entries = dict[tuple[int, int], Any]


@dataclass(frozen=True)
class Step:
    """Eliminated row: entries of the pivot row in the remaining columns, and the pivot's inverse.

    In the columns ``alike``, the right-hand side has the same factors with opposite sign.
    """

    pivot: int
    reciprocal: Any
    row: dict[int, Any]
    alike: frozenset[int]


@dataclass(frozen=True)
class Reduced:
    """Remaining equations after the elimination, with the data for back substitution.

    Parameters
    ----------
    kept
        Indices of the remaining rows, in the order of ``matrix``.
    matrix
        Schur complement, shape (m, m).
    right
        Right-hand sides of all rows after the elimination.
    x, changing
        The states in which the forms are linear, and the symbols that change from substep to
        substep.
    """

    kept: tuple[int, ...]
    matrix: Any
    steps: tuple[Step, ...]
    right: dict[int, Form]
    x: Any
    changing: Any

    def start(self, row: int, matrix: Any) -> Any:
        """Return a remaining row's right-hand side plus a matrix times the remaining states."""
        form = self.right[self.kept[row]]
        coefficients = dict(form.coefficients)
        for other, index in enumerate(self.kept):
            coefficients[index] = coefficients.get(index, SX(0)) + matrix[row, other]
        return Form(coefficients, form.rest).value(self.x)

    def back_substitute(self, known: dict[int, Any], middle: dict[int, Any]) -> None:
        """Compute all unknowns from the remaining rows' unknowns, and the states plus the unknowns.

        If a state and its unknown have the same factor, the code multiplies their sum once.
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
    """Eliminate all rows except some, on the diagonal, in the order of least fill.

    Parameters
    ----------
    A, right
        Matrix, shape (n, n), and right-hand sides by row.
    keep
        Rows that remain.
    x
        The states.
    changing
        Symbols that change from substep to substep. Among pivots with equal fill, a pivot that does
        not depend on them comes first, because the kernel can hoist its reciprocal.
    """
    n = A.shape[0]
    entries: Entries = {(i, j): A[i, j] for i in range(n) for j in range(n) if _present(A[i, j])}
    right = dict(right)
    # The matrix is a diagonal matrix minus the coefficients of the states in linear rows.
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
        sums = not depends(SX(factor), changing)  # otherwise, the form becomes a value
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


@dataclass(frozen=True)
class Symbols:
    """Arguments of a substep: state, predicted half increment, memory, parameters, and step.

    All equations use d, which is half the state's increment over the substep, so x + d is the
    midpoint.
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
        State at the end of the substep and half its increment, shape (nx,) each.
    reaction
        Forces of the frictions, then of the limits, then minus the slip speeds of the stop
        operators.
    flow
        Rates of the integrals at the midpoint.
    doubt
        Positive if the pass must be repeated, because a contact set changed, a velocity crossed a
        limit, the projection of the frictions failed, or a stop operator began or ceased to slip.
    jump
        Decrease of half the increment of each velocity with dry friction after a sign change, for
        the body's own mass, shape (m,).
    turn
        Positive if a velocity with dry friction reverses. If friction jumps, the substep is cut.
    problem
        Problem that code outside an exact pass solves; None for other passes.
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
    """Smooth part of the model and its Jacobian, evaluated for the substep.

    ``rows[i] + J[i, :] d`` is the balance at the midpoint x + d, which is exact in linear rows. In
    other rows, its error is of second order in the error of the predicted midpoint.
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
        The model's parameters, with the entries of ``s.p`` as numbers.
    s
        Arguments of the pass.
    exact
        If False, build the pass of nearly every substep, which only checks one-sided limits and
        keeps resting bodies at rest. If True, build the repeated pass, which enforces limits. Its
        caller tries every combination of signs (see `Problem`).
    """
    y = s.x + s.d
    changing = ca.vertcat(s.x, s.d)
    gaps = overlaps(model, par)
    closed = gaps(y, y)
    K = stiffness(model, par, closed, exact)
    at_y = K @ closed
    stops = _stops(model, par, s, gaps)
    moved = _moved(model, par, s, y, at_y, stops)
    assumed = {
        k: stop.after(moved[k]) if exact else stop.held_or_slipping(moved[k], moved[k])[0]
        for k, stop in stops.items()
    }
    y = _replaced(y, {k: each.mean for k, each in assumed.items()})
    linear = _linearize(model, par, s, y, K, gaps, moved, assumed)
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
    if exact:
        stopped = {k: stop.after(d[k]) for k, stop in stops.items()}
        misfits = [stop.misfit(d[k], assumed[k], stopped[k]) for k, stop in stops.items()]
    else:
        both = {k: stop.held_or_slipping(d[k], moved[k]) for k, stop in stops.items()}
        stopped = {k: result for k, (result, _) in both.items()}
        misfits = [misfit for _, misfit in both.values()]
    x = _replaced(x, {k: each.end for k, each in stopped.items()})
    middle = _replaced(middle, {k: each.mean for k, each in stopped.items()})
    d = _replaced(d, {k: 0.5 * (each.end - s.x[k]) for k, each in stopped.items()})
    reaction = ca.vertcat(reaction, *(-each.slip / s.h for each in stopped.values()))
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
    doubts += misfits
    if not exact:
        doubts += [-x[_index(model, name)] for name in model.limits]
    # Use a maximum instead of "or", because compilers do not vectorize selections of truth values.
    doubt = SX(0)
    for one in doubts:
        doubt = ca.fmax(doubt, one)
    turn = _turn(model, s.x, x)
    return Pass(x, d, reaction, column(flow), doubt, jump, turn, problem)


def _turn(model: Model, start: Any, end: Any) -> Any:
    """Return values that are positive if a velocity with dry friction changes sign."""
    turn = SX(0)
    for name in model.frictions:
        k = _index(model, name)
        turn = ca.fmax(turn, -start[k] * end[k])
    return turn


def _stops(
    model: Model, par: ParameterSet, s: Symbols, gaps: Callable[[Any, Any], Any]
) -> dict[int, Stop]:
    """Return the stop operators by the index of their state.

    Raises
    ------
    ModelError
        When overlaps of contacts depend on them.
    """
    if not model.stops:
        return {}
    memory = symbol_tuple(model.Memory, s.m)
    places = [_index(model, name) for name in model.stops]
    if depends(gaps(s.x, s.x), ca.vertcat(*(s.x[k] for k in places))):
        raise ModelError(
            f"{model.name}: overlaps of contacts depend on stop operators. Use other states",
            name="gap",
            value=", ".join(model.stops),
            valid="overlaps without stop operators",
        )
    widths = []
    for x in (s.x, s.x + 2.0 * s.d):
        overlap = gaps(x, x)
        contact = stiffness(model, par, overlap, exact=True) @ overlap
        state = symbol_tuple(model.State, x)
        found = model.widths(state, state, memory, par, scalars(contact))
        widths.append([ca.fmax(SX(width), 0) for width in found])
    return {k: Stop(s.x[k], *pair) for k, *pair in zip(places, *widths, strict=True)}


def _moved(
    model: Model, par: ParameterSet, s: Symbols, y: Any, contact: Any, stops: Mapping[int, Stop]
) -> dict[int, Any]:
    """Return half the predicted motion of each stop operator.

    Raises
    ------
    ModelError
        When a motion depends on stop operators.
    """
    if not stops:
        return {}
    x, memory = symbol_tuple(model.State, y), symbol_tuple(model.Memory, s.m)
    f = column(model.balance(x, x, memory, par, scalars(contact)))
    mass = column(model.mass(x, par))
    moved = {k: 0.5 * s.h * f[k] / mass[k] for k in stops}
    own = ca.vertcat(*(s.x[k] for k in stops))
    for name, half in zip(model.stops, moved.values(), strict=True):
        if depends(half, own):
            raise ModelError(
                f"{model.name}: the rate of {name} depends on a stop operator, but it must be the "
                "speed of a motion that other states determine",
                name=name,
                valid="a rate without stop operators",
            )
    return moved


def _replaced(vector: Any, values: Mapping[int, Any]) -> Any:
    """Return a column with other values at some places."""
    if not values:
        return vector
    return column([values.get(k, vector[k]) for k in range(vector.shape[0])])


def _linearize(
    model: Model,
    par: ParameterSet,
    s: Symbols,
    y: Any,
    K: Any,
    gaps: Callable[[Any, Any], Any],
    moved: Mapping[int, Any],
    assumed: Mapping[int, Stopped],
) -> _Linearized:
    n = s.x.shape[0]
    # The unknown of a stop operator is half its motion, of which its mean is a function. Its
    # tangent continues to ``start``.
    d = _replaced(s.d, moved)
    slope = {k: each.slope for k, each in assumed.items()}
    start = _replaced(s.x, {k: each.origin for k, each in assumed.items()})
    x, xe = SX.sym("x_", n), SX.sym("xe_", n)
    force = SX.sym("contact_", K.shape[0])
    state, fixed = symbol_tuple(model.State, x), symbol_tuple(model.State, xe)
    memory = symbol_tuple(model.Memory, s.m)
    f = column(model.balance(state, fixed, memory, par, scalars(force)))
    variables = ca.vertcat(x, force)
    curved = nonlinear(f, variables)[:n]
    bent = [any(nonlinear(f[i], variables)) for i in range(n)]
    pressed = K @ gaps(x, y)
    at = column([y[k] if curved[k] else start[k] for k in range(n)])
    pressed = ca.densify(pressed)
    with_contact = ca.substitute(f, force, pressed)
    J = ca.jacobian(f, x) + ca.jacobian(f, force) @ ca.jacobian(pressed, x)
    J = ca.substitute(J, force, pressed)
    changing = ca.vertcat(x, xe, s.x, s.d)
    slopes = ca.substitute(J, ca.vertcat(x, xe), ca.vertcat(at, y))
    for k, factor in slope.items():
        slopes[:, k] = slopes[:, k] * factor
    rows = []
    for i, row in enumerate(forms(with_contact, J, x, changing, bent, moved)):
        # Linear rows start from x. Other rows were evaluated at the predicted midpoint of the
        # states in which they are nonlinear, so this part of J d must be subtracted.
        point = at if bent[i] else start
        rest = ca.substitute(row.rest, ca.vertcat(x, xe), ca.vertcat(point, y))
        if bent[i]:
            for j in range(n):
                rest = rest - slopes[i, j] * d[j] if curved[j] else rest
        fixed = {j: ca.substitute(c, xe, y) for j, c in row.coefficients.items()}
        rows.append(Form(fixed, rest))
    return _Linearized(rows, slopes)


def _bounds(model: Model, par: ParameterSet, s: Symbols, y: Any, contact: Any) -> list[Any]:
    """Return (low, high) for each friction."""
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
    """Return the bounds of a friction; at rest, the force counts twice."""
    moving = sliding(v, low, high)
    return ca.if_else(v == 0, low, moving), ca.if_else(v == 0, high, moving)


def _project(
    model: Model, s: Symbols, reduced: Reduced, bounds: list[Any], exact: bool
) -> tuple[Projection, Any, Problem | None]:
    """Return final values of the set-valued states, all reactions, and the unsolved problem."""
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
    for k in range(first, reaction.shape[0]):  # a state away from its limit is free
        reaction[k] = ca.if_else(projection.w[k] > 0, 0, ca.fmax(reaction[k], 0))
    if not exact:
        reaction = ca.vertcat(reaction, SX.zeros(len(model.limits)))
    return projection, reaction, problem


def _increments(s: Symbols, reduced: Reduced, projection: Projection) -> tuple[Any, Any]:
    """Return half the increments, and the midpoints, computed as means to be available earlier."""
    ends = {k: projection.w[a] for a, k in enumerate(reduced.kept)}
    known = {k: 0.5 * (w - s.x[k]) for k, w in ends.items()}
    middle = {k: 0.5 * (s.x[k] + w) for k, w in ends.items()}
    reduced.back_substitute(known, middle)
    every = range(s.x.shape[0])
    return column([known[k] for k in every]), column([middle[k] for k in every])
