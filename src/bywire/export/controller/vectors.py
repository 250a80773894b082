"""Test vectors: what the Python of a task makes of inputs that reach every limit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bywire.core.parameters import ParameterSet
from bywire.core.signals import ranges_of, signals_of
from bywire.core.typing import Array
from bywire.export.controller.borders import Borders
from bywire.export.controller.contract import LARGEST
from bywire.export.controller.draws import CALM, RELATED, WILD, Draw
from bywire.export.controller.program import Program, Step

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
