"""Files of a source: parameter sets with the place of every value, statements, tolerances.

The statements of a source and the interpretations of its sentences are data in TOML files, next to
their brake. The table ``[places]`` contains texts that several entries share; entries refer to them
by their names in braces.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar, cast, get_args

from bywire.core.arguments import checked
from bywire.core.catalog import Cited, CitedSet, Formula, derived
from bywire.core.catalog import Origin as Provenance
from bywire.core.errors import InputError, ParameterError, unknown_name
from bywire.core.parameters import ParameterSet
from bywire.core.registry import pick
from bywire.core.units import convert
from bywire.data.toml_file import read_toml
from bywire.reproduction.item import Allowance, Fact, Kind

if TYPE_CHECKING:
    from bywire.bench.stated import StatedFigure, StatedLevel, StatedRange

T = TypeVar("T")
Section = Mapping[str, Any]
Groups = Mapping[str, Mapping[str, Cited]]
_NONE: Section = MappingProxyType({})
_PLACE = re.compile(r"\{(\w+)\}")
_AXIS = "the curve stays within the axis"


class SourceFile:
    """A file of a source.

    Parameters
    ----------
    file
        TOML file; the parameters of the functions below are the keys of its sections.
    places
        Additional texts to which the file refers by name in braces.

    Raises
    ------
    InputError
        For any invalid content, with the file's name in front.
    """

    def __init__(self, file: Path, places: Mapping[str, str] = _NONE) -> None:
        self._file = file
        content = read_toml(file, "source file")
        with _naming(self._file):
            content = _filled(content, {**content.get("places", {}), **places})
            self._sections = _made(_sections, content, "source file")
            self.citation: str = self._sections["citation"]
            """full citation of the source"""
            self.groups: Groups = {
                name: _cited_values(group, f"groups.{name}", _NONE, _NONE)
                for name, group in self._sections["groups"].items()
            }
            """values that several places of a set share"""
            self.allowances = {
                name: _made(Allowance, entry, f"tolerances.{name}")
                for name, entry in self._sections["tolerances"].items()
            }
            """tolerances by name"""
            self.facts = Facts(_facts(self._sections["statements"], self.allowances, "", _NONE))
            """statements by name"""

    def values(
        self, formulas: Mapping[str, Formula] = _NONE, groups: Groups = _NONE
    ) -> dict[str, Cited]:
        """Return the common values of the file's sets, by dotted name.

        Parameters
        ----------
        formulas
            Functions of a parameter set, by the names that derived values use.
        groups
            Additional groups of values.
        """
        groups = {**self.groups, **groups}
        with _naming(self._file):
            return _cited_values(self._sections["values"], "values", formulas, groups)

    def sets(
        self, parameter_class: type[ParameterSet], common: Mapping[str, Cited]
    ) -> tuple[CitedSet, ...]:
        """Return the parameter sets.

        Parameters
        ----------
        parameter_class
            Class that validates the values.
        common
            Values of every set that is not based on another one of the file.
        """
        found: dict[str, CitedSet] = {}
        with _naming(self._file):
            for k, entry in enumerate(self._sections["sets"], 1):
                each = _made(_set, entry, f"set {k}")
                base = pick(found, each["base"], "parameter set").values if each["base"] else common
                own = _cited_values(each["values"], f"set {k}", _NONE, self.groups)
                found[each["name"]] = CitedSet(
                    name=each["name"],
                    assembly=self._sections["assembly"],
                    source=self.citation,
                    summary=each["summary"],
                    parameter_class=parameter_class,
                    values={**base, **own},
                )
        return tuple(found.values())

    def levels(self) -> tuple[StatedLevel | StatedRange, ...]:
        """Return the statements that plots show as levels and ranges behind a signal's curve."""
        return self._shown(self._level, "levels")

    def figures(self) -> tuple[StatedFigure, ...]:
        """Return the statements that reports show next to a key figure."""
        return self._shown(self._figure, "figures")

    def _shown(self, make: Callable[..., T], section: str) -> tuple[T, ...]:
        with _naming(self._file):
            return tuple(
                _made(make, entry, f"{section}, entry {k}")
                for k, entry in enumerate(self._sections[section], 1)
            )

    def _level(
        self,
        name: str,
        of: str,
        experiment: str,
        signal: str,
        label: str,
        options: tuple[str, ...] = (),
        unit: str = "",
        to: str = "",
        where: str = "",
    ) -> StatedLevel | StatedRange:
        """Return a level, or a range from one statement to another."""
        from bywire.bench.stated import StatedLevel, StatedRange

        fact = self.facts[of]
        value = _in_unit(fact, fact.value, unit)
        if to:
            high = _in_unit(self.facts[to], self.facts[to].value, unit)
            return StatedRange(name, experiment, signal, value, high, label, where, tuple(options))
        around = _around(fact, unit)
        return StatedLevel(
            name, experiment, signal, value, label, _judged(fact), tuple(options), around
        )

    def _figure(
        self,
        name: str,
        of: str,
        experiment: str,
        figure: str,
        options: tuple[str, ...] = (),
        unit: str = "",
    ) -> StatedFigure:
        from bywire.bench.stated import StatedFigure

        fact = self.facts[of]
        return StatedFigure(
            name,
            experiment,
            figure,
            _in_unit(fact, fact.value, unit),
            _judged(fact),
            tuple(options),
            bound=fact.tolerance if isinstance(fact.tolerance, str) else "",
            tolerance=_around(fact, unit),
        )


