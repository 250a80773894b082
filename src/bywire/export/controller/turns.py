"""Where a comparison turns while an input of a tick changes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bywire.export.controller.traced import Margins, Place, margins

Inputs = tuple[Any, Any, Any]
"""plant, stimulus and memory of a tick"""
Field = tuple[int, str]
"""an input: which of the three, and its name"""
_STEPS, _JUMP = 60, 1e-7


def value_of(inputs: Inputs, field: Field) -> float:
    """Return an input."""
    return float(getattr(inputs[field[0]], field[1]))


def changed(inputs: Inputs, changes: Iterable[tuple[Field, float]]) -> Inputs:
    """Return inputs of which some have other values."""
    parts = list(inputs)
    for (part, name), value in changes:
        parts[part] = parts[part]._replace(**{name: value})
    return tuple(parts)


@dataclass(frozen=True)
class Border:
    """Inputs on both sides of where a comparison turns, and whether its sides are equal at one."""

    above: Inputs
    below: Inputs
    is_met: bool

    def changed(self, field: Field, value: float) -> Border:
        """Return both sides with another input changed, which are taken to be equal at one."""
        above, below = (changed(each, [(field, value)]) for each in (self.above, self.below))
        return Border(above, below, is_met=True)


@dataclass(frozen=True)
class Turn:
    """A comparison of a tick, looked at along one of its inputs.

    Parameters
    ----------
    tick
        ``tick(x, m, u, par) -> memory``.
    place
        Of the comparison.
    field
        The input.
    """

    tick: Callable[..., Any]
    par: Any
    place: Place
    field: Field

    def margins(self, inputs: Inputs, value: float) -> Margins:
        """Return how far the sides of all comparisons are apart, with a value of the input."""
        return margins(self.tick, changed(inputs, [(self.field, value)]), self.par)

    def margin(self, inputs: Inputs, value: float) -> float:
        """Return how far the sides are apart; NaN where the comparison is not reached."""
        return self.margins(inputs, value).get(self.place, math.nan)

    def border(
        self, inputs: Inputs, first: tuple[float, float], last: tuple[float, float]
    ) -> Border:
        """Return where the comparison turns between two values with their margins."""
        ends = turning_point(lambda value: self.margin(inputs, value), first, last)
        above, below = (changed(inputs, [(self.field, value)]) for value, _ in ends)
        return Border(above, below, ends[1][1] == 0.0)

    def is_at(self, border: Border) -> bool:
        """Return whether the comparison turns there, as the border says."""
        above, below = (
            margins(self.tick, each, self.par).get(self.place, 0.0)
            for each in (border.above, border.below)
        )
        return above > 0.0 >= below and (below == 0.0 or not border.is_met)

    def is_seen(self, border: Border) -> bool:
        """Return whether the memory jumps between two inputs next to each other."""
        try:
            with np.errstate(all="ignore"):
                first, last = (
                    list(self.tick(x, m, u, self.par)) for x, u, m in (border.above, border.below)
                )
        except (ArithmeticError, ValueError):
            return False
        return any(abs(a - b) > _JUMP * (abs(a) + abs(b)) for a, b in zip(first, last, strict=True))


def turning_point(
    margin: Callable[[float], float], first: tuple[float, float], last: tuple[float, float]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return two numbers as close to each other as can be, between which a margin turns.

    Parameters
    ----------
    margin
        Of a number; NaN where the comparison is not reached.
    first, last
        Numbers and their margins, of which one is above zero.

    Returns
    -------
    tuple
        The number above with its margin, and the one that is not.
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
    """Return where a straight line turns, or a number just beyond the end that is closer to it."""
    (a, at_a), (b, at_b) = above, below
    guess = b - at_b * (a - b) / (at_a - at_b)
    if is_beyond or at_b == 0.0:
        end, other = (b, a) if abs(at_b) <= abs(at_a) else (a, b)
        ulps = 1.0 if at_b == 0.0 else 4.0
        guess = end + math.copysign(ulps * math.ulp(end), other - end)
    return guess if min(a, b) < guess < max(a, b) else middle
