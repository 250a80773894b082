"""Test vectors: a task's results in Python for inputs at every limit and boundary.

Random inputs rarely equal a limit to the last digit, where ``<`` and ``<=`` differ, and rarely come
close enough to reveal a wrong limit. The search therefore runs a tick on numbers that record every
comparison and the distance of its two sides. It changes one input until the result of a comparison
changes, and then finds the boundary in between. It continues from this boundary, because some
limits apply only beyond another rare limit.
"""

from __future__ import annotations

import math
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import FrameType
from typing import Any

import numpy as np

from bywire.core import ops
from bywire.core.parameters import ParameterSet, leaf_fields
from bywire.core.signals import Signal, ranges_of, signals_of
from bywire.core.typing import Array
from bywire.export.controller.contract import LARGEST
from bywire.export.controller.program import Program, Step

_Place = tuple[Any, ...]
"""call stack of a comparison, innermost location first; ``core.ops`` is treated as one location"""
Margins = dict[_Place, float]
"""distance of the two sides of each comparison"""
_LESS = ("__lt__", "__ge__")

_now = threading.local()
"""``margins``: margins of this thread's current tick"""


class Traced(float):
    """A float that records its comparisons and those of all results computed from it."""

    __slots__ = ()
    __hash__ = float.__hash__


def _comparing(name: str) -> Callable[[Traced, Any], Any]:
    plain = getattr(float, name)

    def compare(self: Traced, other: Any) -> Any:
        if isinstance(other, (float, int)):
            # This margin is positive for one result only; equal sides have the other result.
            apart = float(self) - float(other)
            _now.margins[_place(sys._getframe(1))] = -apart if name in _LESS else apart
        return plain(self, other)

    return compare


def _place(frame: FrameType | None) -> _Place:
    inside: list[int] = []
    while frame is not None and frame.f_code.co_filename == ops.__file__:
        inside.append(frame.f_lasti)
        frame = frame.f_back
    places: list[Any] = [tuple(inside)]
    while frame is not None and frame.f_code is not _BEGIN:
        places.append(frame.f_lasti)
        frame = frame.f_back
    return tuple(places)


def _computing(name: str) -> Callable[..., Any]:
    plain = getattr(float, name)

    def compute(self: Traced, *others: Any) -> Any:
        result = plain(self, *others)
        return Traced(result) if isinstance(result, float) else result

    return compute


for _name in ("lt", "le", "gt", "ge", "eq", "ne"):
    setattr(Traced, f"__{_name}__", _comparing(f"__{_name}__"))
for _name in (
    "add",
    "radd",
    "sub",
    "rsub",
    "mul",
    "rmul",
    "truediv",
    "rtruediv",
    "neg",
    "pos",
    "abs",
    "pow",
):
    setattr(Traced, f"__{_name}__", _computing(f"__{_name}__"))


def margins(tick: Callable[..., Any], inputs: tuple[Any, Any, Any], par: Any) -> Margins:
    """Return the margin of every comparison in a tick; empty if the tick fails.

    Parameters
    ----------
    tick
        ``tick(x, m, u, par) -> memory``.
    inputs
        Plant, stimulus and memory.
    """
    x, u, m = (type(each)(*map(Traced, each)) for each in inputs)
    _now.margins = {}
    try:
        with np.errstate(all="ignore"):  # single-precision numbers warn instead of raising
            tick(x, m, u, par)
    except (ArithmeticError, ValueError):
        return {}
    noted: Margins = _now.margins
    return noted


_BEGIN = margins.__code__
"""outermost location of a law; calls outside it are not part of the law"""


# --- Boundary of a comparison as an input of a tick changes

Inputs = tuple[Any, Any, Any]
"""plant, stimulus and memory of a tick"""
_Field = tuple[int, str]
"""an input: index of plant, stimulus or memory, and name"""
_STEPS, _JUMP = 60, 1e-7


def _value_of(inputs: Inputs, field: _Field) -> float:
    """Return the value of an input."""
    return float(getattr(inputs[field[0]], field[1]))


def changed(inputs: Inputs, changes: Iterable[tuple[_Field, float]]) -> Inputs:
    """Return the inputs with some values changed."""
    parts = list(inputs)
    for (part, name), value in changes:
        parts[part] = parts[part]._replace(**{name: value})
    return tuple(parts)


