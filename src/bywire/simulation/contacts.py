"""Unilateral contacts: forces of a group as a small linear complementarity problem."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import casadi as ca

from bywire.simulation.symbols import SX


def active_stiffness(C: Any, d: Any) -> Any:
    """Return K of the active subset of a contact group, shape (n, n): forces are K times overlaps.

    Rows and columns of inactive contacts are zero. The subset is the S that solves the problem:
    finds S with F = C_SS^-1 d_S >= 0 and C F - d >= 0 outside S. Among all subsets the one with
    the largest smallest slack is taken: choosing by "slack > 0" loses all force in exact ties.
    The slacks of inactive contacts count in force units (divided by C_kk).

    Parameters
    ----------
    C
        Compliance matrix, shape (n, n), positive definite.
    d
        Overlaps, shape (n,).
    """
    n = d.shape[0]
    if n == 1:
        pressed = d[0] > 0
        return ca.if_else(pressed, 1.0 / C, 0)
    cases = []
    for subset in (s for size in range(n + 1) for s in combinations(range(n), size)):
        K = _embedded_inverse(C, subset)
        F = K @ d
        outside = C @ F - d
        slacks = [F[k] if k in subset else outside[k] / C[k, k] for k in range(n)]
        slack = slacks[0]
        for other in slacks[1:]:
            slack = ca.fmin(slack, other)
        cases.append((slack, ca.vec(ca.densify(K))))
    return ca.reshape(_largest(cases), n, n)


def _embedded_inverse(C: Any, subset: tuple[int, ...]) -> Any:
    n = C.shape[0]
    K = SX.zeros(n, n)
    if subset:
        rows = list(subset)
        inverse = _inverse(C[rows, rows])
        for a, i in enumerate(rows):
            for b, j in enumerate(rows):
                K[i, j] = inverse[a, b]
    return K


def _inverse(M: Any) -> Any:
    """Return the inverse by cofactors: straight-line, and groups are small."""
    n = M.shape[0]
    if n == 1:
        return 1.0 / M
    adjugate = SX.zeros(n, n)
    for i in range(n):
        for j in range(n):
            rows = [r for r in range(n) if r != j]
            columns = [c for c in range(n) if c != i]
            adjugate[i, j] = (-1) ** (i + j) * ca.det(M[rows, columns])
    determinant = sum((M[0, k] * adjugate[k, 0] for k in range(n)), SX(0))
    return adjugate / determinant


def _largest(cases: list[tuple[Any, Any]]) -> Any:
    best_slack, best = cases[0]
    for slack, value in cases[1:]:
        better = slack > best_slack
        best = ca.if_else(better, value, best)
        best_slack = ca.fmax(slack, best_slack)
    return best
