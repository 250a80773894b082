"""Contracts of a parameter set: it survives JSON, and refuses what lies just outside its ranges."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

from bywire.contracts.evidence import Evidence, Place, field_place, place_of
from bywire.contracts.sampling import Sampler, combinations, is_table
from bywire.core.errors import ParameterError
from bywire.core.parameters import Leaf, ParameterSet, leaf_fields

Class = type[ParameterSet]


def samples(cls: Class) -> Iterator[ParameterSet]:
    """Yield a sample of a class for every combination of its choices."""
    for choices in combinations({"par": cls}):
        yield Sampler({"par": cls}, choices).sample()["par"]


def survives_json(cls: Class) -> Iterator[Evidence]:
    """Find whether the JSON of samples of a class gives the same sets back."""
    for par in samples(cls):
        yield set_survives_json(par)


def set_survives_json(par: ParameterSet) -> Evidence:
    """Find whether the JSON of a set gives the same set back."""
    again = type(par).model_validate_json(par.model_dump_json())
    before, after = par.flat(), again.flat()
    lost = [name for name in before if before[name] != after.get(name)]
    kept = again == par and not lost
    text = "its JSON gives the same set back" if kept else f"JSON changes {', '.join(lost)}"
    return Evidence(kept, text)


def keeps_its_ranges(cls: Class) -> Iterator[Evidence]:
    """Find whether samples of a class refuse what lies outside the range of any number."""
    for par in samples(cls):
        for name in leaf_fields(cls):
            yield from refuses_outside(par, name, _says_both)


def set_keeps_its_ranges(par: ParameterSet) -> Iterator[Evidence]:
    """Find whether a set refuses what lies outside the range of any of its numbers."""
    for name in leaf_fields(type(par)):
        if not is_table(type(par), name) or par.flat()[name]:
            yield from refuses_outside(par, name, _says_which)


def _says_which(leaf: Leaf, value: float) -> tuple[str, ...]:
    return leaf.name, str(value)


def _says_range(leaf: Leaf, value: float) -> tuple[str, ...]:
    unit = "" if leaf.unit.symbol == "1" else f" {leaf.unit.symbol}"
    return f"{value}{unit}", leaf.range_text


def _says_both(leaf: Leaf, value: float) -> tuple[str, ...]:
    return *_says_which(leaf, value), *_says_range(leaf, value)


def refuses_outside(
    par: ParameterSet, name: str, wanted: Callable[[Leaf, float], tuple[str, ...]]
) -> Iterator[Evidence]:
    """Find whether a set refuses every value nearest to the range of a number but not in it.

    Parameters
    ----------
    name
        Dotted name of the number, or of a table of them.
    wanted
        ``wanted(leaf, value)``: what the message has to contain.
    """
    leaf = leaf_fields(type(par))[name]
    place = _declared_at(type(par), name)
    for value in outside(leaf):
        wrong = (*par.flat()[name][:-1], value) if is_table(type(par), name) else value
        message = refusal(par, name, wrong)
        if message is None:
            text = f"{name} = {value!r} was taken; admissible is {leaf.range_text}"
            if not math.isfinite(value):
                text += ": write allow_inf_nan=False in its Field"
            yield Evidence(False, text, place=place)
            continue
        lacking = [part for part in wanted(leaf, value) if part not in message]
        said = f"{lacking[0]!r} is missing in {message!r}" if lacking else f"{name} keeps its range"
        yield Evidence(not lacking, said, place=place)


def outside(leaf: Leaf) -> Iterator[float]:
    """Yield what is no number, and the values nearest to the range that are not in it."""
    yield from (math.nan, math.inf, -math.inf)
    if math.isfinite(leaf.low):
        yield leaf.low if leaf.low_open else math.nextafter(leaf.low, -math.inf)
    if math.isfinite(leaf.high):
        yield leaf.high if leaf.high_open else math.nextafter(leaf.high, math.inf)


def refusal(par: ParameterSet, name: str, value: Any) -> str | None:
    """Return the message with which a set refuses a value; None where it takes it."""
    try:
        par.replace({name: value})
    except ParameterError as error:
        return str(error)
    return None


def _declared_at(cls: Class, name: str) -> Place:
    """Return the line that declares a number, in the class of its group."""
    *groups, last = name.split(".")
    for group in groups:
        inner = cls.model_fields[group].annotation
        if isinstance(inner, type) and issubclass(inner, ParameterSet):
            cls = inner
    return field_place(cls, last) if last in cls.model_fields else place_of(cls)
