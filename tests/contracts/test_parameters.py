"""Contract: a parameter set survives JSON, and refuses what lies just outside its ranges."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

from bywire.core.errors import ParameterError
from bywire.core.leaf import Leaf
from bywire.core.parameters import ParameterSet, leaf_fields
from contracts.elements import modules, parameter_classes
from contracts.sampling import Case, combinations, is_table

CLASSES = {
    f"{cls.__module__.removeprefix('bywire.')}.{cls.__name__}": cls
    for module in modules()
    for cls in parameter_classes(module)
}
LEAVES = [(cls, name) for cls in CLASSES.values() for name in leaf_fields(cls)]
LEAF_IDS = [f"{name}.{leaf}" for name, cls in CLASSES.items() for leaf in leaf_fields(cls)]


def check_round_trip(cls: type[ParameterSet]) -> None:
    """Refuse a class whose JSON does not give the same set back."""
    for choices in combinations({"par": cls}):
        par = Case({"par": cls}, choices).sample()["par"]
        again = cls.model_validate_json(par.model_dump_json())
        assert again == par
        assert again.flat() == par.flat()


def check_range(cls: type[ParameterSet], name: str) -> None:
    """Refuse a class that takes a value outside the range of a leaf, without naming the leaf."""
    for value, message in refusals(cls, name):
        assert name in message, f"{name} is not named in {message!r}"
        assert str(value) in message, f"{value} is not named in {message!r}"


def check_message(cls: type[ParameterSet], name: str) -> None:
    """Refuse a refusal that does not say what would be taken."""
    leaf = leaf_fields(cls)[name]
    unit = "" if leaf.unit.symbol == "1" else f" {leaf.unit.symbol}"
    for value, message in refusals(cls, name):
        for part in (f"{value}{unit}", leaf.range_text):
            assert part in message, f"{part!r} is missing in {message!r}"


def refusals(cls: type[ParameterSet], name: str) -> Iterator[tuple[float, str]]:
    """Yield every value outside the range of a leaf, with the message that refuses it."""
    for choices in combinations({"par": cls}):
        par = Case({"par": cls}, choices).sample()["par"]
        for value in outside(leaf_fields(cls)[name]):
            wrong = (*par.flat()[name][:-1], value) if is_table(cls, name) else value
            yield value, refusal(par, name, wrong)


def outside(leaf: Leaf) -> Iterator[float]:
    """Yield what is no number, and the values nearest to the range that are not in it."""
    yield from (math.nan, math.inf, -math.inf)
    if math.isfinite(leaf.low):
        yield leaf.low if leaf.low_open else math.nextafter(leaf.low, -math.inf)
    if math.isfinite(leaf.high):
        yield leaf.high if leaf.high_open else math.nextafter(leaf.high, math.inf)


def refusal(par: ParameterSet, name: str, value: Any) -> str:
    """Return the message with which a set refuses a value."""
    try:
        par.replace({name: value})
    except ParameterError as error:
        return str(error)
    raise AssertionError(f"{type(par).__module__}: {name} = {value} was taken")


@pytest.mark.parametrize("name", CLASSES)
def test_json_gives_the_same_set_back(name: str) -> None:
    check_round_trip(CLASSES[name])


@pytest.mark.parametrize(("cls", "name"), LEAVES, ids=LEAF_IDS)
def test_value_outside_the_range_is_refused(cls: type[ParameterSet], name: str) -> None:
    check_range(cls, name)


@pytest.mark.parametrize(("cls", "name"), LEAVES, ids=LEAF_IDS)
def test_refusal_says_unit_and_range(cls: type[ParameterSet], name: str) -> None:
    check_message(cls, name)
