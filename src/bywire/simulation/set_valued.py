"""Set-valued forces on a few coupled velocities: the projection of a substep.

Given ``S w = c + lambda`` with ``lambda_k = lo_k`` where w_k > 0, ``hi_k`` where w_k < 0 and
anything in [lo_k, hi_k] where w_k = 0, find the end-of-step velocities w.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import casadi as ca

SWEEPS = 2
RESIDUAL = 1e-9  # share of a row's own scale above which a projection counts as failed


@dataclass(frozen=True)
class Projection:
    """End-of-step velocities, shape (m,), and whether they solve the problem (1.0 if not)."""

    w: Any
    failed: Any


def soft(z: Any, a: Any, b: Any) -> Any:
    """Return max(z + a, 0) + min(z + b, 0), the row's solution times its diagonal; a <= 0 <= b."""
    return ca.fmax(z + a, 0) + ca.fmin(z + b, 0)


def project_fast(S: Any, c: Any, low: Any, high: Any) -> Projection:
    """Solve by sweeps over the rows, then exactly for the signs that the sweeps found.

    One row is exact. Several take two Gauss-Seidel sweeps and a linear solve with the signs
    kept; velocities must keep these signs and forces at rest their bounds, else ``failed``.

    Parameters
    ----------
    S, c
        Matrix and right-hand side, shapes (m, m) and (m,).
    low, high
        Bounds, shape (m,).
    """
    m = c.shape[0]
    if m == 0:
        return Projection(ca.SX(0, 1), ca.SX(0))
    if m == 1:
        return Projection(soft(c, low, high) / S, ca.SX(0))
    w = ca.SX.zeros(m)
    for _ in range(SWEEPS):
        w = _sweep(S, c, low, high, w)
    signs, w = w, _polished(S, c, low, high, w)
    force = S @ w - c
    wrong = ca.SX(0)
    for k in range(m):
        beyond = ca.fmax(force[k] - high[k], low[k] - force[k])
        wrong = ca.fmax(wrong, ca.if_else(signs[k] == 0, beyond, -signs[k] * w[k]))
    return Projection(w, wrong > 0)


def project_exact(S: Any, c: Any, low: Any, high: Any) -> Projection:
    """Solve by trying every combination of signs and taking the one that fits best.

    3^m combinations: for the rare substeps in which ``project_fast`` does not serve.
    """
    m = c.shape[0]
    if m == 0:
        return Projection(ca.SX(0, 1), ca.SX(0))
    best = ca.SX.zeros(m)
    best_misfit = _misfit(S, c, low, high, best)
    for signs in product((0, 1, -1), repeat=m):
        if not any(signs):
            continue
        w = _with_signs(S, c, low, high, signs)
        misfit = _misfit(S, c, low, high, w)
        better = misfit < best_misfit
        best = ca.if_else(better, w, best)
        best_misfit = ca.fmin(misfit, best_misfit)
    return Projection(best, best_misfit > RESIDUAL)


def _row(S: Any, c: Any, low: Any, high: Any, w: Any, k: int) -> Any:
    others = sum((S[k, j] * w[j] for j in range(c.shape[0]) if j != k), ca.SX(0))
    return soft(c[k] - others, low[k], high[k]) / S[k, k]


def _sweep(S: Any, c: Any, low: Any, high: Any, w: Any) -> Any:
    w = ca.SX(w)
    for k in range(c.shape[0]):
        w[k] = _row(S, c, low, high, w, k)
    return w


def _polished(S: Any, c: Any, low: Any, high: Any, w: Any) -> Any:
    """Solve with the signs of w: zero rows stay zero, the others carry their sign's bound."""
    m = c.shape[0]
    M, b = ca.SX(S), ca.SX(c)
    for k in range(m):
        still = w[k] == 0
        bound = ca.if_else(w[k] > 0, low[k], high[k])
        b[k] = ca.if_else(still, 0, c[k] + bound)
        for j in range(m):
            M[k, j] = ca.if_else(still, 1.0 if j == k else 0.0, S[k, j])
    return solve_small(M, b)


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
    # both sides), what is left of them is rounding.
    worst = ca.SX(0)
    m = c.shape[0]
    for k in range(m):
        parts = sum((ca.fabs(S[k, j] * w[j]) for j in range(m) if j != k), ca.fabs(c[k]))
        scale = parts / S[k, k] + 1e-300
        worst = ca.fmax(worst, ca.fabs(_row(S, c, low, high, w, k) - w[k]) / scale)
    return worst


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
