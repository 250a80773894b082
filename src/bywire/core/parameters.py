"""Parameter sets, which are frozen, validated trees of physical values and structural choices."""

from __future__ import annotations

import ast
import inspect
import math
import re
import sys
import typing
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache, cached_property, lru_cache, partial
from itertools import chain
from operator import attrgetter
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Self, TypeVar, cast, overload

import numpy as np
from annotated_types import Ge, Gt, Le, Lt, MultipleOf
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo

from bywire.core.errors import (
    InputError,
    ModelError,
    ParameterError,
    counted,
    not_valid,
    place_of,
    quoted,
    unknown_name,
)
from bywire.core.quantities import Unit, display_unit, readable_unit
from bywire.core.several import DifferError, Several
from bywire.core.units import Written, convert, shown, split, written_unit

if TYPE_CHECKING:
    from pydantic import ValidationError


@dataclass(frozen=True)
class Leaf:
    """Description of one number of a parameter set."""

    name: str
    unit: Unit
    low: float
    high: float
    low_open: bool
    high_open: bool
    is_whole: bool = False
    """whether the value must be a whole number"""

    def admits(self, value: float) -> bool:
        """Return whether a value [SI] is in the valid range."""
        above = value > self.low if self.low_open else value >= self.low
        return above and (value < self.high if self.high_open else value <= self.high)

    def admit(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return whether each value [SI] is in the valid range."""
        above = values > self.low if self.low_open else values >= self.low
        return above & (values < self.high if self.high_open else values <= self.high)

    @property
    def range_text(self) -> str:
        """Valid range as text, each bound in its most readable unit, for example ``> 0 ohm``."""
        symbol = self.unit.symbol
        return self.bounds_text(partial(shown, symbol=symbol)) or _any_number(display_unit(symbol))

    def range_in(self, unit: str) -> str:
        """Return the valid range in a unit of the same dimension.

        Raises
        ------
        UnitError
            When the unit has another dimension.
        """
        write = partial(shown, symbol=self.unit.symbol, unit=unit)
        return self.bounds_text(write) or _any_number(unit)

    def range_beside(self, text: str) -> str:
        """Return the valid range in the unit of a text, for example ``>= 0 ms`` for ``"-5 ms"``."""
        unit = written_unit(text, self.unit.symbol)
        return self.range_in(unit) if unit else self.range_text

    def bounds_text(self, write: Callable[[float], str]) -> str:
        """Return the bounds, each written by a function; empty without bounds."""
        if self.low == self.high:
            return f"exactly {write(self.low)}"
        bounds = (
            (">" if self.low_open else ">=", self.low),
            ("<" if self.high_open else "<=", self.high),
        )
        return " and ".join(f"{sign} {write(end)}" for sign, end in bounds if not math.isinf(end))

    def outside_text(self, value: object, text: str = "") -> tuple[str, str]:
        """Return an invalid value [SI] and the valid range in one unit.

        ``text``: original text of the value, whose unit both use if it fits; by default, the unit
        is the value's most readable one.
        """
        symbol = self.unit.symbol
        try:
            number = math.nan if isinstance(value, bool) else float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError, OverflowError):
            number = math.nan
        if math.isinf(number) and self.bounds_text(str) and self.admits(number):
            return quoted(value), f"finite and {self.range_text}"
        if not math.isfinite(number):
            return quoted(value), self.range_text
        unit = written_unit(text, symbol) or readable_unit(number, symbol)
        written = shown(number, symbol, unit)
        if self.admits(convert(float(split(written)[0]), unit, symbol)):  # rounded into the range
            written = f"{convert(number, symbol, unit)!r}{_spaced(unit)}"
        return written, self.range_in(unit)


def _any_number(unit: str) -> str:
    return f"any finite number{_spaced(unit) and ' in' + _spaced(unit)}"


def _spaced(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


# --- Parameter sets
# A *leaf* is a number with a unit. Its dotted name (``motor.R_m``) is the same in Python, in bench
# files, in recordings and on the command line. A *choice* is a field that selects equations
# (``gear.law = "directional"``). It affects the compiled code but never a value.
#
# Studies and searches create thousands of sets per second that differ in the same few names.

S = TypeVar("S", bound=BaseModel)

KNOWN = "_known"
"""attributes in which a set caches its content by name"""


def fields_of(node: BaseModel) -> dict[str, Any]:
    """Return a set's fields by name, in order, without cached values."""
    kept, names = node.__dict__.copy(), _field_names(type(node))
    kept.pop(KNOWN, None)
    return kept if len(kept) == len(names) else {name: kept[name] for name in names}


@cache
def _field_names(cls: type[BaseModel]) -> tuple[str, ...]:
    return tuple(cls.model_fields)


def read(node: BaseModel, names: tuple[str, ...]) -> dict[str, Any]:
    """Return the values at dotted names."""
    return dict(zip(names, _reader(names)(node), strict=True))


@lru_cache(maxsize=256)
def _reader(names: tuple[str, ...]) -> Callable[[Any], tuple[Any, ...]]:
    each = attrgetter(*names)
    return each if len(names) > 1 else lambda node: (each(node),)


class Places(NamedTuple):
    """Places of dotted names: fields of the set, and places in its groups."""

    fields: tuple[tuple[str, str], ...]
    """field and dotted name"""
    groups: tuple[tuple[str, Places], ...]
    """field, and the places within its group"""

    @classmethod
    def of(cls, names: Sequence[str], prefix: str = "") -> Places:
        """Return the places of names that start with a group's prefix."""
        own: list[tuple[str, str]] = []
        groups: dict[str, list[str]] = {}
        for name in names:
            field, dot, _ = name.removeprefix(prefix).partition(".")
            if dot:
                groups.setdefault(field, []).append(name)
            else:
                own.append((field, name))
        inner = ((group, cls.of(each, f"{prefix}{group}.")) for group, each in groups.items())
        return cls(tuple(own), tuple(inner))

    def filled(self, node: S, values: Mapping[str, Any]) -> S:
        """Return a set with other values; if only groups change, check only the set's own rules.

        Raises
        ------
        ValueError
            When a value is not valid or violates a rule; pydantic's `ValidationError` is a
            subclass.
        AssertionError
            When an ``assert`` of an author fails.
        """
        fields = fields_of(node)
        for name, inner in self.groups:
            fields[name] = inner.filled(fields[name], values)
        for name, dotted in self.fields:
            fields[name] = values[dotted]
        rules = None if self.fields else _rules(type(node))
        if rules is None:
            return type(node).model_validate(fields)
        return _ruled(node, fields, rules)

    def joined(self, node: S, values: Mapping[str, Several]) -> S:
        """Return a set with the numbers of several cases, and check the rules of its groups.

        Raises
        ------
        DifferError
            When the groups have other validators than rules, or the cases differ in a rule.
        ValueError, AssertionError
            When a rule rejects all cases.
        """
        fields, rules = fields_of(node), _rules(type(node))
        bounded = all(_is_bound(note) for name, _ in self.fields for note in _notes(node, name))
        if rules is None or not bounded:
            raise DifferError(f"{type(node).__qualname__} needs single numbers")
        for name, inner in self.groups:
            fields[name] = inner.joined(fields[name], values)
        for name, dotted in self.fields:
            fields[name] = values[dotted]
        return _ruled(node, fields, rules)


def _ruled(node: S, fields: dict[str, Any], rules: Sequence[str]) -> S:
    """Return a copy of a set with other fields, after its rules."""
    copy = type(node).__new__(type(node))
    copy.__setstate__({**node.__getstate__(), "__dict__": fields})  # as pydantic's copy
    for rule in rules:
        copy = getattr(copy, rule)()
    return copy


def _notes(node: BaseModel, field: str) -> Sequence[Any]:
    """Return the constraints and other notes of a field."""
    return type(node).model_fields[field].metadata


def _is_bound(note: Any) -> bool:
    """Return whether a note is a unit, or a constraint that `Leaf` describes."""
    has_only_finite = vars(note) == {"allow_inf_nan": False} if hasattr(note, "__dict__") else False
    return isinstance(note, (Unit, Gt, Ge, Lt, Le)) or has_only_finite


@cache
def _rules(cls: type[BaseModel]) -> tuple[str, ...] | None:
    """Return the rules of a class between valid groups, or None if it has other validators."""
    known, groups = cls.__pydantic_decorators__, cls.model_fields.values()
    judges = known.model_validators
    does_more = (
        known.validators
        or known.field_validators
        or known.root_validators
        or cls.__pydantic_custom_init__
        or cls.__pydantic_post_init__
        or cls.__private_attributes__
        or any(each.info.mode != "after" for each in judges.values())
        or any(len(inspect.signature(getattr(cls, name)).parameters) != 1 for name in judges)
        or any(each.metadata for each in groups if _is_group(each.annotation))
    )
    return None if does_more else tuple(judges)


def _is_group(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


# --- Errors for invalid values, with one line for each value


class RuleError(ValueError):
    """Error of a parameter class's validator for two values that contradict each other.

    Parameters
    ----------
    name
        Field of the class that must change.
    value
        Value of the field, with its unit.
    valid
        Valid values, given the other values; ends the sentence "it must be ...".
    reason
        Reason or next step; may be empty.

    Examples
    --------
    >>> print(RuleError("l_f", "1.6 m", "< the wheelbase L = 1.4 m").error_in("body"))
    body.l_f = 1.6 m must be < the wheelbase L = 1.4 m
    """

    def __init__(self, name: str, value: str, valid: str, reason: str = "") -> None:
        super().__init__(f"{name} = {value} must be {valid}{reason and f': {reason}'}")
        self.name, self.value, self.valid = name, value, valid

    def error_in(self, group: str) -> ParameterError:
        """Return the error for the user, with the field's dotted name."""
        prefix = f"{group}." if group else ""
        return ParameterError(
            f"{prefix}{self}", name=prefix + self.name, value=self.value, valid=self.valid
        )


_BOOL, _TEXT = "it must be true or false", "it must be a string"
_PLAIN_WORDS = {"bool_parsing": _BOOL, "bool_type": _BOOL, "string_type": _TEXT}


def refusal(
    error: ValidationError, owner: str, leaves: Mapping[str, Leaf], texts: Mapping[str, str]
) -> InputError:
    """Return a single error for all invalid values, with one line for each value.

    Parameters
    ----------
    error
        Pydantic's error.
    owner
        Name of the parameter class.
    leaves
        The class's numbers by dotted name.
    texts
        Original texts of numbers, by dotted name.
    """
    details: list[dict[str, Any]] = [dict(detail) for detail in error.errors()]
    places = {detail["loc"][:-1] for detail in details}
    # Pydantic also reports a table with an invalid node as too short. Report only the node.
    details = [d for d in details if not (_is_length(d) and d["loc"] in places)]
    each = [_explain(detail, owner, leaves, texts) for detail in details]
    if len(each) == 1:
        return each[0]
    names, values, valid = (
        "\n".join(getattr(error, field) for error in each) for field in ("name", "value", "valid")
    )
    return ParameterError("\n".join(map(str, each)), name=names, value=values, valid=valid)


def _explain(
    detail: Mapping[str, Any], owner: str, leaves: Mapping[str, Leaf], texts: Mapping[str, str]
) -> InputError:
    name = ".".join(str(part) for part in detail["loc"])
    value, kind = detail["input"], detail["type"]
    if kind == "missing":
        return ParameterError(f"{owner}: {name} is missing. Add a value", name=name)
    if kind == "literal_error":
        return _unknown_choice(name, value, detail["ctx"]["expected"])
    leaf = leaves.get(name) or leaves.get(name.rpartition(".")[0])
    if leaf is not None and kind != "value_error" and not _is_length(detail):
        is_broken = leaf.is_whole and (kind.startswith("int") or kind == "multiple_of")
        kind_text = "a whole number, " if is_broken else ""
        return _out_of_range(name, value, leaf, kind_text, texts.get(name, ""))
    if _is_length(detail):
        return _wrong_count(name, detail, texts)
    rule = detail.get("ctx", {}).get("error")
    if isinstance(rule, RuleError):
        return rule.error_in(name)
    message = _PLAIN_WORDS.get(kind, str(detail["msg"]).removeprefix("Value error, "))
    got = "" if isinstance(value, dict) else quoted(value)
    text = f"{name or owner}: {message}{got and f', got {got}'}"
    return ParameterError(text, name=name or owner, value=got)


def _out_of_range(name: str, value: Any, leaf: Leaf, kind: str, text: str) -> InputError:
    """Return the error for an invalid number, in the unit that the user wrote, if it fits."""
    written, valid = leaf.outside_text(value, text)
    is_clear = not split(text)[1] or written_unit(text, leaf.unit.symbol)
    return not_valid(name, written, kind + valid, "" if is_clear else f"got {quoted(text)}")


def _wrong_count(name: str, detail: Mapping[str, Any], texts: Mapping[str, str]) -> InputError:
    """Return the error for a table with too few or too many nodes."""
    context, value = detail["ctx"], detail["input"]
    short = detail["type"] == "too_short"
    least, most = context.get("min_length", 0), context.get("max_length", 0)
    valid = f"at least {counted(least, 'value')}" if short else f"at most {counted(most, 'value')}"
    written = [texts.get(f"{name}.{k}", "") for k in range(len(value))]
    got = quoted(", ".join(written)) if written and all(written) else quoted(value)
    text = f"{name} must have {valid}, got {got}"
    return ParameterError(text, name=name, value=got, valid=valid)


def _is_length(detail: Mapping[str, Any]) -> bool:
    return detail["type"] in ("too_short", "too_long")


def _unknown_choice(name: str, value: Any, expected: str) -> InputError:
    near = get_close_matches(quoted(value), re.findall(r"'[^']*'", expected), n=1, cutoff=0.6)
    hint = f": did you mean {near[0]}?" if near else ""
    text = f"{name} must be {expected}, got {quoted(value)}{hint}"
    return ParameterError(text, name=name, value=quoted(value), valid=expected)


# --- Parameter sets

T = TypeVar("T", bound="ParameterSet")


_SIMPLE = {float, str}  # types that do not depend on the notation
_OBJECTS = "_carries_objects"  # in the __dict__ of a set whose leaves may be other objects


class ParameterSet(BaseModel):
    """Base of all parameter sets, which are immutable, without unknown keys or silent defaults."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        validate_default=True,
        ser_json_inf_nan="constants",
    )

    @classmethod
    def create(cls, values: Mapping[str, Any]) -> Self:
        """Build the set from values by dotted name; errors quote the text of `Written` numbers.

        Raises
        ------
        ParameterError
            When a value is invalid; the message contains field, value, unit and valid range.
        UnknownNameError
            When a name is unknown; the message contains the nearest valid names.
        """
        return _validated(cls, {}, values)

    def replace(self, values: Mapping[str, Any]) -> Self:
        """Return a copy with other values at dotted names, which validates the affected groups.

        If nothing changes, the result is the set itself. A set that contains objects other than
        numbers (`with_leaves`) is not validated.
        """
        if _OBJECTS in self.__dict__:
            return cast(Self, _as_given(self, "", values))
        numbers, choices = self._by_name("numbers"), self._by_name("choices")
        if _are_there(values, numbers, choices):
            return self
        copy = _exchanged(self, values)
        # All other values are cached, because thousands of sets per second differ in few values.
        given = read(copy, tuple(values))
        new = {name: value for name, value in given.items() if type(value) is float}
        chosen = {name: value for name, value in given.items() if type(value) is str}
        if (
            len(new) + len(chosen) == len(given)
            and new.keys() <= numbers.keys()
            and chosen.keys() <= choices.keys()
        ):
            copy.__dict__[KNOWN] = {
                ("numbers", ""): numbers | new,
                ("choices", ""): choices | chosen if chosen else choices,
            }
        return copy

    def with_columns(self, columns: Mapping[str, NDArray[np.float64]]) -> Self:
        """Return a set with the numbers of several cases, checked as in `replace`.

        Parameters
        ----------
        columns
            Value in each case [SI] by dotted name, shape (cases,) each.

        Raises
        ------
        DifferError
            When a value is invalid, or when only single numbers can be checked.
        """
        leaves = leaf_fields(type(self))
        for name, column in columns.items():
            leaf = leaves.get(name)
            if leaf is None or leaf.is_whole or type(self.value(name)) is not float:
                raise DifferError(f"{name} is not a number")
            is_valid = leaf.admit(column) & np.isfinite(column)
            if not is_valid.all():
                raise DifferError(f"{name} is invalid in some cases", is_valid)
        try:
            places = _places(type(self), tuple(columns))
            joined = places.joined(self, {n: Several(c) for n, c in columns.items()})
            return cast(Self, _with_objects(joined))
        except (ValueError, AssertionError) as error:
            raise DifferError(f"a rule rejects all cases ({error})") from None

    def flat(self) -> dict[str, Any]:
        """Return all leaves and choices by dotted name."""
        return dict(self._by_name("values"))

    def leaves(self) -> dict[str, float]:
        """Return the numbers by dotted name; a table becomes ``name.0``, ``name.1``, ..."""
        return dict(self._by_name("numbers"))

    def choices(self) -> dict[str, Any]:
        """Return the structural choices by dotted name, including the length of each table."""
        return dict(self._by_name("choices"))

    def has_choices_of(self, other: ParameterSet) -> bool:
        """Return whether another set of this class has the same structural choices."""
        here, there = self._by_name("choices"), other._by_name("choices")
        return here is there or here == there

    def value(self, name: str) -> Any:
        """Return the leaf or choice with this dotted name; ``name.0`` is the node of a table."""
        value: Any = self
        for step in name.split("."):
            value = value[int(step)] if isinstance(value, tuple) else getattr(value, step)
        return value

    @cached_property
    def _known(self) -> dict[tuple[str, str], dict[str, Any]]:
        return {}

    def _by_name(self, kind: str, prefix: str = "") -> dict[str, Any]:
        """Return ``values``, ``numbers`` or ``choices`` by dotted name.

        ``prefix``: prefix of the names. Several sets can share a group, which caches its content.
        """
        known = self._known
        if (kind, prefix) not in known:
            named: dict[str, Any] = {}
            for name, value in fields_of(self).items():
                if isinstance(value, ParameterSet):
                    named.update(value._by_name(kind, f"{prefix}{name}."))
                else:
                    named.update(_entries(kind, prefix + name, value))
            known[kind, prefix] = named
        return known[kind, prefix]

    def with_leaves(self, values: Mapping[str, Any]) -> Self:
        """Return a set of the same structure with other objects as its numbers.

        All other values stay the same. The objects (symbols, quantities with units) are not
        validated. They are for the evaluation of equations.
        """
        return cast(Self, _with_objects(_rebuilt(self, "", values)))


def leaf_table(pars: Sequence[ParameterSet]) -> NDArray[np.float64]:
    """Return the numbers of sets with the same structure, shape (sets, leaves); see `leaves`.

    Raises
    ------
    TypeError, ValueError
        When they contain objects other than numbers.
    """
    if isinstance(pars, ParameterTable):
        return pars.table
    each = [par._by_name("numbers").values() for par in pars]
    shape = (len(each), len(each[0]))
    return np.fromiter(chain.from_iterable(each), np.float64, math.prod(shape)).reshape(shape)


class ParameterTable(Sequence[ParameterSet]):
    """Sets of the same structure as rows of a table, built on demand.

    Parameters
    ----------
    first
        The first set.
    table
        Numbers of all sets, shape (sets, leaves); see `ParameterSet.leaves`.
    build
        ``build(k)``: one of the sets.
    """

    def __init__(
        self,
        first: ParameterSet,
        table: NDArray[np.float64],
        build: Callable[[int], ParameterSet],
    ) -> None:
        self.first, self.table, self._build = first, table, build

    def __len__(self) -> int:
        return len(self.table)

    @overload
    def __getitem__(self, k: int) -> ParameterSet: ...

    @overload
    def __getitem__(self, k: slice) -> Sequence[ParameterSet]: ...

    def __getitem__(self, k: int | slice) -> ParameterSet | Sequence[ParameterSet]:
        if isinstance(k, slice):
            return [self[each] for each in range(len(self))[k]]
        return self.first if k == 0 else self._build(range(len(self))[k])


@cache
def leaf_fields(cls: type[ParameterSet], prefix: str = "") -> Mapping[str, Leaf]:
    """Return the description of each number of a parameter class, by dotted name."""
    leaves: dict[str, Leaf] = {}
    for name, info in cls.model_fields.items():
        dotted = f"{prefix}{name}"
        inner = info.annotation
        if isinstance(inner, type) and issubclass(inner, ParameterSet):
            leaves |= leaf_fields(inner, f"{dotted}.")
            continue
        unit = next((m for m in info.metadata if isinstance(m, Unit)), None)
        if unit is not None:
            leaves[dotted] = leaf_of(dotted, unit, info)
    return MappingProxyType(leaves)


@cache
def choice_fields(cls: type[ParameterSet], prefix: str = "") -> tuple[str, ...]:
    """Return the dotted names of all structural choices of a class."""
    choices: list[str] = []
    for name, info in cls.model_fields.items():
        dotted = f"{prefix}{name}"
        inner = info.annotation
        if isinstance(inner, type) and issubclass(inner, ParameterSet):
            choices += choice_fields(inner, f"{dotted}.")
        elif not any(isinstance(m, Unit) for m in info.metadata):
            choices.append(dotted)
    return tuple(choices)


def choices_of(cls: type[ParameterSet], name: str) -> tuple[Any, ...]:
    """Return the valid values of a structural choice; empty if any string is valid.

    The values are strings, or true and false.
    """
    *groups, last = name.split(".")
    for group in groups:
        cls = cast("type[ParameterSet]", cls.model_fields[group].annotation)
    annotation = cls.model_fields[last].annotation
    return (False, True) if annotation is bool else typing.get_args(annotation)


def require_units(cls: type[ParameterSet], prefix: str = "") -> None:
    """Reject a class with numbers that have no unit, which would be treated as structural choices.

    Raises
    ------
    ModelError
        When a number has no unit; the message contains the first one and its place.
    """
    for name, info in cls.model_fields.items():
        inner = info.annotation
        if isinstance(inner, type) and issubclass(inner, ParameterSet):
            require_units(inner, f"{prefix}{name}.")
        elif inner in (float, int) and not any(isinstance(m, Unit) for m in info.metadata):
            raise ModelError(
                f"{place_of(cls)}: {cls.__qualname__}.{name} is a number without a unit. Write "
                f'{name}: Annotated[float, Unit("kg")], "1" for a pure number, or a quantity '
                "of core.quantities",
                name=f"{cls.__qualname__}.{name}",
                valid='Annotated[float, Unit("kg")]',
            )


def leaf_of(dotted: str, unit: Unit, info: FieldInfo) -> Leaf:
    """Return the description of a number from a field's constraints."""
    low, high, low_open, high_open = -math.inf, math.inf, False, False
    is_whole = info.annotation is int
    for note in (*info.metadata, *_node_notes(info.annotation)):
        if isinstance(note, Gt):
            low, low_open = float(cast(float, note.gt)), True
        elif isinstance(note, Ge):
            low = float(cast(float, note.ge))
        elif isinstance(note, Lt):
            high, high_open = float(cast(float, note.lt)), True
        elif isinstance(note, Le):
            high = float(cast(float, note.le))
        elif isinstance(note, MultipleOf):
            is_whole = is_whole or float(cast(float, note.multiple_of)).is_integer()
    return Leaf(dotted, unit, low, high, low_open, high_open, is_whole)


def _node_notes(annotation: Any) -> Iterator[Any]:
    """Yield the constraints on the nodes of a table, ``tuple[Annotated[float, ...], ...]``."""
    for node in typing.get_args(annotation)[:1]:
        for note in getattr(node, "__metadata__", ()):
            yield from note.metadata if isinstance(note, FieldInfo) else (note,)


def _entries(kind: str, name: str, value: Any) -> dict[str, Any]:
    """Return a field's content of one kind; see `ParameterSet._by_name`."""
    if kind == "values":
        return {name: value}
    if isinstance(value, tuple):
        spread = {f"{name}.{k}": float(v) for k, v in enumerate(value)}
        return spread if kind == "numbers" else {name: len(value)}
    if _is_number(value):
        return {name: float(value)} if kind == "numbers" else {}
    return {} if kind == "numbers" else {name: value}


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _rebuilt(node: ParameterSet, prefix: str, values: Mapping[str, Any]) -> ParameterSet:
    """Return a set of objects, in which groups without new objects are unchanged."""
    fields = fields_of(node)
    for name, value in fields.items():
        dotted = f"{prefix}{name}"
        if isinstance(value, ParameterSet):
            if any(each.startswith(f"{dotted}.") for each in values):
                fields[name] = _rebuilt(value, f"{dotted}.", values)
        elif isinstance(value, tuple):
            fields[name] = tuple(
                values.get(f"{dotted}.{k}", there) for k, there in enumerate(value)
            )
        elif _is_number(value):
            fields[name] = values.get(dotted, value)
    return type(node).model_construct(**fields)


def _as_given(node: ParameterSet, prefix: str, values: Mapping[str, Any]) -> ParameterSet:
    """Return a set of objects with other objects at dotted names."""
    fields: dict[str, Any] = {
        name: _as_given(value, f"{prefix}{name}.", values)
        if isinstance(value, ParameterSet)
        else values.get(prefix + name, value)
        for name, value in fields_of(node).items()
    }
    return _with_objects(type(node).model_construct(**fields))


def _with_objects(copy: ParameterSet) -> ParameterSet:
    copy.__dict__[_OBJECTS] = True
    return copy


def _require_known(cls: type[ParameterSet], name: str) -> None:
    leaves, choices = leaf_fields(cls), choice_fields(cls)
    if name not in leaves and name not in choices:
        raise unknown_name("parameter", name, (*leaves, *choices))


def _plain(name: str, value: Any, texts: dict[str, str]) -> Any:
    """Return a plain value, and store its original text by name."""
    if isinstance(value, tuple):
        return tuple(_plain(f"{name}.{k}", node, texts) for k, node in enumerate(value))
    if isinstance(value, Written):
        texts[name] = value.text
        return float(value)
    return value


def _are_there(
    values: Mapping[str, Any], numbers: Mapping[str, float], choices: Mapping[str, Any]
) -> bool:
    """Return whether the values at these names are plain numbers and strings."""
    for name, value in values.items():
        known = numbers if type(value) is float else choices if type(value) is str else {}
        if name not in known or known[name] != value:
            return False
    return True


@lru_cache(maxsize=256)  # the cases of a study differ in the same names
def _places(cls: type[ParameterSet], names: tuple[str, ...]) -> Places:
    """Return the places of dotted names, or raise an error for an unknown name."""
    for name in names:
        _require_known(cls, name)
    return Places.of(names)


def _exchanged(node: T, values: Mapping[str, Any]) -> T:
    """Return a set with other values at dotted names; see `ParameterSet.replace`."""
    if _SIMPLE.issuperset(map(type, values.values())):
        try:
            return _places(type(node), tuple(values)).filled(node, values)
        except (
            ValueError,
            AssertionError,
        ):  # the full validation below reports all errors together
            pass
    return _validated(type(node), fields_of(node), values)


def _validated(cls: type[T], tree: dict[str, Any], values: Mapping[str, Any]) -> T:
    """Build a set from a tree with other values at dotted names.

    It reuses unchanged groups, because searches and studies build thousands of sets per second.
    """
    texts: dict[str, str] = {}
    for name, value in values.items():
        _require_known(cls, name)
        *groups, last = name.split(".")
        node = tree
        for group in groups:
            inner = node.get(group, {})
            node[group] = fields_of(inner) if isinstance(inner, ParameterSet) else inner
            node = node[group]
        node[last] = _plain(name, value, texts)
    try:
        return cls.model_validate(tree)
    except ValidationError as error:
        raise refusal(error, cls.__name__, leaf_fields(cls), texts) from None


# --- Notes: the strings below the fields of a class
# They are read on demand, because reading sources during the creation of a class took a tenth of
# every command's startup time.


@cache
def field_notes(cls: type[ParameterSet], prefix: str = "") -> Mapping[str, str]:
    """Return the meaning of each number and choice of a parameter class, by dotted name.

    Parameters
    ----------
    cls
        Parameter class. A string below a field is its note. Without a string, the note is ``""``.
    prefix
        Prefix of all names.
    """
    written: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        if issubclass(base, ParameterSet) and base is not ParameterSet:
            written |= _written_under_fields(base)
    notes: dict[str, str] = {}
    for name, info in cls.model_fields.items():
        inner = info.annotation
        if isinstance(inner, type) and issubclass(inner, ParameterSet):
            notes |= field_notes(inner, f"{prefix}{name}.")
        else:
            notes[f"{prefix}{name}"] = written.get(name, "")
    return MappingProxyType(notes)


def _written_under_fields(cls: type) -> Mapping[str, str]:
    try:
        source = inspect.getsource(sys.modules[cls.__module__])
    except (KeyError, OSError, TypeError):  # typed into a console, so it has no source file
        return {}
    return _written_in(source).get(cls.__qualname__, {})


@cache
def _written_in(source: str) -> Mapping[str, Mapping[str, str]]:
    """Return the notes below the fields of all classes in a file, by qualified name.

    The notes are read together, because `inspect` would parse the whole file for each class.
    """
    return {name: _texts(definition) for name, definition in _classes(ast.parse(source))}


def _classes(node: ast.AST, prefix: str = "") -> Iterator[tuple[str, ast.ClassDef]]:
    """Yield the classes below a node with their qualified names."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.ClassDef):
            yield f"{prefix}{child.name}", child
            yield from _classes(child, f"{prefix}{child.name}.")
        elif isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from _classes(child, f"{prefix}{child.name}.<locals>.")
        elif not isinstance(child, ast.expr):  # a class may be inside a condition
            yield from _classes(child, prefix)


def _texts(definition: ast.ClassDef) -> Mapping[str, str]:
    """Return the strings directly below a class's fields, by field."""
    notes: dict[str, str] = {}
    for field, below in zip(definition.body, definition.body[1:], strict=False):
        match field, below:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(text))),
            ):
                notes[name] = inspect.cleandoc(text)
    return notes
