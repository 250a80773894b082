"""Test vectors next to borders: inputs at which a comparison of the laws is about to turn.

Random inputs hardly ever meet a limit to the last digit, where ``<`` and ``<=`` differ, nor come
so close to it that another limit shows. A tick is run on numbers that note every comparison that
they take part in, and how far its sides are apart. One input is changed until a comparison turns;
in between the place is sought where it does.
"""

from __future__ import annotations

import math
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

Inputs = tuple[Any, Any, Any]
"""plant, stimulus and memory of a tick"""
Margins = dict[tuple[int, ...], float]
"""how far the sides of comparisons are apart, by the places in the code that lead there"""
_HALVINGS, _JUMP, _TRIES = 24, 1e-7, 2
_CONTEXTS = 3
_AT_ONCE, _ENOUGH, _UNSEEN = 2, 12, 2
"""comparisons of a change; borders of each that show in the memory, and others, that are kept"""


_now = threading.local()
"""``margins``: of the tick that this thread is in"""


class Traced(float):
    """A float that notes what it is compared with; what is computed of it does so, too."""

    __slots__ = ()
    __hash__ = float.__hash__


def _comparing(name: str) -> Callable[[Traced, Any], Any]:
    plain = getattr(float, name)

    def compare(self: Traced, other: Any) -> Any:
        if isinstance(other, (float, int)):
            frame, places = sys._getframe(1), []
            while frame.f_code is not _BEGIN and frame.f_back is not None:
                places.append(frame.f_lasti)
                frame = frame.f_back
            _now.margins[tuple(places)] = float(self) - float(other)
        return plain(self, other)

    return compare


def _computing(name: str) -> Callable[..., Any]:
    plain = getattr(float, name)

    def compute(self: Traced, *others: Any) -> Any:
        found = plain(self, *others)
        return Traced(found) if isinstance(found, float) else found

    return compute


for _name in ("lt", "le", "gt", "ge", "eq", "ne"):
    setattr(Traced, f"__{_name}__", _comparing(f"__{_name}__"))
for _name in ("add", "radd", "sub", "rsub", "mul", "rmul", "truediv", "rtruediv", "neg", "pos",
              "abs", "pow"):  # fmt: skip
    setattr(Traced, f"__{_name}__", _computing(f"__{_name}__"))