@dataclass(frozen=True)
class Border:
    """Inputs on both sides of a comparison's boundary, and whether one gives equal sides."""

    above: Inputs
    below: Inputs
    is_met: bool

    def changed(self, field: _Field, value: float) -> Border:
        """Return the inputs on both sides with another input changed, assuming equal sides."""
        above, below = (changed(each, [(field, value)]) for each in (self.above, self.below))
        return Border(above, below, is_met=True)


@dataclass(frozen=True)
class Turn:
    """A comparison of a tick as a function of one input.

    Parameters
    ----------
    tick
        ``tick(x, m, u, par) -> memory``.
    place
        Location of the comparison.
    field
        The input.
    """

    tick: Callable[..., Any]
    par: Any
    place: _Place
    field: _Field

    def margins(self, inputs: Inputs, value: float) -> Margins:
        """Return the margins of all comparisons for a value of the input."""
        return margins(self.tick, changed(inputs, [(self.field, value)]), self.par)

    def margin(self, inputs: Inputs, value: float) -> float:
        """Return the comparison's margin; NaN if the tick does not reach the comparison."""
        return self.margins(inputs, value).get(self.place, math.nan)

    def border(
        self, inputs: Inputs, first: tuple[float, float], last: tuple[float, float]
    ) -> Border:
        """Return the comparison's boundary between two values with their margins."""
        ends = _turning_point(lambda value: self.margin(inputs, value), first, last)
        above, below = (changed(inputs, [(self.field, value)]) for value, _ in ends)
        return Border(above, below, ends[1][1] == 0.0)

    def is_at(self, border: Border) -> bool:
        """Return whether the comparison's result changes at the boundary."""
        above, below = (
            margins(self.tick, each, self.par).get(self.place, 0.0)
            for each in (border.above, border.below)
        )
        return above > 0.0 >= below and (below == 0.0 or not border.is_met)

    def is_seen(self, border: Border) -> bool:
        """Return whether the memory jumps at the boundary."""
        try:
            with np.errstate(all="ignore"):
                first, last = (
                    list(self.tick(x, m, u, self.par)) for x, u, m in (border.above, border.below)
                )
        except (ArithmeticError, ValueError):
            return False
        with np.errstate(all="ignore"):  # both may be infinite
            return any(
                abs(a - b) > _JUMP * (abs(a) + abs(b)) for a, b in zip(first, last, strict=True)
            )


