"""Which values of a graph cannot be negative, as far as that follows from parameter ranges."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Interval:
    """A closed interval that a value lies in."""

    low: float = -math.inf
    high: float = math.inf

    @property
    def positive(self) -> bool:
        """Whether the value is >= 0."""
        return self.low >= 0.0

    @property
    def negative(self) -> bool:
        """Whether the value is <= 0."""
        return self.high <= 0.0


ANYTHING = Interval()
NOT_NEGATIVE = Interval(0.0)


def interval_of(op: str, arguments: list[Interval]) -> Interval:
    """Return an interval of an operation's result; wide where nothing is known.

    Only signs are read from intervals, and rounding never changes the sign of a sum whose exact
    bound is zero.
    """
    rule = _RULES.get(op)
    return ANYTHING if rule is None else rule(*arguments)


def _add(a: Interval, b: Interval) -> Interval:
    return Interval(a.low + b.low, a.high + b.high)


def _negated(a: Interval) -> Interval:
    return Interval(-a.high, -a.low)


def _multiplied(a: Interval, b: Interval) -> Interval:
    if (a.positive and b.positive) or (a.negative and b.negative):
        return NOT_NEGATIVE
    if (a.positive and b.negative) or (a.negative and b.positive):
        return Interval(high=0.0)
    return ANYTHING


def _inverted(a: Interval) -> Interval:
    return NOT_NEGATIVE if a.positive else Interval(high=0.0) if a.negative else ANYTHING


_RULES: dict[str, Callable[..., Interval]] = {
    "add": _add,
    "sub": lambda a, b: _add(a, _negated(b)),
    "neg": _negated,
    "mul": _multiplied,
    "inv": _inverted,
    "fabs": lambda a: NOT_NEGATIVE,
    "exp": lambda a: NOT_NEGATIVE,
    "sqrt": lambda a: NOT_NEGATIVE,
    "fmax": lambda a, b: Interval(max(a.low, b.low), max(a.high, b.high)),
    "fmin": lambda a, b: Interval(min(a.low, b.low), min(a.high, b.high)),
    "if_else_zero": lambda c, a: Interval(min(a.low, 0.0), max(a.high, 0.0)),
    "select": lambda c, a, b: Interval(min(a.low, b.low), max(a.high, b.high)),
}
