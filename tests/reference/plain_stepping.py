"""The stepping scheme on plain floats: dense matrices, everything enumerated, nothing hoisted.

Runs any ``bywire.core.model.Model``. It shares no code with the engine: derivatives come from
dual numbers, contact sets and signs of frictions from trying all of them, and every state counts
as nonlinear, for which Newton's step gives the same where it is not.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import chain, combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]
Matrix = tuple[tuple[float, ...], ...]


class Dual:
    """A number and its gradient."""

    __slots__ = ("slope", "value")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, value: float, slope: Any) -> None:
        self.value, self.slope = value, slope

    def __add__(self, other: Any) -> Dual:
        v, s = _parts(other)
        return Dual(self.value + v, self.slope + s)

    def __sub__(self, other: Any) -> Dual:
        v, s = _parts(other)
        return Dual(self.value - v, self.slope - s)

    def __rsub__(self, other: Any) -> Dual:
        return Dual(other - self.value, -self.slope)

    def __mul__(self, other: Any) -> Dual:
        v, s = _parts(other)
        return Dual(self.value * v, self.slope * v + self.value * s)

    def __truediv__(self, other: Any) -> Dual:
        v, s = _parts(other)
        return Dual(self.value / v, (self.slope - self.value / v * s) / v)

    def __rtruediv__(self, other: Any) -> Dual:
        return Dual(other / self.value, -other / self.value**2 * self.slope)

    def __neg__(self) -> Dual:
        return Dual(-self.value, -self.slope)

    __radd__, __rmul__ = __add__, __mul__

    def __lt__(self, other: Any) -> bool:
        return bool(self.value < _parts(other)[0])

    def __gt__(self, other: Any) -> bool:
        return bool(self.value > _parts(other)[0])

    def __eq__(self, other: object) -> bool:
        return bool(self.value == _parts(other)[0])

    def _bywire_op(self, name: str, *args: Any) -> Any:
        if name in ("fmax", "fmin"):
            first = (args[0] > args[1]) == (name == "fmax")
            return args[0] if first else args[1]
        x, y = args[0].value, _parts(args[-1])[0]
        value, slope = _ELEMENTARY[name](x, y)
        return Dual(value, slope * args[0].slope)


_ELEMENTARY: dict[str, Callable[[float, float], tuple[float, float]]] = {
    "exp": lambda x, _: (math.exp(x), math.exp(x)),
    "log": lambda x, _: (math.log(x), 1.0 / x),
    "sqrt": lambda x, _: (math.sqrt(x), 0.5 / math.sqrt(x)),
    "sin": lambda x, _: (math.sin(x), math.cos(x)),
    "cos": lambda x, _: (math.cos(x), -math.sin(x)),
    "fabs": lambda x, _: (abs(x), math.copysign(1.0, x)),
    "floor": lambda x, _: (math.floor(x), 0.0),
    "power": lambda x, y: (x**y, y * x ** (y - 1.0)),
}


def _parts(other: Any) -> tuple[float, Any]:
    return (other.value, other.slope) if isinstance(other, Dual) else (other, 0.0)


def differentiate(function: Callable[[list[Any]], Any], at: Array) -> tuple[Array, Array]:
    """Return values and Jacobian of a function of a list, shapes (m,) and (m, n)."""
    n = at.size
    seeds = [Dual(float(v), e) for v, e in zip(at, np.eye(n), strict=True)]
    results = [_parts(r) for r in function(seeds)]
    values = np.array([v for v, _ in results], dtype=float)
    return values, np.array([np.broadcast_to(s, n) for _, s in results]).reshape(-1, n)


@cache
def _stiffnesses(C: Matrix) -> list[tuple[tuple[int, ...], Array]]:
    """Return every subset of the contacts of a group, and K that gives its forces K d."""
    n, all_of = len(C), np.array(C, dtype=float)
    found = []
    for active in chain.from_iterable(combinations(range(n), k) for k in range(n + 1)):
        K, block = np.zeros((n, n)), np.ix_(active, active)
        K[block] = np.linalg.inv(all_of[block])
        found.append((active, K))
    return found


def solve_contacts(C: Matrix, d: Array) -> tuple[tuple[int, ...], Array]:
    """Return the active set of a linear complementarity problem, and K with forces K d."""
    scale, best = np.diag(C), (-math.inf, (), np.zeros(0))
    for active, K in _stiffnesses(C):
        F = K @ d
        slack = (C @ F - d) / scale
        slack[list(active)] = F[list(active)]
        if slack.min() > best[0]:
            best = (slack.min(), active, K)
    return best[1], best[2]


def solve_signs(S: Array, c: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Return (w, b) of ``S w = c + b``: b is low where w > 0, high where w < 0, else between.

    Where both bounds are one, b is that.
    """
    found, least = (np.zeros(c.size), -c), math.inf
    for signs in product((0, 1, -1), repeat=c.size):
        sign = np.array(signs)
        moving = np.flatnonzero(sign)
        b, w = np.where(sign > 0, low, high), np.zeros(c.size)
        if not np.all(np.isfinite(b[moving])):
            continue
        w[moving] = np.linalg.solve(S[np.ix_(moving, moving)], (c + b)[moving])
        b = np.where(sign == 0, S @ w - c, b)
        # Where both bounds are one, that is the force, whatever the sign.
        wrong = np.where(low < high, np.maximum(-sign * w, 0.0) * np.diag(S), 0.0)
        wrong += np.where(sign == 0, np.maximum(low - b, 0.0) + np.maximum(b - high, 0.0), 0.0)
        if np.max(wrong, initial=0.0) < least:
            found, least = (w, b), np.max(wrong, initial=0.0)
        if least == 0.0:
            break
    return found