def _turning_point(
    margin: Callable[[float], float], first: tuple[float, float], last: tuple[float, float]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return two adjacent numbers between which a margin changes sign.

    Parameters
    ----------
    margin
        Margin as a function of a number; NaN if the tick does not reach the comparison.
    first, last
        Numbers with their margins, one of which is above zero.

    Returns
    -------
    tuple
        The number with the positive margin, and the other number, with their margins.
    """
    above, below = (first, last) if first[1] > 0.0 else (last, first)
    for step in range(_STEPS):
        middle = 0.5 * above[0] + 0.5 * below[0]
        if middle in (above[0], below[0]):
            break
        if step % 3 < 2 and math.isfinite(above[1] - below[1]):
            middle = _guessed(above, below, middle, is_beyond=step % 3 == 1)
        at = margin(middle)
        if math.isnan(at):
            break
        if at > 0.0:
            above = middle, at
        else:
            below = middle, at
    return above, below


def _guessed(
    above: tuple[float, float], below: tuple[float, float], middle: float, is_beyond: bool
) -> float:
    """Return the zero of a straight line, or a number next to the end with the smaller margin."""
    (a, at_a), (b, at_b) = above, below
    guess = b - at_b * (a - b) / (at_a - at_b)
    if is_beyond or at_b == 0.0:
        end, other = (b, a) if abs(at_b) <= abs(at_a) else (a, b)
        ulps = 1.0 if at_b == 0.0 else 4.0
        guess = end + math.copysign(ulps * math.ulp(end), other - end)
    return guess if min(a, b) < guess < max(a, b) else middle


# --- Inputs next to boundaries

_LAW = 3
"""number of innermost locations that identify a law, whatever calls it"""
_BORDER_TRIES, _CONTEXTS, _NEAR_BY, _SMALL = 4, 40, 3, 1e-6
_AT_ONCE, _ENOUGH, _UNSEEN, _MET = 2, 6, 2, 2
"""comparisons per change; saved boundaries per comparison, of which some have no visible effect on
the memory, and some have equal sides"""
_BEYOND, _FAR = 1.01, 1e3
"""distance of the aim beyond a boundary, and maximum growth of an input, both as factors"""
_ULPS = (1, -1, 2, -2, 3, -3, 5, -5, 8, -8)
_LATEST = 200
"""number of boundaries from which the search continues"""


class Borders:
    """Search for inputs of a task next to the boundaries of its comparisons.

    Parameters
    ----------
    tick
        ``tick(x, m, u, par) -> memory``.
    used
        Fields of plant, stimulus and memory that the task reads.
    """

    def __init__(
        self, tick: Callable[..., Any], used: Sequence[set[str]], rng: np.random.Generator
    ) -> None:
        self.tick, self.rng = tick, rng
        self.fields = [(part, name) for part, names in enumerate(used) for name in sorted(names)]
        self.rows: list[Inputs] = []
        self.reached: list[tuple[Inputs, int]] = []
        self.shown: Counter[_Place] = Counter()
        self.met: Counter[_Place] = Counter()
        self.unseen: Counter[_Place] = Counter()
        self.sides: dict[_Place, list[_Field]] = {}

    def near(self, rows: Sequence[tuple[Inputs, Any]], wanted: int) -> Iterator[tuple[Inputs, int]]:
        """Yield inputs on both sides of boundaries, with the index of their initial row.

        Parameters
        ----------
        rows
            Initial inputs and parameters of the search.
        wanted
            Approximate number of inputs. Comparisons that are rarely reached come first.
        """
        self.rows = [inputs for inputs, _ in rows]
        self.reached = [(inputs, at) for at, inputs in enumerate(self.rows)]
        given = 0
        for _ in range(_BORDER_TRIES * wanted):
            if given >= wanted or not self.fields:
                return
            at = self._any(len(rows))
            inputs = rows[at][0]
            if given and self.rng.random() < 0.5:
                inputs, at = self.reached[-1 - self._any(min(given, _LATEST))]
            for border in self._turned(inputs, rows[at][1]):
                for side in (border.above, border.below):
                    given += 1
                    self.reached.append((side, at))
                    yield side, at

    def _any(self, count: int) -> int:
        return int(self.rng.integers(count))

    def _another(self, inputs: Inputs, field: _Field) -> float:
        """Return another value of an input: another input's value, zero, or a changed value."""
        others = self.rows[self._any(len(self.rows))]
        before = _value_of(inputs, field)
        values = (_value_of(others, field), 0.0, -before, 3.0 * before)
        return values[max(int(self.rng.integers(-3, 4)), 0)]

    def _turned(self, inputs: Inputs, par: Any) -> Iterator[Border]:
        """Yield boundaries of the rarest comparisons that change with an input."""
        along = Turn(self.tick, par, (), self.fields[self._any(len(self.fields))])
        at, to = _value_of(inputs, along.field), self._another(inputs, along.field)
        here, there = (along.margins(inputs, value) for value in (at, to))
        ends = [(to, there)]
        ends += [(v, along.margins(inputs, v)) for v in self._aimed((at, here), (to, there))]
        turning: dict[_Place, tuple[float, float]] = {}
        for value, last in ends:
            for place in here.keys() & last.keys():
                if (here[place] > 0.0) != (last[place] > 0.0):
                    turning.setdefault(place, (value, last[place]))
        for place in sorted(turning, key=self._rank)[:_AT_ONCE]:
            if self._rank(place)[0] >= _ENOUGH:
                return
            turn = replace(along, place=place)
            border = turn.border(inputs, (at, here[place]), turning[place])
            shown = border if turn.is_seen(border) else self._elsewhere(turn, border)
            if self._is_worth(place[:_LAW], shown):
                yield self._met(turn, shown) if shown is not None else border

    def _is_worth(self, law: _Place, shown: Border | None) -> bool:
        """Count a boundary, and return whether to save it."""
        self.shown[law] += int(shown is not None)
        self.unseen[law] += int(shown is None)
        return shown is not None or self.unseen[law] <= _UNSEEN

    def _aimed(self, first: tuple[float, Margins], last: tuple[float, Margins]) -> Iterator[float]:
        """Yield a value at which the rarest comparison that depends on an input changes."""
        (at, here), (to, there) = first, last
        for place in sorted(here.keys() & there.keys(), key=self._rank):
            moves = there[place] - here[place]
            if moves == 0.0 or not math.isfinite(moves):
                continue
            value = at - _BEYOND * here[place] * (to - at) / moves
            if abs(value) <= _FAR * (abs(at) + abs(to)):
                yield value
                return

    def _rank(self, place: _Place) -> tuple[float, _Place]:
        """Return the sort key of a comparison: the number of times that it has been reached."""
        law = place[:_LAW]
        return self.met[law] + self.shown[law] / 3 + self.unseen[law] / 10, place

    def _met(self, turn: Turn, border: Border) -> Border:
        """Return a boundary with equal sides, if the last digits of the inputs allow it.

        The resolution of one input may be too coarse for equal sides.
        """
        law = turn.place[:_LAW]
        if not border.is_met and self.met[law] < _MET:
            border = next(self._nudged(turn, border), border)
        self.met[law] += int(border.is_met)
        return border

    def _nudged(self, turn: Turn, border: Border) -> Iterator[Border]:
        law = turn.place[:_LAW]
        if law not in self.sides:
            self.sides[law] = list(self._sides(turn, border.below))
        for field in self.sides[law]:
            at = _value_of(border.below, field)
            for ulps in () if field == turn.field else _ULPS:
                nudged = border.changed(field, at + ulps * math.ulp(at))
                if turn.is_at(nudged) and turn.is_seen(nudged):
                    yield nudged

    def _sides(self, turn: Turn, inputs: Inputs) -> Iterator[_Field]:
        """Yield the inputs that affect a comparison."""
        before = margins(self.tick, inputs, turn.par).get(turn.place)
        for field in self.fields:
            value = _value_of(inputs, field) * (1.0 + _SMALL) + _SMALL
            moved = changed(inputs, [(field, value)])
            if margins(self.tick, moved, turn.par).get(turn.place) != before:
                yield field

    def _elsewhere(self, turn: Turn, border: Border) -> Border | None:
        """Return a boundary of the same comparison that has a visible effect, or None."""
        above, below = (_value_of(each, turn.field) for each in (border.above, border.below))
        for count in range(_CONTEXTS):  # at the same boundary, where the effect may be hidden
            inputs = border.above
            if count % 2:
                inputs = self.reached[self._any(len(self.reached))][0]
            inputs = changed(inputs, self._changes(inputs, turn.field) if count % 4 < 2 else ())
            high, low = (changed(inputs, [(turn.field, value)]) for value in (above, below))
            moved = Border(high, low, border.is_met)
            if turn.is_seen(moved) and turn.is_at(moved):
                return moved
        apart = 1e-3 * (2.0 * abs(above) + 1e-3)
        for _ in range(_NEAR_BY):  # at other values of the inputs that affect the comparison
            inputs = changed(border.above, self._changes(border.above, turn.field))
            first, last = ((v, turn.margin(inputs, v)) for v in (above - apart, above + apart))
            if (first[1] > 0.0) != (last[1] > 0.0) and math.isfinite(first[1] - last[1]):
                moved = turn.border(inputs, first, last)
                if turn.is_seen(moved):
                    return moved
        return None

    def _changes(self, inputs: Inputs, but: _Field) -> Iterator[tuple[_Field, float]]:
        """Yield other values of some inputs."""
        for _ in range(int(self.rng.integers(1, 4))):
            field = self.fields[self._any(len(self.fields))]
            if field != but:
                yield field, self._another(inputs, field)


# --- Vectors

WILD, CALM, RELATED = tuple(range(10)), (9,) * 20 + tuple(range(10)), (9,) * 5 + (6, 6, 5)
"""kinds of draws: arbitrary, usually of normal size, and often equal or at a limit"""
_DRIFTS = -5.0, -1.5
"""drift of signals per tick, as exponents of ten relative to the usual size"""
_LEVELS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, -1.0)