class Borders:
    """Seeks inputs of a task next to where its comparisons turn.

    Parameters
    ----------
    tick
        ``tick(x, m, u, par) -> memory``.
    used
        Fields that the task reads, of plant, stimulus and memory.
    """

    def __init__(
        self, tick: Callable[..., Any], used: Sequence[set[str]], rng: np.random.Generator
    ) -> None:
        self.tick, self.rng = tick, rng
        self.fields = [(part, name) for part, names in enumerate(used) for name in sorted(names)]
        self.found: Counter[tuple[int, ...]] = Counter()
        self.unseen: Counter[tuple[int, ...]] = Counter()

    def near(
        self, rows: Sequence[tuple[Inputs, Any]], wanted: int
    ) -> Iterator[tuple[Inputs, int]]:
        """Yield inputs on both sides of borders, and which of the rows they come from.

        Parameters
        ----------
        rows
            Inputs and parameters from which the search begins.
        wanted
            Inputs, about; comparisons that were met rarely come first.
        """
        given = 0
        for _ in range(_TRIES * wanted):
            if given >= wanted or not self.fields:
                return
            at, other = (int(k) for k in self.rng.integers(len(rows), size=2))
            inputs, par = rows[at]
            part, name = self.fields[int(self.rng.integers(len(self.fields)))]
            value = self._another(inputs, rows[other][0], part, name)
            for met in self._turns(inputs, par, part, name, value, rows[other][0]):
                given += 1
                yield met, at

    def _another(self, inputs: Inputs, others: Inputs, part: int, name: str) -> float:
        """Return another value of an input: that of other inputs, none, or its own changed."""
        own = float(getattr(inputs[part], name))
        values = (float(getattr(others[part], name)), 0.0, -own, 3.0 * own)
        return values[max(int(self.rng.integers(-3, 4)), 0)]

    def _turns(
        self, inputs: Inputs, par: Any, part: int, name: str, other: float, others: Inputs
    ) -> Iterator[Inputs]:
        """Yield the inputs next to the rarest comparisons that turn on the way to a value."""
        own = float(getattr(inputs[part], name))
        first, last = (self._margins(inputs, par, part, name, v) for v in (own, other))
        turning = [
            key for key in first.keys() & last.keys() if (first[key] > 0.0) != (last[key] > 0.0)
        ]
        for key in sorted(turning, key=lambda each: (self.found[each], each))[:_AT_ONCE]:
            if self.found[key] >= _ENOUGH:
                return

            kept = self._pair(inputs, par, part, name, key, (own, first[key]), (other, last[key]))
            is_seen = self._is_seen(kept, par)
            if not is_seen:
                kept, is_seen = self._elsewhere(kept, par, part, name, key, others)
            self.found[key] += 1 if is_seen else 0
            self.unseen[key] += 0 if is_seen else 1
            if is_seen or self.unseen[key] <= _UNSEEN:
                yield from kept

    def _pair(
        self, inputs: Inputs, par: Any, part: int, name: str, key: tuple[int, ...],
        first: tuple[float, float], last: tuple[float, float],
    ) -> list[Inputs]:  # fmt: skip
        """Return inputs on both sides of where a comparison turns."""

        def margin(value: float) -> float:
            return self._margins(inputs, par, part, name, value).get(key, math.nan)

        return [_with(inputs, part, name, value) for value in _closed_in(margin, first, last)]

    def _elsewhere(
        self, pair: list[Inputs], par: Any, part: int, name: str, key: tuple[int, ...],
        others: Inputs,
    ) -> tuple[list[Inputs], bool]:  # fmt: skip
        """Return a border of the same comparison that shows, with other inputs changed, if any."""
        own = [float(getattr(each[part], name)) for each in pair]
        apart = 1e-3 * (abs(own[0]) + abs(own[1]) + 1e-3)
        for _ in range(_CONTEXTS):
            inputs = pair[0]
            for _ in range(int(self.rng.integers(1, 4))):
                place, field = self.fields[int(self.rng.integers(len(self.fields)))]
                if (place, field) != (part, name):
                    value = self._another(inputs, others, place, field)
                    inputs = _with(inputs, place, field, value)
            ends = (own[0], own[1]), (own[0] - apart, own[0] + apart)
            for low, high in ends:  # where it was, or near by
                at_low, at_high = (
                    self._margins(inputs, par, part, name, v).get(key, math.nan)
                    for v in (low, high)
                )
                if (at_low > 0.0) != (at_high > 0.0) and math.isfinite(at_low - at_high):
                    found = self._pair(
                        inputs, par, part, name, key, (low, at_low), (high, at_high)
                    )
                    if self._is_seen(found, par):
                        return found, True
        return pair, False

    def _margins(self, inputs: Inputs, par: Any, part: int, name: str, value: float) -> Margins:
        x, u, m = _traced(_with(inputs, part, name, value))
        _now.margins = {}
        try:
            with np.errstate(all="ignore"):  # numbers of single precision warn where others raise
                self.tick(x, m, u, par)
        except (ArithmeticError, ValueError):
            return {}
        found: Margins = _now.margins
        return found

    def _is_seen(self, pair: Sequence[Inputs], par: Any) -> bool:
        """Return whether the memory jumps between two inputs next to each other."""
        try:
            with np.errstate(all="ignore"):
                first, last = (list(self.tick(x, m, u, par)) for x, u, m in pair)
        except (ArithmeticError, ValueError):
            return False
        return any(abs(a - b) > _JUMP * (abs(a) + abs(b)) for a, b in zip(first, last, strict=True))


_BEGIN = Borders._margins.__code__
"""above it there is no law any more"""


def _with(inputs: Inputs, part: int, name: str, value: float) -> Inputs:
    changed = list(inputs)
    changed[part] = inputs[part]._replace(**{name: value})
    return tuple(changed)


def _traced(inputs: Inputs) -> Inputs:
    return tuple(type(each)(*map(Traced, each)) for each in inputs)


def _closed_in(
    margin: Callable[[float], float], first: tuple[float, float], last: tuple[float, float]
) -> tuple[float, float]:
    """Return two values as close to each other as can be, between which a margin turns."""
    (a, at_a), (b, at_b) = (first, last) if first[1] > 0.0 else (last, first)  # a above, b not
    for count in range(_HALVINGS):
        middle = 0.5 * (a + b)
        if count < 6 and at_a != at_b and math.isfinite(at_a - at_b):
            middle = b - at_b * (a - b) / (at_a - at_b)
            if count % 2:  # the straight line ends in a border, the next number is beyond it
                middle = math.nextafter(middle, a if at_b == 0.0 else b)
        if not min(a, b) < middle < max(a, b):
            middle = 0.5 * (a + b)
        if middle in (a, b):
            break
        found = margin(middle)
        if math.isnan(found):
            break
        if found > 0.0:
            a, at_a = middle, found
        else:
            b, at_b = middle, found
    return a, b