@dataclass
class Point:
    """Where a run stands: state, increment, memory, reactions, integrals."""

    x: Array
    d: Array
    m: Any
    r: Array
    q: Array
    unsettled: int = 0
    repeated: int = 0


@dataclass
class Part:
    """What a step of any length gives: as in ``Point``, and the rates of the integrals.

    ``jump``: by how much each friction would change an increment if it turned round.
    """

    x: Array
    d: Array
    r: Array
    flow: Array
    jump: dict[int, float]
    passes: int
    settled: bool


def substep(model: Any, par: Any, at: Point, h: float, cap: int) -> None:
    """Advance by one substep, in place; ``cap`` = 1 leaves out the check of the contact sets.

    It is cut where a velocity with dry friction passes zero.
    """
    rubs = [model.State._fields.index(n) for n in model.frictions]
    rate, left, cuts, passes, settled = at.d / h, h, 0, 0, True
    while True:
        new = _part(model, par, at, rate * left, left, cap)
        passes += new.passes
        turned = [k for k in rubs if at.x[k] * new.x[k] < 0.0]
        if not turned:
            break

        def velocity(t: float, k: int, rate: Array = rate) -> float:
            return float(_part(model, par, at, rate * t, t, cap).x[k] if t else at.x[k])

        roots = [brentq(velocity, 0.0, left, (k,), xtol=1e-20, rtol=1e-15) for k in turned]
        t, k = min(zip(roots, turned, strict=True))
        new = _part(model, par, at, rate * t, t, cap)
        at.x, rate, at.q = new.x, new.d / t, at.q + t / h * new.flow
        at.x[k] = 0.0
        rate[k] = math.copysign(max(abs(rate[k]) - new.jump[k] / t, 0.0), rate[k])
        left, cuts = left - t, cuts + 1
        settled &= new.settled
    at.unsettled += int(cap > 1 and not (settled and new.settled))
    # The engine's ordinary pass keeps at rest what rests, but for a friction that is alone.
    freed = len(rubs) > 1 and any(at.x[k] == 0.0 != new.x[k] for k in rubs)
    at.repeated += int(passes > 1 or cuts > 0 or freed)
    at.x, at.d, at.r, at.q = new.x, new.d * (h / left), new.r, at.q + left / h * new.flow


