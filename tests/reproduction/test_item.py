"""Judgement of statements."""

import math

import pytest

from bywire.reproduction.item import Fact, compared, found, holds, quoted

FACT = Fact(10.0, "Hz", "section 6")


@pytest.mark.parametrize(
    ("computed", "tolerance", "expected"),
    [
        (10.4, 0.5, True),
        (9.4, 0.5, False),
        (9.0, "<=", True),
        (11.0, "<=", False),
        (11.0, ">=", True),
        (9.0, ">=", False),
        (math.nan, 0.5, False),
        (math.nan, "<=", False),
    ],
)
def test_holds(computed: float, tolerance: object, expected: bool) -> None:
    assert holds(10.0, computed, tolerance) is expected  # type: ignore[arg-type]


def test_compared_keeps_place_and_note() -> None:
    item = compared("a", FACT, 3.3, ">=", "with dither")
    assert (item.agrees, item.stated, item.unit) == (False, 10.0, "Hz")
    assert item.note == "section 6; with dither"
    assert item.kind == "printed"


def test_kind_comes_from_the_statement() -> None:
    axis = Fact(0.15, "N*m", "axis limit: top of Fig. 4", "axis")
    assert compared("a", axis, 0.17, "<=").kind == "axis"
    assert quoted("a", axis, "not modeled").kind == "axis"
    assert found("a", "s", 0.1, "ours").kind == "ours"


def test_parameter_set_follows_the_at_sign() -> None:
    assert found("a.b@table1", "s", 0.1, "").parameter_set == "table1"
    assert found("a.b", "s", 0.1, "").parameter_set == ""


def test_what_was_tuned_proves_nothing() -> None:
    item = compared("a", FACT, 10.0, 0.1, "why", tuned="calibrated")
    assert item.agrees is None
    assert "calibrated" in item.note


def test_without_counterpart_nothing_is_judged() -> None:
    assert found("a", "s", 0.1, "ours").agrees is None
    assert found("a", "s", 0.1, "ours").stated is None
    assert quoted("a", FACT, "not modeled").computed is None
    assert compared("a", FACT, 10.0, None).agrees is None