class Draw:
    """Random signals: of usual size, far beyond it, at limits, or equal to each other."""

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
        """Return a value of a signal; ``others``: earlier values with the same unit."""
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
        """Return signals of a NamedTuple; unused signals have their usual size.

        ``pool``: earlier values by unit. This method adds its values.
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
        """Return the signals with a few of them changed."""
        cls: Any = type(values)
        signals = signals_of(cls)
        names = [n for n in sorted(used) if self.rng.random() < 2.0 / max(len(used), 1)]
        return values._replace(**{n: self.number(self.value(signals[n], [])) for n in names})

    def alike(self, values: Any, used: set[str]) -> Any:
        """Return signals of usual size, all scaled down by about the same factor."""
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
        """Return the change of each signal of a NamedTuple per tick; some are slow, some fast."""
        return {
            name: signal.nominal * float(10.0 ** self.rng.uniform(*_DRIFTS) * self.rng.normal())
            for name, signal in signals_of(cls).items()
            if name in used
        }

    def drifted(self, values: Any, drift: Mapping[str, float]) -> Any:
        """Return the signals one tick later."""
        return values._replace(
            **{name: self.number(getattr(values, name) + step) for name, step in drift.items()}
        )

    def parameters(self, par: ParameterSet) -> ParameterSet:
        """Return parameters with all numbers changed within their ranges; tables are scaled."""
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

_BORDERING = 3
"""one of this many vectors is next to a boundary"""
_MOST_AT_BORDERS = 400
_SEGMENT = 40
"""length of a trajectory in ticks"""
_TRIES = 50
_KINDS = ("random", "jumping", "smooth")
"""kinds of consecutive vectors, in turn: independent, with few changes, and with all inputs
drifting like a plant's signals, so that derivatives have their usual size"""


