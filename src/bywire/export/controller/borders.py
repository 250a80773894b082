"""Test vectors next to borders: inputs at which a comparison of the laws is about to turn.

Random inputs hardly ever meet a limit to the last digit, where ``<`` and ``<=`` differ, nor come
so close to it that another limit shows. A tick is run on numbers that note every comparison that
they take part in, and how far its sides are apart. One input is changed until a comparison turns;
in between the place is sought where it does. What lies there is where the search goes on: behind
a limit that is rarely met stand those that are met nowhere else.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bywire.export.controller.traced import Margins, Place, margins
from bywire.export.controller.turns import Border, Field, Inputs, Turn, changed, value_of

_LAW = 3
"""places, innermost first, that are the same for all who call a law"""
_TRIES, _CONTEXTS, _NEAR_BY, _SMALL = 4, 40, 3, 1e-6
_AT_ONCE, _ENOUGH, _UNSEEN, _MET = 2, 6, 2, 2
"""comparisons of a change; borders of each that are kept, those that do not show in the memory, and
those whose sides are equal"""
_BEYOND, _FAR = 1.01, 1e3
"""how far beyond a border is aimed, and how many times its size an input may become"""
_ULPS = (1, -1, 2, -2, 3, -3, 5, -5, 8, -8)
_LATEST = 200
"""borders from which the search goes on"""


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
        self.rows: list[Inputs] = []
        self.reached: list[tuple[Inputs, int]] = []
        self.shown: Counter[Place] = Counter()
        self.met: Counter[Place] = Counter()
        self.unseen: Counter[Place] = Counter()
        self.sides: dict[Place, list[Field]] = {}

    def near(self, rows: Sequence[tuple[Inputs, Any]], wanted: int) -> Iterator[tuple[Inputs, int]]:
        """Yield inputs on both sides of borders, and which of the rows they come from.

        Parameters
        ----------
        rows
            Inputs and parameters from which the search begins.
        wanted
            Inputs, about; comparisons that were met rarely come first.
        """
        self.rows = [inputs for inputs, _ in rows]
        self.reached = [(inputs, at) for at, inputs in enumerate(self.rows)]
        given = 0
        for _ in range(_TRIES * wanted):
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

    def _another(self, inputs: Inputs, field: Field) -> float:
        """Return another value of an input: that of other inputs, none, or its own changed."""
        others = self.rows[self._any(len(self.rows))]
        before = value_of(inputs, field)
        values = (value_of(others, field), 0.0, -before, 3.0 * before)
        return values[max(int(self.rng.integers(-3, 4)), 0)]

    def _turned(self, inputs: Inputs, par: Any) -> Iterator[Border]:
        """Yield borders of the rarest comparisons that turn where an input gets another value."""
        along = Turn(self.tick, par, (), self.fields[self._any(len(self.fields))])
        at, to = value_of(inputs, along.field), self._another(inputs, along.field)
        here, there = (along.margins(inputs, value) for value in (at, to))
        ends = [(to, there)]
        ends += [(v, along.margins(inputs, v)) for v in self._aimed((at, here), (to, there))]
        turning: dict[Place, tuple[float, float]] = {}
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

    def _is_worth(self, law: Place, shown: Border | None) -> bool:
        """Count a border; return whether it is kept."""
        self.shown[law] += int(shown is not None)
        self.unseen[law] += int(shown is None)
        return shown is not None or self.unseen[law] <= _UNSEEN

    def _aimed(self, first: tuple[float, Margins], last: tuple[float, Margins]) -> Iterator[float]:
        """Yield a value beyond which the rarest comparison turns that the input has a say in."""
        (at, here), (to, there) = first, last
        for place in sorted(here.keys() & there.keys(), key=self._rank):
            moves = there[place] - here[place]
            if moves == 0.0 or not math.isfinite(moves):
                continue
            value = at - _BEYOND * here[place] * (to - at) / moves
            if abs(value) <= _FAR * (abs(at) + abs(to)):
                yield value
                return

    def _rank(self, place: Place) -> tuple[float, Place]:
        """Return how well a comparison is known already."""
        law = place[:_LAW]
        return self.met[law] + self.shown[law] / 3 + self.unseen[law] / 10, place

    def _met(self, turn: Turn, border: Border) -> Border:
        """Return a border with its sides equal, if it can be had by the last digits of inputs.

        The numbers that one input can be may make a side jump over the other.
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
            at = value_of(border.below, field)
            for ulps in () if field == turn.field else _ULPS:
                nudged = border.changed(field, at + ulps * math.ulp(at))
                if turn.is_at(nudged) and turn.is_seen(nudged):
                    yield nudged

    def _sides(self, turn: Turn, inputs: Inputs) -> Iterator[Field]:
        """Yield inputs that have a say in a comparison."""
        before = margins(self.tick, inputs, turn.par).get(turn.place)
        for field in self.fields:
            value = value_of(inputs, field) * (1.0 + _SMALL) + _SMALL
            moved = changed(inputs, [(field, value)])
            if margins(self.tick, moved, turn.par).get(turn.place) != before:
                yield field

    def _elsewhere(self, turn: Turn, border: Border) -> Border | None:
        """Return a border of the same comparison that shows, with other inputs changed, if any."""
        above, below = (value_of(each, turn.field) for each in (border.above, border.below))
        for count in range(_CONTEXTS):  # the same place: what follows from it may be hidden
            inputs = border.above
            if count % 2:
                inputs = self.reached[self._any(len(self.reached))][0]
            inputs = changed(inputs, self._changes(inputs, turn.field) if count % 4 < 2 else ())
            high, low = (changed(inputs, [(turn.field, value)]) for value in (above, below))
            moved = Border(high, low, border.is_met)
            if turn.is_seen(moved) and turn.is_at(moved):
                return moved
        apart = 1e-3 * (2.0 * abs(above) + 1e-3)
        for _ in range(_NEAR_BY):  # where other inputs have a say in the comparison
            inputs = changed(border.above, self._changes(border.above, turn.field))
            first, last = ((v, turn.margin(inputs, v)) for v in (above - apart, above + apart))
            if (first[1] > 0.0) != (last[1] > 0.0) and math.isfinite(first[1] - last[1]):
                moved = turn.border(inputs, first, last)
                if turn.is_seen(moved):
                    return moved
        return None

    def _changes(self, inputs: Inputs, but: Field) -> Iterator[tuple[Field, float]]:
        """Yield other values of some inputs."""
        for _ in range(int(self.rng.integers(1, 4))):
            field = self.fields[self._any(len(self.fields))]
            if field != but:
                yield field, self._another(inputs, field)
