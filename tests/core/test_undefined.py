"""Results with the same undefined numbers are equal in every version of Python."""

from __future__ import annotations

from dataclasses import replace

from bywire.analysis.crossings import Margin
from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Verdict, read_limit

UNDEFINED = float("nan")  # another object than math.nan, which fields have by default


def test_undefined_numbers_are_equal_and_numbers_differ():
    for one in (
        Kpi("overshoot", UNDEFINED, "%", "How far.", "no step"),
        Verdict(read_limit("overshoot", "<= 5 %", "%"), UNDEFINED, False, "no step"),
        Margin(UNDEFINED, UNDEFINED),
    ):
        changes = {"value": float("nan")} if hasattr(one, "value") else {"phase": float("nan")}
        assert replace(one, **changes) == one
        assert len({one, replace(one, **changes)}) == 1
        assert replace(one, **dict.fromkeys(changes, 0.0)) != one
    assert Margin(1.0, 2.0) != Margin(1.0, UNDEFINED)
    assert Margin(1.0, 2.0) != (1.0, 2.0, UNDEFINED)
