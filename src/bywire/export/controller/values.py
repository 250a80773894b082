"""Values during the translation to C: Python objects, C text, or structures of both."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

Use = tuple[Any, ...]
"""dependency of a C text: ("local", name), ("field", struct, name), ("call", function), ..."""
Uses = frozenset[Use]

PRIMARY, UNARY, PRODUCT, SUM, COMPARED, BOTH, EITHER, CHOICE = 16, 14, 13, 12, 10, 5, 4, 3
_PATH = re.compile(r"[A-Za-z_][\w.\[\]]*(->[\w.\[\]]+)*|[0-9][\w.]*(e[-+]?[0-9]+)?f?")


@dataclass(frozen=True)
class Expr:
    """A number or a truth value of the running ECU.

    Parameters
    ----------
    text
        C expression.
    level
        Precedence of the expression's last operator.
    uses
        Dependencies of the expression.
    truth
        Whether the value is a truth value.
    """

    text: str
    level: int = PRIMARY
    uses: Uses = frozenset()
    truth: bool = False

    def at(self, level: int) -> str:
        """Return the text as an operand of an operator, in parentheses if necessary."""
        return self.text if self.level >= level else f"({self.text})"

    @property
    def is_path(self) -> bool:
        """Whether the text is only a name, a field of a structure, or a literal."""
        return _PATH.fullmatch(self.text) is not None


@dataclass(frozen=True)
class Known:
    """A Python object known at export; ``name`` is the name of a module's constant."""

    value: Any
    name: str = ""


@dataclass(frozen=True)
class Record:
    """A NamedTuple in a C variable, or the result of a call."""

    cls: type[Any]
    expr: Expr
    pointer: bool = False


@dataclass(frozen=True)
class Built:
    """A NamedTuple constructed here from values by field."""

    cls: type[Any]
    items: Mapping[str, Any]


@dataclass(frozen=True)
class Update:
    """A NamedTuple in a variable, with some fields replaced."""

    record: Record
    items: Mapping[str, Any]


@dataclass(frozen=True)
class Given:
    """The final state of a function's memory argument, by the argument's name in C."""

    argument: str


@dataclass(frozen=True)
class Items:
    """A tuple or list of values."""

    values: tuple[Any, ...]


@dataclass(frozen=True)
class Table:
    """A dictionary of values with string keys."""

    items: Mapping[str, Any]


@dataclass(frozen=True)
class Array:
    """A table of a parameter set as a C array of numbers."""

    expr: Expr
    length: int


@dataclass(frozen=True)
class Number:
    """Shape of a parameter that is a number."""


@dataclass(frozen=True)
class Nodes:
    """Shape of a parameter that is a table of numbers."""

    length: int


@dataclass(frozen=True)
class Choice:
    """Shape of a parameter that selects equations; the shape is its value."""

    value: Any


@dataclass(frozen=True)
class Shape:
    """Structure of a parameter set: its class, and the shape of each field."""

    cls: type[Any]
    fields: tuple[tuple[str, Any], ...]

    @property
    def by_name(self) -> dict[str, Any]:
        """Shape of each field."""
        return dict(self.fields)


@dataclass(frozen=True)
class Group:
    """A parameter set in C.

    Parameters
    ----------
    expr
        C expression of the parameter set.
    pointer
        Whether the expression is a pointer to the parameter set.
    origin
        The function's argument that contains the set, and the path from there; None for a variable.
    """

    shape: Shape
    expr: Expr
    pointer: bool
    origin: tuple[str, ...] = ()


@dataclass(frozen=True)
class BuiltGroup:
    """A parameter set constructed here."""

    cls: type[Any]
    items: Mapping[str, Any]


@dataclass(frozen=True)
class Method:
    """A method of a value before its call."""

    owner: Any
    name: str


