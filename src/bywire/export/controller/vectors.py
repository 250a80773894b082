"""Test vectors: what the Python of a task makes of inputs that reach every limit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bywire.core.model import Task
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import Signal, signals_of
from bywire.core.typing import Array
from bywire.export.controller.program import Program, Step

SEGMENT = 40
"""ticks after which a trajectory starts anew"""
_TRIES = 50
_WILD, _CALM, _RELATED = tuple(range(10)), (9,) * 20 + tuple(range(10)), (9,) * 5 + (6, 6, 5)
"""kinds of draws: anything, hardly anything unusual, and much that is equal or at a limit"""
_LEVELS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, -1.0)


@dataclass(frozen=True)
class Vectors:
    """Inputs of a task and what it makes of them.

    Parameters
    ----------
    given, after
        Shape (vectors, fields): plant, stimulus and memory in the order of ``names``; the memory
        behind the tick.
    names
        Kind (``x``, ``u``, ``memory``) and field of every column of ``given``.
    kept
        Fields of the columns of ``after``.
    which
        Shape (vectors,): 0 with the parameters of the bench, 1 with ``other``.
    """

    step: Step
    given: Array
    after: Array
    names: tuple[tuple[str, str], ...]
    kept: tuple[str, ...]
    which: tuple[int, ...]
    other: ParameterSet


_Row = tuple[Any, Any, Any, Any, int]


class _Draw:
    """Draws signals: of their usual size, far beyond it, at limits, equal to each other."""

    def __init__(self, program: Program, rng: np.random.Generator, number: Callable[[float], Any]):
        self.rng, self.number = rng, number
        self.kinds = _WILD
        leaves, units = program.par.leaves(), leaf_fields(type(program.par))
        self.limits: dict[str, list[float]] = {}
        read = {name for name, _ in program.parameters()}
        for name, value in leaves.items():
            group = name if name in units else name.rpartition(".")[0]
            if group in read:
                self.limits.setdefault(units[group].unit.symbol, []).append(value)

    def value(self, signal: Signal, others: list[float]) -> float:
        """Return a value of a signal; ``others``: those of its unit that are drawn already."""
        rng, nominal = self.rng, signal.nominal
        kind = int(rng.choice(self.kinds))
        if kind == 5 and signal.unit in self.limits:
            limits = self.limits[signal.unit]
            return float(rng.choice(limits) * rng.choice((1.0, 1.0, 1.0, -1.0, 0.5, 1.001, 0.999)))
        if kind == 6 and others:
            return float(rng.choice(others) * rng.choice((1.0, 1.0, 1.001, 0.999, 0.9)))
        if kind in (0, 3, 7) and signal.unit == "1":
            return float(rng.choice(_LEVELS))
        if kind < 3:
            return nominal * float(rng.uniform(-1.5, 3.0))
        if kind < 5:
            return nominal * float(10.0 ** rng.uniform(-3.0, 1.5) * rng.choice((-1.0, 1.0)))
        return 0.0 if kind == 8 else nominal * float(rng.uniform(0.0, 1.0))

    def tuple(self, cls: Any, used: set[str], pool: dict[str, list[float]]) -> Any:
        """Return signals of a NamedTuple; those that nobody reads have their usual size.

        ``pool``: values by unit that stand beside them, and to which these are added.
        """
        values: list[Any] = []
        for name, signal in signals_of(cls).items():
            drawn = signal.nominal
            if name in used:
                drawn = self.value(signal, pool.setdefault(signal.unit, []))
                pool[signal.unit].append(drawn)
            values.append(self.number(drawn))
        return cls(*values)

    def moved(self, values: Any, used: set[str]) -> Any:
        """Return signals with few of them changed."""
        cls: Any = type(values)
        signals = signals_of(cls)
        names = [n for n in sorted(used) if self.rng.random() < 2.0 / max(len(used), 1)]
        return values._replace(**{
            n: self.number(self.value(signals[n], [])) for n in names
        })  # fmt: skip

    def parameters(self, par: ParameterSet) -> ParameterSet:
        """Return parameters with all numbers changed, tables by a factor, within their ranges."""
        leaves = leaf_fields(type(par))
        factors: dict[str, float] = {}
        values: dict[str, float] = {}
        for name, value in par.leaves().items():
            group = name if name in leaves else name.rpartition(".")[0]
            leaf = leaves[group]
            factor = factors.setdefault(group, float(self.rng.uniform(0.75, 1.25)))
            wanted = value * factor if value else 0.2 * factor * leaf.unit.nominal
            if not leaf.low <= wanted <= leaf.high:
                wanted = value / factor
            inside = min(max(wanted, leaf.low), leaf.high)
            is_open = (inside == leaf.low and leaf.low_open) or (
                inside == leaf.high and leaf.high_open
            )
            values[name] = value if is_open else inside
        return par.with_leaves(values)


def vectors(program: Program, memory: Any, count: int, seed: int = 0) -> list[Vectors]:
    """Return test vectors of every task, half of them along trajectories.

    Every other stretch goes with other parameters: those of the bench may switch terms off.

    Parameters
    ----------
    memory
        With which trajectories begin.
    count
        Vectors of each task.
    seed
        Of what is drawn.
    """
    number: Callable[[float], Any] = np.float32 if program.precision.name == "single" else float
    draw = _Draw(program, np.random.default_rng(seed), number)
    other = draw.parameters(program.par)
    sets = [
        each.with_leaves({n: number(v) for n, v in each.leaves().items()})
        for each in (program.par, other)
    ]
    rows: dict[str, list[_Row]] = {each.task.name: [] for each in program.steps}
    model = program.model
    used = {
        cls: {each.name for each in program.members(cls)}
        for cls in (model.State, model.Stimulus, model.Memory)
    }
    start = type(memory)(*map(number, memory))
    for stretch in range(_TRIES * count):
        if all(len(each) >= count for each in rows.values()):
            break
        is_random, which = stretch % 2 == 0, stretch // 2 % 2
        m, x, u = start, *(_nominal(cls, number) for cls in (model.State, model.Stimulus))
        for at in range(SEGMENT):
            if is_random:
                pool: dict[str, list[float]] = {}
                draw.kinds = (_WILD, _CALM, _RELATED)[at % 3]
                m, x, u = (
                    draw.tuple(cls, used[cls], pool)
                    for cls in (model.Memory, model.State, model.Stimulus)
                )
            for step in program.steps:
                name = step.task.name
                after = _ticked(step.task, x, m, u, sets[which], number)
                if after is None:
                    break
                if len(rows[name]) < count:
                    rows[name].append((x, u, m, after, which))
                m = after
            x, u = draw.moved(x, used[model.State]), draw.moved(u, used[model.Stimulus])
    return [_packed(program, step, rows[step.task.name], other) for step in program.steps]


def _nominal(cls: Any, number: Callable[[float], Any]) -> Any:
    return cls(*(number(each.nominal) for each in signals_of(cls).values()))


def _ticked(
    task: Task, x: Any, m: Any, u: Any, par: ParameterSet, number: Callable[[float], Any]
) -> Any:
    """Return the memory behind a tick; None where Python refuses to compute it."""
    try:
        with np.errstate(all="ignore"):
            after = task.tick(x, m, u, par)
        values = [float(each) for each in after]
    except (ArithmeticError, ValueError):
        return None
    if not all(map(math.isfinite, values)) or any(abs(v) > 1e30 for v in values):
        return None
    return type(after)(*map(number, values))


def _packed(program: Program, step: Step, rows: list[_Row], other: ParameterSet) -> Vectors:
    model = program.model
    columns = [("x", each.name) for each in program.members(model.State)]
    columns += [("u", each.name) for each in program.members(model.Stimulus)]
    kept = tuple(each.name for each in program.members(model.Memory))
    columns += [("memory", name) for name in kept]
    at = {"x": 0, "u": 1, "memory": 2}
    given = [[float(getattr(row[at[kind]], name)) for kind, name in columns] for row in rows]
    after = [[float(getattr(row[3], name)) for name in kept] for row in rows]
    shape, width = len(rows), len(kept)
    return Vectors(step, np.array(given).reshape(shape, len(columns)),
                   np.array(after).reshape(shape, width), tuple(columns), kept,
                   tuple(row[4] for row in rows), other)  # fmt: skip
