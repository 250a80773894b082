"""Parameter sets: creation, changes, traversal, and helpful errors."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any, Literal

import pydantic
import pytest
from pydantic import Field, field_validator, model_validator

from bywire.core.errors import ParameterError, UnknownNameError
from bywire.core.parameters import ParameterSet, choice_fields, field_notes, leaf_fields, leaf_table
from bywire.core.quantities import Fraction, Length, Resistance, Unit
from bywire.core.units import Written
from bywire.report.wording import range_text
from raising import raises

Nodes = tuple[Annotated[float, Field(ge=0, allow_inf_nan=False)], ...]


class Inner(ParameterSet):
    """A part."""

    R: Resistance
    """resistance"""
    law: Literal["paper", "directional"]
    """which equations"""


class Outer(ParameterSet):
    """A whole of parts, numbers, a table and choices."""

    inner: Inner
    """the part"""
    share: Fraction
    """how much"""
    table: Annotated[Nodes, Unit("Pa"), Field(min_length=1)]
    """pressures"""
    n: Annotated[int, Unit("1"), Field(ge=1, le=9)]
    """how many"""
    on: bool
    """whether"""
    note: str
    """what about it"""
    long: Length
    """longer than short"""
    short: Length
    """shorter than long"""

    @model_validator(mode="after")
    def _is_ordered(self) -> Outer:
        if self.short >= self.long:
            raise ValueError("short must be shorter than long")
        return self


class Counted(ParameterSet):
    """Numbers of which two are whole."""

    turns: Annotated[float, Unit("1"), Field(ge=1, multiple_of=1)]
    """how often"""
    n: Annotated[int, Unit("1"), Field(ge=1)]
    """how many"""
    share: Fraction
    """how much"""


VALUES: dict[str, Any] = {
    "inner.R": 0.35,
    "inner.law": "paper",
    "share": 0.9,
    "table": (0.0, 1e5, 2e5),
    "n": 3,
    "on": True,
    "note": "as built",
    "long": 2.0,
    "short": 1.0,
}


def made(**changes: Any) -> Outer:
    """Return the set, changed."""
    return Outer.create(VALUES | changes)


def test_created_and_flat_are_inverse():
    assert made().flat() == VALUES
    assert Outer.create(made().flat()) == made()
    assert made().inner.R == 0.35


def test_replaced_values_are_checked_again():
    other = made().replace({"inner.R": 0.4, "share": 1.0})
    assert (other.inner.R, other.share) == (0.4, 1.0)
    assert made().inner.R == 0.35
    with pytest.raises(ParameterError, match=r"inner\.R = -3 ohm .* must be > 0 ohm"):
        made().replace({"inner.R": -3.0})
    with pytest.raises(ParameterError, match="short must be shorter than long"):
        made().replace({"short": 3.0})


def test_groups_that_hold_no_changed_value_are_kept():
    """A search creates thousands of sets per second."""
    before = made()
    assert before.replace({"share": 0.5}).inner is before.inner
    assert before.replace({"inner.R": 0.4}).inner is not before.inner


class Pair(ParameterSet):
    """Two parts, judged by a rule between them."""

    left: Inner
    """the first"""
    right: Inner
    """the second"""

    @model_validator(mode="after")
    def _left_is_less(self) -> Pair:
        if self.left.R >= self.right.R:
            raise ValueError("left must be less than right")
        return self


class Doubled(Pair):
    """Two parts, one of which is converted."""

    @field_validator("right")
    @classmethod
    def _is_doubled(cls, right: Inner) -> Inner:
        return Inner(R=2.0 * right.R, law=right.law)


PAIR = {"left.R": 1.0, "left.law": "paper", "right.R": 2.0, "right.law": "paper"}


@pytest.mark.parametrize(
    "changes",
    [
        {"left.R": 1.5},
        {"left.R": 1.5, "right.R": 3.0},
        {"left.law": "directional"},
        {"right.R": 4.0, "right.law": "directional"},
    ],
)
def test_a_set_of_which_parts_change_is_as_if_built_anew(changes):
    replaced, built = Pair.create(PAIR).replace(changes), Pair.create(PAIR | changes)
    assert replaced == built
    assert list(replaced.leaves().items()) == list(built.leaves().items())
    assert replaced.choices() == built.choices()
    assert replaced.model_dump_json() == built.model_dump_json()
    assert replaced.model_fields_set == built.model_fields_set


def test_rules_between_parts_are_asked_when_a_part_changes():
    with pytest.raises(ParameterError, match="left must be less than right"):
        Pair.create(PAIR).replace({"left.R": 3.0})
    with pytest.raises(ParameterError) as failed:  # all at once, as when it is built
        Pair.create(PAIR).replace({"left.R": -1.0, "right.R": -2.0})
    assert [line.split(" = ")[0] for line in str(failed.value).split("\n")] == ["left.R", "right.R"]


def test_a_class_that_does_more_than_judge_is_asked_to():
    assert Doubled.create(PAIR).replace({"left.R": 1.5, "right.R": 3.0}).right.R == 6.0


def test_what_a_set_replaced_holds_is_what_it_says_by_name():
    before = made()
    before.leaves(), before.choices()  # which are kept
    other = before.replace({"inner.R": 0.4, "inner.law": "directional"})
    assert other.flat() == VALUES | {"inner.R": 0.4, "inner.law": "directional"}
    assert other.leaves() == before.leaves() | {"inner.R": 0.4}
    assert other.choices() == before.choices() | {"inner.law": "directional"}
    assert before.replace({"n": 4.0}).leaves()["n"] == 4.0
    assert before.replace({"inner.R": 0.35}) is before
    assert not before.has_choices_of(other)
    assert before.has_choices_of(before.replace({"share": 0.5}))


def test_nothing_can_be_assigned_or_added():
    with pytest.raises(pydantic.ValidationError, match="frozen"):
        made().share = 0.5
    with pytest.raises(pydantic.ValidationError, match="frozen"):
        made().inner.R = 0.5
    with pytest.raises(pydantic.ValidationError, match="extra"):
        Inner(R=1.0, law="paper", L=2.0)  # type: ignore[call-arg]


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"inner.R": 0.0}, "inner.R = 0 ohm is not valid: it must be > 0 ohm"),
        ({"inner.R": math.nan}, "inner.R = nan is not valid: it must be > 0 ohm"),
        ({"inner.R": math.inf}, "inner.R = inf is not valid: it must be finite and > 0 ohm"),
        ({"inner.R": "much"}, "inner.R = 'much' is not valid: it must be > 0 ohm"),
        ({"inner.R": None}, "inner.R = None is not valid: it must be > 0 ohm"),
        ({"share": 1.1}, "share = 1.1 is not valid: it must be > 0 and <= 1"),
        ({"n": 2.5}, "n = 2.5 is not valid: it must be a whole number, >= 1 and <= 9"),
        ({"n": 10}, "n = 10 is not valid: it must be >= 1 and <= 9"),
        ({"table": (0.0, -1.0)}, "table.1 = -1 Pa is not valid: it must be >= 0 Pa"),
        ({"table": (math.nan,)}, "table.0 = nan is not valid: it must be >= 0 bar"),
        ({"table": ()}, "table must have at least 1 value, got ()"),
        ({"table": 3.0}, "table = 3.0 Pa is not valid: it must be >= 0 Pa"),
        (
            {"inner.law": "papr"},
            "inner.law must be 'paper' or 'directional', got 'papr': did you mean 'paper'?",
        ),
        ({"inner.law": 3}, "inner.law must be 'paper' or 'directional', got 3"),
        ({"on": "maybe"}, "on: it must be true or false, got 'maybe'"),
        ({"on": [1]}, "on: it must be true or false, got [1]"),
        ({"note": 3}, "note: it must be a string, got 3"),
        ({"short": 2.0}, "Outer: short must be shorter than long"),
    ],
)
def test_refusal_is_one_line_that_helps(changes, text):
    with pytest.raises(ParameterError) as refused:
        made(**changes)
    assert str(refused.value) == text


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (
            {"short": Written(-2e-5, "-0.02mm")},
            "short = -0.02 mm is not valid: it must be > 0 mm",
        ),
        (
            {"share": Written(1.2, "120 %")},
            "share = 120 % is not valid: it must be > 0 % and <= 100 %",
        ),
        ({"share": Written(1.2, "1.2")}, "share = 1.2 is not valid: it must be > 0 and <= 1"),
        (
            {"table": (Written(0.0, "0 bar"), Written(-1e5, "-1 bar"))},
            "table.1 = -1 bar is not valid: it must be >= 0 bar",
        ),
    ],
)
def test_refusal_repeats_the_text_as_typed(changes, text):
    with pytest.raises(ParameterError) as refused:
        made(**changes)
    assert str(refused.value) == text


def test_texts_are_not_kept():
    kept = made(short=Written(0.5, "500 mm"), table=(Written(1.0, "1 Pa"),))
    assert {type(kept.short), type(kept.table[0])} == {float}


@pytest.mark.parametrize("name", ["inner.law", "on", "note"])
def test_long_value_is_cut_off(name):
    with pytest.raises(ParameterError) as refused:
        made(**{name: ["x" * 1_000_000]})
    assert len(str(refused.value)) < 300


def test_several_mistakes_get_a_line_each():
    with pytest.raises(ParameterError) as refused:
        made(**{"inner.R": -1.0, "share": 2.0})
    assert [line.split()[0] for line in str(refused.value).splitlines()] == ["inner.R", "share"]


def test_missing_value():
    values = {name: value for name, value in VALUES.items() if name != "inner.R"}
    with raises(ParameterError, name="inner.R"):
        Outer.create(values)


@pytest.mark.parametrize(
    "name", ["inner.r", "inner", "inner.R.x", "tabel", "table.0", "", ".", "__class__"]
)
def test_unknown_name(name):
    with pytest.raises(UnknownNameError, match="unknown parameter"):
        made(**{name: 1.0})


def test_leaves_spread_tables():
    assert made().leaves() == {
        "inner.R": 0.35,
        "share": 0.9,
        "table.0": 0.0,
        "table.1": 1e5,
        "table.2": 2e5,
        "n": 3.0,
        "long": 2.0,
        "short": 1.0,
    }
    assert all(type(value) is float for value in made().leaves().values())


def test_numbers_of_several_sets_are_a_table():
    sets = [made(), made().replace({"inner.R": 0.5}), made(n=7.0)]
    table = leaf_table(sets)
    assert table.tolist() == [list(each.leaves().values()) for each in sets]
    with pytest.raises((TypeError, ValueError)):
        leaf_table([made(), made().with_leaves({"inner.R": "R"})])


def test_choices_hold_the_length_of_tables():
    assert made().choices() == {
        "inner.law": "paper",
        "table": 3,
        "on": True,
        "note": "as built",
    }
    assert made(table=(1.0,)).choices()["table"] == 1


def test_leaves_can_be_put_back_as_anything():
    names = made().leaves()
    symbols = made().with_leaves({name: f"<{name}>" for name in names})
    assert symbols.inner.R == "<inner.R>"
    assert symbols.table == ("<table.0>", "<table.1>", "<table.2>")
    assert symbols.inner.law == "paper"
    assert symbols.on is True
    assert made().with_leaves(names) == made()
    before = made()
    some = before.with_leaves({"share": "<share>", "table.1": "<table.1>"})
    assert (some.share, some.table, some.long) == ("<share>", (0.0, "<table.1>", 2e5), 2.0)
    assert some.inner is before.inner


def test_fields_know_unit_range_and_description():
    leaves = leaf_fields(Outer)
    assert list(leaves) == ["inner.R", "share", "table", "n", "long", "short"]
    assert leaves["inner.R"].unit.symbol == "ohm"
    assert field_notes(Outer)["inner.R"] == "resistance"
    assert leaves["inner.R"].range_text == "> 0 ohm"
    assert leaves["share"].range_text == "> 0 and <= 1"
    assert leaves["table"].range_text == ">= 0 bar"
    alone = replace(leaves["inner.R"], low=2.0, high=2.0)
    assert alone.range_text == "exactly 2 ohm"
    assert range_text(alone) == "exactly 2 Ω"
    assert choice_fields(Outer) == ("inner.law", "on", "note")
    notes = field_notes(Outer)
    assert [notes[name] for name in choice_fields(Outer)] == [
        "which equations",
        "whether",
        "what about it",
    ]


def test_notes_of_classes_within_others_and_in_conditions():
    class Local(ParameterSet):
        R: Resistance
        """of a function"""

    if Local:

        class Conditional(Local):
            x: Length
            """of a condition"""

    class Holder:
        class Local(ParameterSet):
            R: Resistance
            """of a class"""

    assert field_notes(Conditional) == {"R": "of a function", "x": "of a condition"}
    assert field_notes(Holder.Local) == {"R": "of a class"}
    silent = type("Silent", (ParameterSet,), {"__annotations__": {"R": Resistance}})
    assert field_notes(silent) == {"R": ""}


def test_fields_cannot_be_changed_by_who_reads_them():
    with pytest.raises(TypeError):
        leaf_fields(Outer)["x"] = leaf_fields(Outer)["n"]  # type: ignore[index]


def test_json_round_trip():
    assert Outer.model_validate_json(made().model_dump_json()) == made()


def test_whole_numbers_are_known_as_such():
    assert [name for name, leaf in leaf_fields(Counted).items() if leaf.is_whole] == ["turns", "n"]
    with pytest.raises(ParameterError, match=r"turns = 2\.5 is not .* a whole number, >= 1"):
        Counted.create({"turns": 2.5, "n": 1, "share": 0.5})