@contextmanager
def _naming(file: Path) -> Iterator[None]:
    """Put a file's name in front of errors."""
    try:
        yield
    except InputError as error:
        raise error.reworded(f"{file}: {error}") from None


class Facts:
    """Statements by name; those of a table begin with its name: ``table1.beta``.

    Parameters
    ----------
    facts
        Names with statements.
    """

    def __init__(self, facts: Iterator[tuple[str, Fact]]) -> None:
        self._facts = dict(facts)

    def __getitem__(self, name: str) -> Fact:
        """Return the statement of a name; the error for an unknown name lists the closest names."""
        return pick(self._facts, name, "statement")

    def table(self, name: str) -> dict[str, Fact]:
        """Return the statements of a table by their names in the table."""
        prefix = f"{name}."
        return {k.removeprefix(prefix): v for k, v in self._facts.items() if k.startswith(prefix)}


# The keys of a section are the parameters of the function that reads it.


@checked
def _sections(
    citation: str = "",
    assembly: str = "",
    places: Mapping[str, str] = _NONE,
    groups: Section = _NONE,
    values: Section = _NONE,
    sets: tuple[Section, ...] = (),
    tolerances: Section = _NONE,
    statements: Section = _NONE,
    levels: tuple[Section, ...] = (),
    figures: tuple[Section, ...] = (),
) -> dict[str, Any]:
    return dict(locals())


@checked
def _set(name: str, summary: str, base: str = "", values: Section = _NONE) -> dict[str, Any]:
    return dict(locals())


@checked
def _statement(
    value: float,
    unit: str,
    where: str,
    read_as: str = "",
    kind: str = "",
    tolerance: str = "",
    note: str = "",
) -> tuple[Fact, str]:
    """Return a statement and the name of its tolerance; with ``read_as``, it is a reading."""
    kind = kind or ("reading" if read_as else "printed")
    if kind not in get_args(Kind):
        raise unknown_name("kind of statement", kind, get_args(Kind))
    where += f"; read as: {read_as}" if read_as else ""
    return Fact(float(value), unit, where, cast(Kind, kind), None, note), tolerance


