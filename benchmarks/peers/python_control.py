"""Peer python-control, which linearizes the continuous part of a model by finite differences."""

from __future__ import annotations

from itertools import combinations
from typing import Any, cast

import numpy as np

from bywire.analysis.loop import Point
from bywire.core.typing import Array


def nonlinear_system(point: Point) -> Any:
    """Return the continuous part, without dry friction, as ``control.NonlinearIOSystem``.

    Its equations are the model's own functions on Python numbers. Each call determines which
    contacts are closed, from precomputed inverses.
    """
    import control

    model, par = point.model, point.par
    groups = [_inverses(np.array(C, dtype=float)) for C in model.compliance(par) if C]
    State, Memory = cast(Any, model.State), cast(Any, model.Memory)

    def rates(t: float, x: Array, u: Array, params: Any) -> list[float]:
        at, held = State(*x.tolist()), Memory(*u.tolist())
        contact: list[float] = []
        gaps = (group for group in model.gap(at, at, par) if group)
        for known, overlaps in zip(groups, gaps, strict=True):
            contact += _forces(known, np.array(overlaps))
        force = model.balance(at, at, held, par, tuple(contact))
        return [f / m for f, m in zip(force, model.mass(at, par), strict=True)]

    return control.NonlinearIOSystem(
        rates,
        lambda t, x, u, params: x,
        states=list(State._fields),
        inputs=list(Memory._fields),
        outputs=[f"y_{name}" for name in State._fields],
        params={},
    )


def by_differences(system: Any, point: Point) -> Array:
    """Return A from ``control.linearize``."""
    import control

    return np.asarray(control.linearize(system, list(point.state), list(point.memory)).A)


def _inverses(C: Array) -> tuple[Array, Array]:
    """Return stiffnesses K of all subsets of closed contacts, and the maps that test them.

    A subset is valid if its map has no negative result: F of its contacts, C F - d elsewhere.
    """
    n = len(C)
    stiffnesses, tests = [], []
    for closed in (list(s) for size in range(n + 1) for s in combinations(range(n), size)):
        K = np.zeros((n, n))
        K[np.ix_(closed, closed)] = np.linalg.inv(C[np.ix_(closed, closed)])
        test = C @ K - np.eye(n)
        test[closed] = (np.diag(C)[:, None] * K)[closed]
        stiffnesses.append(K)
        tests.append(test)
    return np.array(stiffnesses), np.array(tests)


def _forces(known: tuple[Array, Array], d: Array) -> list[float]:
    stiffnesses, tests = known
    best = int((tests @ d).min(axis=1).argmax())
    return cast(list[float], (stiffnesses[best] @ d).tolist())