@dataclass(frozen=True)
class Vectors:
    """Inputs and results of a task.

    Parameters
    ----------
    given, after
        Shape (vectors, fields): plant, stimulus and memory in the order of ``names``, and the
        memory after the tick.
    names
        Kind (``x``, ``u``, ``memory``) and field of every column of ``given``.
    kept
        Fields of the columns of ``after``.
    which
        Shape (vectors,): 0 for the bench's parameters, 1 for ``other``.
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
    """Return each task's test vectors: random inputs, trajectories, boundaries of comparisons.

    Every second sequence has other parameters, because the bench's may switch terms off.

    Parameters
    ----------
    memory
        Initial memory of trajectories.
    count
        Vectors of each task.
    seed
        Seed of the random numbers.
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
    _filled(rows, drawn, count - min(count // _BORDERING, _MOST_AT_BORDERS))
    for step in program.steps:
        every = rows[step.task.name]
        parts = [used[cls] for cls in (model.State, model.Stimulus, model.Memory)]
        every += list(_at_borders(step, every, parts, sets, count - len(every), draw))
    _filled(rows, drawn, count)
    return [_packed(program, step, rows[step.task.name], other) for step in program.steps]


def _filled(rows: dict[str, list[_Row]], drawn: Iterator[tuple[str, _Row]], count: int) -> None:
    """Fill the rows of every task up to this number."""
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
    """Yield tasks and their results, alternately for random inputs and along trajectories."""
    model, number = program.model, draw.number
    start = type(memory)(*map(number, memory))
    for stretch in range(_TRIES * count):
        kind, which = stretch % len(_KINDS), stretch // len(_KINDS) % 2
        m, x, u = start, *(_nominal(cls, number) for cls in (model.State, model.Stimulus))
        drifts = [draw.drift(type(each), used[type(each)]) for each in (x, u)]
        if _KINDS[kind] == "smooth":
            x, u = draw.alike(x, used[model.State]), draw.alike(u, used[model.Stimulus])
            m = _at_rest(program, x, u, m, sets[which], number)
        for at in range(_SEGMENT):
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
    """Return the memory after enough ticks with constant inputs for filters to settle."""
    for _ in range(_SEGMENT):
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
    """Yield vectors next to boundaries of comparisons, with Python's results."""
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
    """Return the signals, limited to their valid ranges, which a step requires."""
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
    """Return the memory after a tick; None if Python or a step rejects the inputs."""
    if not (_is_accepted(x) and _is_accepted(u)):
        return None
    try:
        with np.errstate(all="ignore"):
            after = step.task.tick(x, m, u, par)
        values = [float(each) for each in after]
    except (ArithmeticError, ValueError):
        return None
    if not all(abs(each) <= 1e30 for each in values):  # NaN fails this, too
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