def _made(make: Callable[..., T], entry: Section, place: str) -> T:
    """Return the result of a function for the keys of a section.

    Raises
    ------
    InputError
        For unknown keys, missing keys, and values of the wrong kind.
    """
    parameters = inspect.signature(make).parameters
    for key in entry:
        if key not in parameters:
            raise unknown_name(f"key of {place}", key, parameters)
    for key, parameter in parameters.items():
        if parameter.default is parameter.empty and key not in entry:
            raise ParameterError(f"{place}: {key} is missing", name=key)
    try:
        return make(**entry)
    except InputError as error:
        raise error.reworded(f"{place}: {error}") from None


def _filled(value: Any, places: Mapping[str, str]) -> Any:
    """Return the content of a file with names in braces replaced by their texts."""
    if isinstance(value, dict):
        return {key: _filled(each, places) for key, each in value.items()}
    if isinstance(value, list):
        return [_filled(each, places) for each in value]
    if isinstance(value, str):
        return _PLACE.sub(lambda match: pick(places, match[1], "place"), value)
    return value


def _cited_values(
    table: Section, place: str, formulas: Mapping[str, Formula], groups: Groups
) -> dict[str, Cited]:
    """Return the values of a table, of its group and of its subtables, by dotted name."""
    found: dict[str, Cited] = {}
    for name, entry in table.items():
        here = f"{place}.{name}"
        if name == "group" and isinstance(entry, str):
            found |= pick(groups, entry, f"{here}: group of values")
        elif not isinstance(entry, Mapping):
            raise ParameterError(
                f'{here} is not valid. Write {{ chosen = ..., where = "..." }}', name=here
            )
        elif "where" in entry:
            found[name] = _cited(entry, here, formulas)
        else:
            inner = _cited_values(entry, here, formulas, groups)
            found |= {f"{name}.{key}": value for key, value in inner.items()}
    return found


def _cited(entry: Section, place: str, formulas: Mapping[str, Formula]) -> Cited:
    kinds = (*get_args(Provenance), "formula")
    where, given = entry["where"], [key for key in entry if key != "where"]
    if len(given) != 1 or given[0] not in kinds or not isinstance(where, str):
        raise ParameterError(
            f"{place} needs exactly one of {', '.join(kinds)}, and a string for where",
            name=place,
            valid=", ".join(kinds),
        )
    if given == ["formula"]:
        return derived(pick(formulas, entry["formula"], f"{place}: formula"), where)
    value = entry[given[0]]
    return Cited(
        tuple(value) if isinstance(value, list) else value, cast(Provenance, given[0]), where
    )


def _facts(
    table: Section, allowances: Mapping[str, Allowance], name: str, outer: Section
) -> Iterator[tuple[str, Fact]]:
    """Yield statements; a table's own keys are defaults for its statements."""
    inherited = {**outer, **{k: v for k, v in table.items() if not isinstance(v, Mapping)}}
    tables = {k: v for k, v in table.items() if isinstance(v, Mapping)}
    if name and not tables:
        yield name, _fact(inherited, allowances, f"statements.{name}")
    for key, inner in tables.items():
        yield from _facts(inner, allowances, f"{name}.{key}" if name else key, inherited)


def _fact(entry: Section, allowances: Mapping[str, Allowance], place: str) -> Fact:
    fact, tolerance = _made(_statement, entry, place)
    if tolerance in ("", "<=", ">="):
        return replace(fact, tolerance=cast(Any, tolerance or None))
    return replace(fact, tolerance=pick(allowances, tolerance, f"{place}: tolerance"))


def _judged(fact: Fact) -> str:
    """Return the place of a statement, and the reason for its tolerance."""
    if isinstance(fact.tolerance, Allowance):
        return f"{fact.where}; tolerance ours: {fact.tolerance.reason}"
    return f"{fact.where}: {_AXIS}" if fact.kind == "axis" else fact.where


def _around(fact: Fact, unit: str) -> float:
    """Return the tolerance around the stated number in a unit; 0 if there is none."""
    if not isinstance(fact.tolerance, Allowance):
        return 0.0
    return _in_unit(fact, fact.tolerance.around(fact.value), unit)


def _in_unit(fact: Fact, value: float, unit: str) -> float:
    return convert(value, fact.unit, unit or fact.unit)
