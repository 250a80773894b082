"""Signals, quantities and errors: declared once and read everywhere."""

from __future__ import annotations

import re
from datetime import date, datetime
from typing import Annotated, Any, NamedTuple, get_args

import pytest
from pydantic import TypeAdapter, ValidationError

from bywire.core import errors, quantities, signals, units
from bywire.core.errors import BywireError, ModelError, UnknownNameError, quoted, unknown_name
from bywire.core.signals import Signal, joined, signals_of, zeros
from raising import raises

QUANTITIES = {
    name: value
    for name, value in vars(quantities).items()
    if any(isinstance(note, quantities.Unit) for note in get_args(value))
}
SIGNALS = {
    name: note
    for name, value in vars(signals).items()
    for note in get_args(value)
    if isinstance(note, Signal)
}


class Pair(NamedTuple):
    """Two signals."""

    p: signals.Pressure
    x: Annotated[float, Signal("m", "travel", 0.01)]


class Half(NamedTuple):
    """A signal and a field that is not a signal."""

    p: signals.Pressure
    q: float


def test_signals_come_in_the_order_of_the_fields():
    found = signals_of(Pair)
    assert list(found) == ["p", "x"]
    assert found["x"] == Signal("m", "travel", 0.01)
    assert found["p"].unit == "Pa"


def test_field_without_a_signal_is_refused():
    with pytest.raises(ModelError, match=r"Half\.q has no Signal annotation"):
        signals_of(Half)


def test_zeros():
    assert zeros(Pair) == Pair(0.0, 0.0)


@pytest.mark.parametrize("name", SIGNALS)
def test_signal_has_a_unit_a_label_and_a_magnitude(name):
    signal = SIGNALS[name]
    assert units.parse(f"1 {signal.unit}" if signal.unit != "1" else "1", signal.unit, name) == 1.0
    assert signal.label
    assert signal.nominal > 0


@pytest.mark.parametrize("name", QUANTITIES)
def test_quantity_admits_its_nominal_value_and_no_nan(name):
    _, *notes = get_args(QUANTITIES[name])
    unit = next(note for note in notes if isinstance(note, quantities.Unit))
    adapter: TypeAdapter[Any] = TypeAdapter(QUANTITIES[name])
    assert adapter.validate_python(unit.nominal) == unit.nominal
    for wrong in (float("nan"), float("inf"), float("-inf")):
        with pytest.raises(ValidationError):
            adapter.validate_python(wrong)


def drawn() -> dict[str, str]:
    """Return the tree of errors as drawn at the top of its file: class -> parent."""
    parents: dict[str, str] = {}
    path: list[str] = []
    for line in (errors.__doc__ or "").splitlines():
        match = re.match(r"    ([│├└─ ]*)(\w+Error)\b", line)
        if match:
            depth = len(match[1]) // 4
            path[depth:] = [match[2]]
            parents[match[2]] = path[depth - 1] if depth else "Exception"
    return parents


def declared() -> dict[str, str]:
    """Return the tree of errors as declared."""
    classes = [value for value in vars(errors).values() if isinstance(value, type)]
    return {c.__name__: c.__bases__[0].__name__ for c in classes if issubclass(c, Exception)}


def test_drawn_tree_of_errors_is_the_declared_one():
    assert len(drawn()) > 8
    assert drawn() == declared()


@pytest.mark.parametrize("name", declared())
def test_every_error_has_a_status_and_a_meaning(name):
    cls = getattr(errors, name)
    assert issubclass(cls, BywireError)
    assert cls.exit_status == (2 if issubclass(cls, errors.InputError) else 3)
    assert cls.__doc__


def test_drawn_statuses_are_the_real_ones():
    for name, status in re.findall(r"(\w+Error) +exit status (\d)", errors.__doc__ or ""):
        assert getattr(errors, name).exit_status == int(status)


@pytest.mark.parametrize(
    ("name", "known", "text"),
    [
        ("brakng", ["braking", "release"], "unknown x 'brakng': did you mean 'braking'?"),
        (
            "inlet.stuck",
            ["i_set.stuck", "angle.stuck", "inlet.stuck-open", "inlet.stuck-closed"],
            "did you mean 'inlet.stuck-closed', 'inlet.stuck-open', 'i_set.stuck'?",
        ),
        ("zzz", ["b", "a"], "unknown x 'zzz': valid names are a, b"),
        ("zzz", [], "unknown x 'zzz': no names are defined here"),
        ("zzz", [f"name{k:02}" for k in range(20)], "and 8 more"),
        ("a" * 10_000, ["b"], "aaa...': valid names are b"),
    ],
)
def test_unknown_name(name, known, text):
    error = unknown_name("x", name, known)
    assert isinstance(error, UnknownNameError)
    assert text in str(error)
    assert len(str(error)) < 300


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("9 mm", "'9 mm'"),
        ("a\nb\x1b", r"'a\nb\x1b'"),
        ("x" * 99, repr("x" * 60 + "...")),
        ([1, 2], "[1, 2]"),
        (list(range(99)), str(list(range(99)))[:60] + "..."),
        (10**999, "a number of 300 digits or more"),
        ([10**9999], "a list"),
        (None, "None"),
        (True, "true"),
        (date(2010, 5, 27), "2010-05-27"),
        ([datetime(2010, 5, 27, 12, 30)], "[2010-05-27T12:30:00]"),
        ({"kind": "normal", "a b": [False, 0.5]}, "{ kind = 'normal', 'a b' = [false, 0.5] }"),
        ({}, "{}"),
    ],
    ids=range(13),
)
def test_quoted(value, text):
    assert quoted(value) == text


def test_quoting_endless_nesting():
    value: list[Any] = []
    for _ in range(100_000):
        value = [value]
    assert quoted(value) == "a list"
    while value:  # taken apart by hand: the interpreter would recurse
        value = value.pop()


class Speeds(NamedTuple):
    """Some signals."""

    v: Annotated[float, Signal("m/s", "speed")]


class Forces(NamedTuple):
    """Others."""

    F: Annotated[float, Signal("N", "force")]


def test_joined_tuples_have_all_fields_and_refuse_a_name_that_both_have():
    both = joined(__name__, "Both", Speeds, Forces)
    assert both(F=2.0, v=1.0)._asdict() == {"v": 1.0, "F": 2.0}
    assert signals_of(both) == {**signals_of(Speeds), **signals_of(Forces)}
    assert both.__module__ == __name__
    with raises(ModelError, name="Speeds.v"):
        joined(__name__, "Both", Speeds, Forces, Speeds)
