"""The projection of set-valued frictions against brute force, for weak and strong coupling."""

from __future__ import annotations

import ctypes
from itertools import product

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from bywire.simulation.c_runtime import SCALAR
from bywire.simulation.compiler import SINGLE, compile_library, find_compiler
from bywire.simulation.emit_rare import PROJECTION
from bywire.simulation.scheme import FITTING, NEVER, NOTHING, RESIDUAL, project_exact, project_fast

Array = NDArray[np.float64]
COUNT = 5000
TOLERANCE = 1e-7  # of the largest velocity of a case; S is conditioned up to 1e4


def evaluate(project: object, S: Array, c: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Return velocities, shape (count, m), and which of them are reported as failed."""
    count, m = c.shape
    args = [ca.SX.sym("S", m, m), *(ca.SX.sym(name, m) for name in ("c", "lo", "hi"))]
    speeds = [ca.if_else(args[2][k] < args[3][k], 0, 1) for k in range(m)]
    more = [speeds] if project is project_fast else []
    result = project(*args, *more)  # type: ignore[operator]
    one = ca.Function("one", args, [result.w, result.failed])
    values = [ca.DM(np.hstack(list(S))), *(ca.DM(v.T) for v in (c, low, high))]
    w, failed = one.map(count)(*values)
    return np.array(w).T, np.array(failed).ravel() != 0


def in_c(S: Array, c: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Return the same of the C text of kernels."""
    count, m = c.shape
    compiler = find_compiler()
    assert compiler is not None
    source = f"""{SCALAR}
#define APART
enum {{ SETS = {m} }};
#define NEVER {NEVER}
#define NOTHING {NOTHING}
#define RESIDUAL {RESIDUAL}
#define FITTING {FITTING}
{PROJECTION}
void each(int count, const double *posed, double *w, double *failed) {{
  double force[SETS];
  for (int k = 0; k < count; ++k)
    failed[k] = project(posed + k * SETS * (SETS + 3), w + k * SETS, force);
}}"""
    library = ctypes.CDLL(str(compile_library(source, SINGLE, compiler, "each")))
    posed = np.ascontiguousarray(np.hstack([S.reshape(count, m * m), c, low, high]))
    w, failed = np.empty((count, m)), np.empty(count)
    library.each(count, *(ctypes.c_void_p(a.ctypes.data) for a in (posed, w, failed)))
    return w, failed != 0


def violation(S: Array, c: Array, low: Array, high: Array, w: Array) -> Array:
    """Return how far velocities miss the conditions, as a share of the forces; shape (count,)."""
    force = np.einsum("nij,nj->ni", S, w) - c
    nearest = np.where(w > 0, low, np.where(w < 0, high, np.clip(force, low, high)))
    scale = np.abs(c).max(axis=1) + np.maximum(-low, high).max(axis=1)
    return np.abs(force - nearest).max(axis=1) / scale


def brute(S: Array, c: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Return the velocities of the best combination of signs, and its violation."""
    count, m = c.shape
    best, least = np.zeros((count, m)), np.full(count, np.inf)
    for signs in product((0, 1, -1), repeat=m):
        moving = np.flatnonzero(signs)
        w = np.zeros((count, m))
        if moving.size:
            right = c + np.where(np.array(signs) > 0, low, high)
            block = S[:, moving][:, :, moving]
            w[:, moving] = np.linalg.solve(block, right[:, moving, None])[..., 0]
        wrong = violation(S, c, low, high, w)
        better = wrong < least
        best[better], least[better] = w[better], wrong[better]
    return best, least


def cases(m: int, coupling: str, seed: int) -> tuple[Array, Array, Array, Array]:
    """Return random problems; ``weak``: off-diagonal terms below 0.3 of the diagonal in sum.

    Half of the rows rest; the others move, so that both of their bounds are the force that acts.
    """
    rng = np.random.default_rng(seed)
    off = rng.uniform(-1.0, 1.0, (COUNT, m, m)) * (1.0 - np.eye(m))
    root = rng.normal(size=(COUNT, m, m))
    S = {
        "weak": np.eye(m) + 0.3 / max(m - 1, 1) * off,
        "strong": root @ root.transpose(0, 2, 1) + 0.02 * np.eye(m),
        "indefinite": np.eye(m) + 3.0 * off,
    }[coupling]
    scale = 10.0 ** rng.uniform(-3.0, 3.0, (COUNT, m, 1))
    root = np.sqrt(scale * scale.transpose(0, 2, 1))  # rows of very different size
    c = rng.normal(size=(COUNT, m)) * np.sqrt(scale[..., 0])
    low, high = -rng.exponential(size=(COUNT, m)), rng.exponential(size=(COUNT, m))
    low[rng.random((COUNT, m)) < 0.1] = 0.0  # a friction that acts in one direction only
    way = rng.choice((-1, 0, 0, 1), size=(COUNT, m))
    low, high = np.where(way < 0, high, low), np.where(way > 0, low, high)
    units = np.sqrt(scale[..., 0])
    return S * root, c, low * units, high * units


@pytest.mark.parametrize("coupling", ["weak", "strong"])
@pytest.mark.parametrize("m", [1, 2, 3])
def test_never_wrong(m: int, coupling: str) -> None:
    """What is not reported as failed is right; the exact projection always is."""
    problem = cases(m, coupling, 20 + m)
    expected, least = brute(*problem)
    assert least.max() < 1e-9
    scale = np.abs(expected).max(axis=1, keepdims=True) + 1e-300
    for project in (project_fast, project_exact, in_c):
        w, failed = in_c(*problem) if project is in_c else evaluate(project, *problem)
        right = (np.abs(w - expected) / scale).max(axis=1) < TOLERANCE
        assert np.all(right | failed)
        assert project is project_fast or not failed.any()
    assert {tuple(row) for row in np.sign(expected).astype(int)} == set(
        product((0, 1, -1), repeat=m)
    )


@pytest.mark.parametrize("coupling", ["weak", "strong"])
@pytest.mark.parametrize("m", [1, 2, 3])
def test_only_what_breaks_away_takes_the_enumeration(m: int, coupling: str) -> None:
    """One row needs it never; of several it is reported, and nothing else, however coupled."""
    problem = cases(m, coupling, 40 + m)
    expected, _ = brute(*problem)
    _, _, low, high = problem
    breaks = ((low < high) & (expected != 0.0)).any(axis=1) & (m > 1)
    _, failed = evaluate(project_fast, *problem)
    np.testing.assert_array_equal(failed, breaks)
    assert m == 1 or 0.2 < breaks.mean() < 0.8


@pytest.mark.parametrize("m", [2, 3])
def test_without_a_unique_solution(m: int) -> None:
    """An indefinite matrix may have several solutions: one of them, or a report of failure."""
    problem = cases(m, "indefinite", 60 + m)
    for project in (project_fast, project_exact, in_c):
        w, failed = in_c(*problem) if project is in_c else evaluate(project, *problem)
        assert violation(*problem, w)[~failed].max(initial=0.0) < TOLERANCE
        assert failed.mean() < (0.8 if project is project_fast else 0.35)


def test_forces_that_cancel_leave_rounding_and_no_failure() -> None:
    """Of two forces of 2e8 N on the third body, 2 N are left: their rounding is no failure."""
    S = np.array([[2.0, 0.0, 0.7], [0.0, 2.0, 0.3], [0.7, 0.3, 2.0]])
    low, high = -np.ones(3), np.ones(3)
    wanted = np.array([1e9 / 3.0, -7e9 / 9.0, 1.0])
    c = S @ wanted - np.where(wanted > 0.0, low, high)
    problem = S[None], c[None], low[None], high[None]
    for w, failed in (evaluate(project_exact, *problem), in_c(*problem)):
        np.testing.assert_allclose(w[0], wanted, rtol=1e-6)
        assert not failed.any()


@pytest.mark.parametrize("project", [project_fast, project_exact])
def test_without_frictions_there_is_nothing_to_find_and_nothing_fails(project: object) -> None:
    nothing = ca.SX(0, 1)
    more = [[]] if project is project_fast else []
    result = project(ca.SX(0, 0), nothing, nothing, nothing, *more)  # type: ignore[operator]
    assert result.w.shape == (0, 1)
    assert float(result.failed) == 0.0
