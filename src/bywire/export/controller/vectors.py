"""Test vectors: what the Python of a task makes of inputs that reach every limit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import Signal, ranges_of, signals_of
from bywire.core.typing import Array
from bywire.export.controller.borders import Borders
from bywire.export.controller.contract import LARGEST
from bywire.export.controller.program import Program, Step

WILD, CALM, RELATED = tuple(range(10)), (9,) * 20 + tuple(range(10)), (9,) * 5 + (6, 6, 5)
"""kinds of draws: anything, hardly anything unusual, and much that is equal or at a limit"""
_DRIFTS = -5.0, -1.5
"""tenths of the usual size, as powers, by which signals drift in a tick"""
_LEVELS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, -1.0)


class Draw:
    """Draws signals: of their usual size, far beyond it, at limits, equal to each other."""

    def __init__(self, program: Program, rng: np.random.Generator, number: Callable[[float], Any]):
        self.rng, self.number = rng, number
        self.kinds = WILD
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
        return values._replace(**{n: self.number(self.value(signals[n], [])) for n in names})

    def alike(self, values: Any, used: set[str]) -> Any:
        """Return signals of usual size, all of them smaller by about the same factor."""
        cls: Any = type(values)
        factor = float(10.0 ** self.rng.uniform(-2.0, 0.5))
        return values._replace(
            **{
                name: self.number(signal.nominal * factor * self.rng.uniform(0.6, 1.4))
                for name, signal in signals_of(cls).items()
                if name in used
            }
        )

    def drift(self, cls: Any, used: set[str]) -> dict[str, float]:
        """Return how far the signals of a NamedTuple move in a tick: some hardly, some at once."""
        return {
            name: signal.nominal * float(10.0 ** self.rng.uniform(*_DRIFTS) * self.rng.normal())
            for name, signal in signals_of(cls).items()
            if name in used
        }

    def drifted(self, values: Any, drift: Mapping[str, float]) -> Any:
        """Return signals a tick later."""
        return values._replace(
            **{name: self.number(getattr(values, name) + step) for name, step in drift.items()}
        )

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


# --- Vectors

BORDERING = 3
"""of so many vectors one is next to where a comparison turns"""
_MOST_AT_BORDERS = 400
SEGMENT = 40
"""ticks after which a trajectory starts anew"""
_TRIES = 50
_KINDS = ("random", "jumping", "smooth")
"""stretches of vectors, in turns: each drawn anew, few inputs changed at once, all of them drifting
as those of a plant do, which is where derivatives have their usual size"""


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


def vectors(program: Program, memory: Any, count: int, seed: int = 0) -> list[Vectors]:
    """Return test vectors of every task: random ones, trajectories, and borders of comparisons.

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
    draw = Draw(program, np.random.default_rng(seed), number)
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
    drawn = _drawn(program, memory, draw, sets, used, count)
    _filled(rows, drawn, count - min(count // BORDERING, _MOST_AT_BORDERS))
    for step in program.steps:
        every = rows[step.task.name]
        parts = [used[cls] for cls in (model.State, model.Stimulus, model.Memory)]
        every += list(_at_borders(step, every, parts, sets, count - len(every), draw))
    _filled(rows, drawn, count)
    return [_packed(program, step, rows[step.task.name], other) for step in program.steps]


def _filled(rows: dict[str, list[_Row]], drawn: Iterator[tuple[str, _Row]], count: int) -> None:
    """Let every task have so many rows."""
    while any(len(each) < count for each in rows.values()):
        name, row = next(drawn, ("", None))
        if row is None:
            return
        if len(rows[name]) < count:
            rows[name].append(row)


def _drawn(
    program: Program,
    memory: Any,
    draw: Draw,
    sets: Sequence[ParameterSet],
    used: Mapping[Any, set[str]],
    count: int,
) -> Iterator[tuple[str, _Row]]:
    """Yield tasks and what they make of random inputs and, in turns, of trajectories."""
    model, number = program.model, draw.number
    start = type(memory)(*map(number, memory))
    for stretch in range(_TRIES * count):
        kind, which = stretch % len(_KINDS), stretch // len(_KINDS) % 2
        m, x, u = start, *(_nominal(cls, number) for cls in (model.State, model.Stimulus))
        drifts = [draw.drift(type(each), used[type(each)]) for each in (x, u)]
        if _KINDS[kind] == "smooth":
            x, u = draw.alike(x, used[model.State]), draw.alike(u, used[model.Stimulus])
            m = _at_rest(program, x, u, m, sets[which], number)
        for at in range(SEGMENT):
            if _KINDS[kind] == "random":
                pool: dict[str, list[float]] = {}
                draw.kinds = (WILD, CALM, RELATED)[at % 3]
                m, x, u = (
                    draw.tuple(cls, used[cls], pool)
                    for cls in (model.Memory, model.State, model.Stimulus)
                )
            x, u = _inside(x, number), _inside(u, number)
            for step in program.steps:
                after = _ticked(step, x, m, u, sets[which], number)
                if after is None:
                    break
                yield step.task.name, (x, u, m, after, which)
                m = after
            if _KINDS[kind] == "smooth":
                x, u = (draw.drifted(e, drift) for e, drift in zip((x, u), drifts, strict=True))
            else:
                x, u = draw.moved(x, used[model.State]), draw.moved(u, used[model.Stimulus])


def _at_rest(
    program: Program, x: Any, u: Any, m: Any, par: ParameterSet, number: Callable[[float], Any]
) -> Any:
    """Return the memory behind ticks with unchanged inputs: filters have come to rest."""
    for _ in range(SEGMENT):
        for step in program.steps:
            after = _ticked(step, x, m, u, par, number)
            if after is None:
                return m
            m = after
    return m


def _at_borders(
    step: Step,
    rows: list[_Row],
    used: list[set[str]],
    sets: list[ParameterSet],
    count: int,
    draw: Draw,
) -> Iterator[_Row]:
    """Yield vectors next to borders of comparisons, that Python computes."""
    given = 0
    plain = [each.with_leaves({n: float(v) for n, v in each.leaves().items()}) for each in sets]
    begins = [
        (tuple(type(each)(*map(float, each)) for each in row[:3]), plain[row[4]]) for row in rows
    ]
    for inputs, at in Borders(step.task.tick, used, draw.rng).near(begins, count if begins else 0):
        x, u, m = (type(each)(*map(draw.number, each)) for each in inputs)
        after = _ticked(step, x, m, u, sets[rows[at][4]], draw.number)
        if after is not None and given < count:
            given += 1
            yield x, u, m, after, rows[at][4]


def _inside(values: Any, number: Callable[[float], Any]) -> Any:
    """Return signals within their admissible ranges, which a step asks for."""
    cls: Any = type(values)
    return values._replace(
        **{
            name: number(min(max(getattr(values, name), low), high))
            for name, (low, high) in ranges_of(cls).items()
        }
    )


def _is_accepted(values: Any) -> bool:
    cls: Any = type(values)
    ranges = ranges_of(cls).items()
    return all(abs(each) < LARGEST for each in values) and all(
        low <= getattr(values, name) <= high for name, (low, high) in ranges
    )


def _nominal(cls: Any, number: Callable[[float], Any]) -> Any:
    return cls(*(number(each.nominal) for each in signals_of(cls).values()))


def _ticked(
    step: Step, x: Any, m: Any, u: Any, par: ParameterSet, number: Callable[[float], Any]
) -> Any:
    """Return the memory behind a tick; None where Python, or a step, refuses to compute it."""
    if not (_is_accepted(x) and _is_accepted(u)):
        return None
    try:
        with np.errstate(all="ignore"):
            after = step.task.tick(x, m, u, par)
        values = [float(each) for each in after]
    except (ArithmeticError, ValueError):
        return None
    if not all(abs(each) <= 1e30 for each in values):  # nor is what is no number
        return None
    if any(abs(float(getattr(after, name))) >= LARGEST for name in step.kept):
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
    return Vectors(
        step,
        np.array(given).reshape(shape, len(columns)),
        np.array(after).reshape(shape, width),
        tuple(columns),
        kept,
        tuple(row[4] for row in rows),
        other,
    )