@dataclass(frozen=True)
class Closure:
    """A function defined inside another function, which is inlined at each call.

    Parameters
    ----------
    scope
        Variables of the enclosing function.
    file, module
        Source file, and the names in the module.
    """

    node: ast.FunctionDef | ast.Lambda
    scope: Mapping[str, Any] = field(hash=False)
    file: str
    module: Mapping[str, Any] = field(hash=False)


def shape_of(group: Any) -> Shape:
    """Return the structure of a parameter set."""
    shapes: list[tuple[str, Any]] = []
    for name in type(group).model_fields:
        value = getattr(group, name)
        if hasattr(type(value), "model_fields"):
            shapes.append((name, shape_of(value)))
        elif isinstance(value, tuple):
            shapes.append((name, Nodes(len(value))))
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            shapes.append((name, Number()))
        else:
            shapes.append((name, Choice(value)))
    return Shape(type(group), tuple(shapes))


def is_named_tuple(value: Any) -> bool:
    """Return whether a value is a NamedTuple class."""
    return isinstance(value, type) and issubclass(value, tuple) and hasattr(value, "_fields")


def is_parameter_class(value: Any) -> bool:
    """Return whether a value is a class of parameters."""
    return isinstance(value, type) and hasattr(value, "model_fields")


def lifted(value: Any) -> Any:
    """Return a value; a known NamedTuple, tuple or dictionary becomes a structure of values."""
    if not isinstance(value, Known):
        return value
    known = value.value
    if is_named_tuple(type(known)):
        return Built(type(known), {n: Known(v) for n, v in known._asdict().items()})
    if isinstance(known, (tuple, list)):
        return Items(tuple(Known(each) for each in known))
    if isinstance(known, dict):
        return Table({name: Known(each) for name, each in known.items()})
    if is_parameter_class(type(known)):
        fields = type(known).model_fields
        return BuiltGroup(type(known), {n: Known(getattr(known, n)) for n in fields})
    return value


# --- Memory: the laws return new values, and the C code changes it in place

Site = tuple[str, int]
"""a change of memory: the C function that contains it, and its number there"""


@dataclass
class Memories:
    """Versions of the memory in a C function, by place.

    Python preserves old values of a memory, but C code overwrites them. If code reads an
    overwritten version, this class records the change that came too early. In the next translation,
    the change starts with a copy.

    Parameters
    ----------
    function
        Name of the C function.
    copied
        Changes that start with a copy. This translation adds to them.
    """

    function: str = ""
    copied: set[Site] = field(default_factory=set)
    versions: dict[str, int] = field(default_factory=dict)
    ended: dict[tuple[str, int], Site] = field(default_factory=dict)
    changes: int = 0

    def at(self, cls: type[Any], place: str, pointer: bool) -> Record:
        """Return the current version of the memory at a place."""
        version = self.versions.setdefault(place, 0)
        uses = frozenset({("local", place), ("version", place, version)})
        return Record(cls, Expr(place, uses=uses), pointer)

    def stays(self, place: str) -> bool:
        """Return whether the next change of a place happens in place, without a copy."""
        self.changes += 1
        site = (self.function, self.changes)
        if site in self.copied:
            return False
        self.ended[place, self.versions[place]] = site
        return True

    def changed(self, place: str) -> None:
        """Record a change of a place."""
        self.versions[place] += 1

    def versions_in(self, uses: Iterable[Use]) -> list[Use]:
        """Return the memory versions among a text's dependencies."""
        return [use for use in uses if use[0] == "version"]

    def read(self, uses: Iterable[Use]) -> None:
        """Preserve each version that a text reads."""
        for _, place, version in self.versions_in(uses):
            if self.versions[place] != version:
                self.copied.add(self.ended[place, version])

    def is_now(self, record: Record) -> bool:
        """Return whether a memory is the current version at its place."""
        self.read(record.expr.uses)
        place = record.expr.text
        return ("version", place, self.versions[place]) in record.expr.uses

    def keep(self, place: str) -> None:
        """Preserve the first version at a place."""
        if self.versions[place]:
            self.copied.add(self.ended[place, 0])
