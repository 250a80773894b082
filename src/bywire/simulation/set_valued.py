"""Set-valued forces on a few coupled velocities: the projection of a substep.

Given ``S w = c + lambda`` with ``lambda_k = lo_k`` where w_k > 0, ``hi_k`` where w_k < 0 and
anything in [lo_k, hi_k] where w_k = 0, find the end-of-step velocities w.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any

import casadi as ca

NEVER = 1e30  # more than any misfit
NOTHING = 1e-318  # makes exactly zero of a misfit below 1e-6
FITTING = 1e-12  # share of a row's own scale below which signs that were guessed are taken
RESIDUAL = 1e-9  # share of a row's own scale above which a projection counts as failed


@dataclass(frozen=True)
class Projection:
    """End-of-step velocities and forces, shape (m,) each, and whether they solve the problem.

    ``failed`` is 1.0 where they do not. Forces lie within their bounds to the last digit: what
    rounding leaves of one must not turn a loss into a gain.
    """

    w: Any
    force: Any
    failed: Any


@dataclass(frozen=True)
class Problem:
    """Problem of the set-valued forces of an exact pass, and the symbols of its solution.

    Parameters
    ----------
    matrix, start, low, high
        S, c and bounds, shapes (m, m) and (m,).
    solution
        Velocities and forces, shape (m,) each, and whether they failed.
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
    """Return the force on moving rows: a velocity keeps the sign from the start of the substep.

    Where it does not, the substep is cut.
    """
    return ca.if_else(v > 0, low, high)


def project_fast(S: Any, c: Any, low: Any, high: Any, v: list[Any]) -> Projection:
    """Solve with all resting rows at rest, and check that their bounds can hold them.

    One row is exact. Several take one linear solve, whose matrix changes with what rests alone;
    where a force at rest leaves its bounds, a body breaks away: ``failed``.

    Parameters
    ----------
    S, c
        Matrix and right-hand side, shapes (m, m) and (m,).
    low, high
        Bounds, shape (m,).
    v
        Velocities at the start of the substep, one per row: rows with zero velocity rest.
    """
    m = c.shape[0]
    if m == 0:
        return Projection(ca.SX(0, 1), ca.SX(0, 1), ca.SX(0))
    resting = [speed == 0 for speed in v]
    slide = [sliding(v[k], low[k], high[k]) for k in range(m)]
    if m == 1:
        # Compilers make a branch of it, which moving bodies pass without what could hold them.
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
        # Else a row at rest would be zero but for rounding.
        w[k] = ca.if_else(resting[k], 0, w[k])
    return Projection(w, force, wrong > 0)


def project_exact(S: Any, c: Any, low: Any, high: Any) -> Projection:
    """Solve by trying every combination of signs and taking the one that fits best.

    3^m combinations: for the rare substeps in which ``project_fast`` does not serve.
    """
    m = c.shape[0]
    if m == 0:
        return Projection(ca.SX(0, 1), ca.SX(0, 1), ca.SX(0))
    return Projection(*_exact(m)(S, c, low, high))


@cache
def _exact(m: int) -> Any:
    """Return the projection of m rows as a function of S, c, low, high.

    Evaluated on symbols: writing out all combinations for every model takes half of its set-up.
    """
    S = ca.SX.sym("S", m, m)
    c, low, high = (ca.SX.sym(name, m) for name in ("c", "low", "high"))
    # Where both bounds are one force, that acts at zero, too: a velocity that happens to end there
    # does not rest, and its derivatives are those of a moving one.
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
    # Forces that are no numbers must not pass for rest, and compilers need not compare them right:
    # the misfit of what was chosen tells, of which nothing else is added.
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
    # A row is judged by the largest of what it adds up: where forces cancel (a body squeezed from
    # both sides), what is left of them is rounding. A sum, for a maximum skips what is no number.
    total = ca.SX(0)
    m = c.shape[0]
    for k in range(m):
        parts = sum((ca.fabs(S[k, j] * w[j]) for j in range(m) if j != k), ca.fabs(c[k]))
        scale = parts / S[k, k] + 1e-300
        total = total + ca.fabs(_row(S, c, low, high, w, k) - w[k]) / scale
    return total


def solve_small(M: Any, b: Any) -> Any:
    """Return M^-1 b by elimination on the diagonal, shape (m,); straight-line."""
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
