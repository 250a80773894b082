"""Named parameter sets with a source for each value."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any, Literal

from bywire.core.arguments import checked
from bywire.core.brake import brakes, loaded_files
from bywire.core.errors import ModelError, ParameterError
from bywire.core.parameters import ParameterSet, require_units
from bywire.core.registry import Kind, instances

Origin = Literal["paper", "derived", "chosen", "calibrated"]
Formula = Callable[[Any], Any]
"""``formula(par)``: a value computed from other values of a set, such as ``par.body.h``"""


@dataclass(frozen=True)
class Cited:
    """A parameter set's value with its provenance.

    Parameters
    ----------
    value
        Number, table or choice, in SI.
    kind
        ``paper``: printed in the source. ``derived``: computed from printed values.
        ``chosen``: our choice, without a source. ``calibrated``: tuned to match a statement in the
        source. The statement is then no longer treated as evidence.
    where
        Place in the source, or the reason.
    formula
        Formula of a derived value; None if it is not computed from the set's parameters.
    moved
        New places of the groups in the formula, by their original places.
    """

    value: Any
    kind: Origin
    where: str
    formula: Formula | None = field(default=None, compare=False)
    moved: Mapping[str, str] = field(default_factory=dict, compare=False)

    def computed(self, values: Mapping[str, Any]) -> tuple[Any, frozenset[str]]:
        """Return the formula's result for values by dotted name, and the names that it reads.

        The result is NaN if it is not finite.

        Raises
        ------
        ModelError
            When the formula reads an unknown parameter.
        """
        assert self.formula is not None
        read: set[str] = set()
        try:
            value = self.formula(_Values(values, self.moved, read))
        except (ArithmeticError, ValueError):  # overflow, division by zero, root below zero
            value = math.nan
        return value, frozenset(read)

    def moved_to(self, places: Mapping[str, str]) -> Cited:
        """Return the value for a set whose groups have other places.

        ``{"": "rear"}``: all groups move into one group, for a set within another set.
        """
        return self if self.formula is None else replace(self, moved=places)


class _Values:
    """Values by attribute, as in a parameter set, which records the names that a formula reads."""

    def __init__(
        self, values: Mapping[str, Any], moved: Mapping[str, str], read: set[str], place: str = ""
    ) -> None:
        self._values, self._moved, self._read, self._place = values, moved, read, place

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        place = f"{self._place}.{name}" if self._place else name
        there = _moved(place, self._moved)
        if there in self._values:
            self._read.add(there)
            return self._values[there]
        groups = (f"{there}.", f"{place}.")
        if not any(each.startswith(groups) for each in (*self._values, *self._moved)):
            raise ModelError(
                f"a formula of a derived value reads {there}, which is not in the set", name=there
            )
        return _Values(self._values, self._moved, self._read, place)


def _moved(place: str, moved: Mapping[str, str]) -> str:
    """Return the new place of a value after groups have moved."""
    if "" in moved:
        return f"{moved['']}.{place}"
    for group, there in moved.items():
        if place == group or place.startswith(f"{group}."):
            return there + place[len(group) :]
    return place


@checked
def paper(value: Any, where: str) -> Cited:
    """Mark a value that is printed in the source."""
    return Cited(value, "paper", where)


@checked
def derived(value: Any, where: str) -> Cited:
    """Mark a value that is computed from other values.

    Parameters
    ----------
    value
        The value, or a formula that computes it from the set's parameters:
        ``derived(lambda par: 0.95 * par.body.g, "0.95 g")``. bywire warns if a bench changes the
        formula's parameters but not the value.
    where
        Origin of the value, for readers.
    """
    if callable(value):
        return Cited(None, "derived", where, value)
    return Cited(value, "derived", where)


@checked
def chosen(value: Any, where: str) -> Cited:
    """Mark a value that is our choice, with its reason."""
    return Cited(value, "chosen", where)


@checked
def calibrated(value: Any, where: str) -> Cited:
    """Mark a value that was tuned to match a statement of the source, with this statement."""
    return Cited(value, "calibrated", where)


# --- Parameter sets

_SAME = 1e-9  # relative tolerance of a derived value for rounding in its formula


@checked
@dataclass(frozen=True)
class CitedSet:
    """A named parameter set.

    Parameters
    ----------
    name
        Name in bench files and on the command line.
    assembly
        Name of the assembly.
    source
        Full citation; empty if the values have no source.
    summary
        One line for listings.
    parameter_class
        Class that validates the values.
    values
        All values by dotted name, with their provenance. A plain value is treated as chosen.
    """

    name: str
    assembly: str
    source: str
    summary: str
    parameter_class: type[ParameterSet]
    values: Mapping[str, Any]

    def __post_init__(self) -> None:
        require_units(self.parameter_class)
        plain = {k: v for k, v in self.values.items() if not isinstance(v, Cited)}
        cited = {k: chosen(v, "") for k, v in plain.items()}
        object.__setattr__(self, "values", _computed_values({**self.values, **cited}))
        object.__setattr__(self, "source", self.source or "not given")

    def parameters(self) -> ParameterSet:
        """Return the validated parameter set."""
        try:
            return self.parameter_class.create({k: c.value for k, c in self.values.items()})
        except ParameterError as error:
            raise error.at(f"parameter set {self.name!r}", ParameterError) from None


def _computed_values(values: Mapping[str, Cited]) -> dict[str, Cited]:
    """Return cited values, with derived values computed from their formulas.

    Raises
    ------
    ModelError
        When formulas depend on each other, or read an unknown parameter.
    """
    known = {name: each.value for name, each in values.items() if each.formula is None}
    waiting = {name: each for name, each in values.items() if each.formula is not None}
    while waiting:
        ready = {}
        for name, each in waiting.items():
            try:
                ready[name] = each.computed(_Known(known, waiting))[0]
            except KeyError:  # the formula reads a value that is not computed yet
                continue
        if not ready:
            names = ", ".join(sorted(waiting))
            raise ModelError(f"formulas of {names} depend on each other", name=names)
        known |= ready
        waiting = {name: each for name, each in waiting.items() if name not in ready}
    return {name: replace(each, value=known[name]) for name, each in values.items()}


class _Known(dict[str, Any]):
    """Values by name; a value that is not computed yet exists but cannot be read."""

    def __init__(self, known: Mapping[str, Any], waiting: Mapping[str, Any]) -> None:
        super().__init__({**dict.fromkeys(waiting), **known})
        self._waiting = waiting

    def __getitem__(self, name: str) -> Any:
        if name in self._waiting:
            raise KeyError(name)
        return super().__getitem__(name)


@dataclass(frozen=True)
class Outdated:
    """A derived value that no longer matches its formula.

    Parameters
    ----------
    name, where
        Name and origin of the value.
    now, formula
        Current value, and result of the formula [SI].
    changed
        Names of the changed parameters that the formula reads.
    """

    name: str
    where: str
    now: float
    formula: float
    changed: tuple[str, ...]


def outdated_values(
    cited: Mapping[str, Cited], par: ParameterSet, changed: Collection[str]
) -> list[Outdated]:
    """Return a set's derived values that no longer match their formulas after some changes.

    Parameters
    ----------
    cited
        The changed set's cited values.
    par
        All parameters, including the changed ones.
    changed
        Names of changed parameters. A derived value among them was changed on purpose.
    """
    found: list[Outdated] = []
    values: dict[str, Any] = {}
    for name, each in cited.items():
        if each.formula is None or name in changed:
            continue
        values = values or par.flat()
        value, read = each.computed(values)
        moved = tuple(sorted(read.intersection(changed)))
        if moved and not math.isclose(value, values[name], rel_tol=_SAME):
            found.append(Outdated(name, each.where, values[name], value, moved))
    return found


PARAMETER_SETS = Kind("parameter set", ("sets",), instances(CitedSet), declared="a CitedSet")
"""every parameter set of every brake"""


def main_set(assembly: str, beside: type | None = None) -> str:
    """Return the name of the first parameter set for an assembly.

    Parameters
    ----------
    assembly
        Name of the assembly.
    beside
        A class of the brake to search first, to avoid loading other brakes.

    Raises
    ------
    ModelError
        When there is no such set.
    """
    first = () if beside is None else (PARAMETER_SETS.beside(beside),)
    rest = (PARAMETER_SETS.of(brake.module) for brake in brakes().values())
    for sets in chain(first, rest):  # lazily, because each set loads its models
        for name, cited in sets.items():
            if cited.assembly == assembly:
                return name
    raise ModelError(
        f"there is no parameter set for a {assembly}. Declare a bywire.CitedSet for this assembly",
        name=assembly,
        valid="a bywire.CitedSet",
    )


def sets_of_loaded() -> tuple[str, ...]:
    """Return the names of the parameter sets of all brakes loaded by path.

    A user who loads a brake intends to use it, so its set is the default if it has only one set.
    """
    files = loaded_files()
    loaded = [brake.module for brake in brakes().values() if brake.file in files]
    return tuple(name for module in loaded for name in PARAMETER_SETS.of(module))


@checked
def parameters(name: str) -> ParameterSet:
    """Return a set's validated parameters.

    Parameters
    ----------
    name
        Name of the parameter set (see ``bywire list``).

    Returns
    -------
    ParameterSet
        The values by group, in SI units.

    Raises
    ------
    UnknownNameError
        With the nearest known names.
    """
    return PARAMETER_SETS.find(name).parameters()