def _part(model: Any, par: Any, at: Point, predicted: Array, h: float, cap: int) -> Part:
    held = [model.State._fields.index(n) for n in (*model.frictions, *model.limits)]
    passes = 0
    while True:
        passes += 1
        y = at.x + 0.5 * predicted
        before, K = _contacts(model, par, y)

        def force(x: Any, K: Array = K, y: Array = y) -> tuple[Any, ...]:
            gap = list(chain.from_iterable(model.gap(model.State(*x), model.State(*y), par)))
            return tuple(sum((k * g for k, g in zip(row, gap, strict=True)), 0.0) for row in K)

        def right(x: Any, force: Any = force, y: Array = y) -> Any:
            state, fixed = model.State(*x), model.State(*map(float, y))
            return model.balance(state, fixed, at.m, par, force(x))

        state = model.State(*map(float, y))
        f, J = differentiate(right, y)
        masses = np.array(model.mass(state, par), dtype=float)
        A = np.diag(masses) - 0.5 * h * J
        r = h * (f - 0.5 * J @ predicted)
        bounds = model.bounds(state, state, at.m, par, tuple(map(float, force(y))))
        bounds = [(min(lo, 0.0), max(hi, 0.0)) for lo, hi in bounds]
        jump = {k: h * (hi - lo) / masses[k] for k, (lo, hi) in zip(held, bounds, strict=False)}
        for n, k in enumerate(held[: len(bounds)]):  # a velocity keeps the sign that it has
            lo, hi = bounds[n]
            bounds[n] = (hi if at.x[k] < 0.0 else lo, lo if at.x[k] > 0.0 else hi)
        low, high = np.array([*bounds, *((0.0, math.inf) for _ in model.limits)]).reshape(-1, 2).T
        inverse = np.linalg.inv(A)
        S = np.linalg.inv(inverse[np.ix_(held, held)])
        c = S @ (at.x + inverse @ r)[held]
        w, b = solve_signs(S, c, h * low, h * high)
        reaction = b / h
        d = inverse @ r
        d += inverse[:, held] @ (h * reaction)
        d[held] = w - at.x[held]
        middle = at.x + 0.5 * d
        settled = _contacts(model, par, middle)[0] == before
        if passes == cap or settled:
            break
        predicted = d
    F = np.array(force(middle), dtype=float)
    args = [model.State(*map(float, v)) for v in (middle, y, d / h)]
    flow = np.array(model.powers(*args, at.m, par, tuple(F), tuple(reaction)), dtype=float)
    x = at.x + d
    x[held] = w
    return Part(x, d, reaction, flow, jump, passes, settled)


def _contacts(model: Any, par: Any, x: Array) -> tuple[tuple[tuple[int, ...], ...], Array]:
    """Return the active sets of all groups at a state, and their stiffness, block diagonal."""
    state = model.State(*map(float, x))
    every = zip(model.compliance(par), model.gap(state, state, par), strict=True)
    groups = [(C, d) for C, d in every if C]
    sets = [solve_contacts(C, np.array(d, dtype=float)) for C, d in groups]
    n, at = sum(len(d) for _, d in groups), 0
    K = np.zeros((n, n))
    for _, block in sets:
        K[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    return tuple(active for active, _ in sets), K


def simulate(
    model: Any,
    par: Any,
    start: tuple[Any, Any],
    stimulus: Callable[[Array], Array],
    duration: float,
    step: float,
    record: float,
    cap: int = 8,
) -> tuple[Array, Point]:
    """Run a model from (state, memory): recorded outputs, shape (rows, signals), and the end."""
    every = [(task, round(task.period / step)) for task in model.tasks(par)]
    fastest = min(period for _, period in every)
    recorded, total = round(record / step), round(duration / step)
    reactions = np.zeros(len(model.frictions + model.limits))
    x = np.array(start[0], dtype=float)
    at = Point(x, 0.0 * x, start[1], reactions, np.zeros(len(model.Flow._fields)))
    rows = []
    for k in range(total + 1):
        u = stimulus(np.array([k // fastest * fastest * step]))[0]
        state = model.State(*map(float, at.x))
        for task, period in every:
            if k % period == 0:
                at.m = task.tick(state, at.m, model.Stimulus(*map(float, u)), par)
        if k % recorded == 0:
            flow = model.Flow(*(step * at.q))
            gaps = list(chain.from_iterable(model.gap(state, state, par)))
            F = tuple(_contacts(model, par, at.x)[1] @ np.array(gaps, dtype=float))
            out = model.output(state, at.m, par, F, tuple(at.r), flow)
            rows.append([float(v) for v in out])
        if k < total:
            substep(model, par, at, step, cap)
    return np.array(rows), at
