"""Test vectors at boundaries of comparisons: exactly on them, and one digit to either side."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bywire.core import ops
from bywire.export.controller.vectors import Borders, Traced


class Memory(NamedTuple):
    """Three numbers."""

    a: float
    b: float
    mode: float


class Nothing(NamedTuple):
    """No signals."""


def tick(x: Nothing, m: Memory, u: Nothing, par: float) -> Memory:
    """Branch at a limit, at a product of two numbers, and in one mode at another limit."""
    limited = ops.where(m.a > par, 1.0, 0.0)
    above = ops.where(2.0 * m.a * m.b < 3.0, 1.0, 0.0)
    hidden = ops.where(m.mode > 1.5, ops.where(m.b <= 0.7, 5.0, 4.0), 0.0)
    return m._replace(a=limited, b=above, mode=hidden)


def found(wanted: int) -> list[Memory]:
    rng = np.random.default_rng(2)
    rows = [
        ((Nothing(), Nothing(), Memory(*map(float, rng.uniform(-2.0, 3.0, 3)))), 0.3)
        for _ in range(50)
    ]
    borders = Borders(tick, [set(), set(), {"a", "b", "mode"}], rng)
    return [inputs[2] for inputs, _ in borders.near(rows, wanted)]


def test_limits_are_met_exactly_and_passed_by_the_last_digit() -> None:
    made = found(60)
    assert any(m.a == 0.3 for m in made)
    assert any(m.a == math.nextafter(0.3, 1.0) for m in made)
    assert any(m.b == 0.7 and m.mode > 1.5 for m in made)
    products = [2.0 * m.a * m.b - 3.0 for m in made]
    assert any(-1e-6 < each <= 0.0 for each in products)
    assert any(0.0 < each < 1e-6 for each in products)


def test_a_tick_is_the_same_on_traced_numbers() -> None:
    m = Memory(0.31, 0.7, 2.0)
    after = tick(Nothing(), Memory(*map(Traced, m)), Nothing(), 0.3)
    assert after == tick(Nothing(), m, Nothing(), 0.3) == Memory(1.0, 1.0, 5.0)
    assert type(-(Traced(2.0) * 3.0 + 1.0) / 2.0) is Traced


def test_nothing_to_change_gives_nothing() -> None:
    rng = np.random.default_rng(0)
    borders = Borders(tick, [set(), set(), set()], rng)
    assert list(borders.near([((Nothing(), Nothing(), Memory(1.0, 1.0, 1.0)), 0.3)], 5)) == []
