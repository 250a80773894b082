"""What the translator knows of a Python value: a Python object, C text, or a structure of both."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

Use = tuple[Any, ...]
"""what a C text needs: ("local", name), ("field", struct, name), ("call", function), ..."""
Uses = frozenset[Use]

PRIMARY, UNARY, PRODUCT, SUM, COMPARED, BOTH, EITHER, CHOICE = 16, 14, 13, 12, 10, 5, 4, 3
_PATH = re.compile(r"[A-Za-z_][\w.\[\]]*(->[\w.\[\]]+)*|[0-9][\w.]*(e[-+]?[0-9]+)?f?")


@dataclass(frozen=True)
class Expr:
    """A number, or a truth value, of the running ECU.

    Parameters
    ----------
    text
        C expression.
    level
        How tightly its last operator binds.
    uses
        What it needs.
    truth
        Whether it is a truth value.
    """

    text: str
    level: int = PRIMARY
    uses: Uses = frozenset()
    truth: bool = False

    def at(self, level: int) -> str:
        """Return the text as an operand of an operator, in parentheses where it needs them."""
        return self.text if self.level >= level else f"({self.text})"

    @property
    def is_path(self) -> bool:
        """Whether it is but a name, a field of one, or a literal."""
        return _PATH.fullmatch(self.text) is not None


@dataclass(frozen=True)
class Known:
    """A Python object that export knows; ``name`` is the constant of a module that it is."""

    value: Any
    name: str = ""


@dataclass(frozen=True)
class Record:
    """A NamedTuple that stands in a C variable or is a call's result."""

    cls: type[Any]
    expr: Expr
    pointer: bool = False


@dataclass(frozen=True)
class Built:
    """A NamedTuple that is made here, of values by field."""

    cls: type[Any]
    items: Mapping[str, Any]


@dataclass(frozen=True)
class Update:
    """A NamedTuple in a variable, with some fields replaced."""

    record: Record
    items: Mapping[str, Any]


@dataclass(frozen=True)
class Given:
    """The memory that a function was given, as it leaves it: by the name of its argument in C."""

    argument: str


@dataclass(frozen=True)
class Items:
    """A tuple or list of values."""

    values: tuple[Any, ...]


@dataclass(frozen=True)
class Table:
    """A dictionary of values by text."""

    items: Mapping[str, Any]


@dataclass(frozen=True)
class Array:
    """A table of a parameter set: numbers in a C array."""

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
    """Shape of a parameter that selects equations: its value."""

    value: Any


@dataclass(frozen=True)
class Shape:
    """Structure of a parameter set: its class, and the shape of every field."""

    cls: type[Any]
    fields: tuple[tuple[str, Any], ...]

    @property
    def by_name(self) -> dict[str, Any]:
        """Shapes by field."""
        return dict(self.fields)


@dataclass(frozen=True)
class Group:
    """A parameter set that stands in C.

    Parameters
    ----------
    expr
        Its place.
    pointer
        Whether the place is a pointer to it.
    origin
        Argument of the function that it belongs to, and the way from there; none where it is a
        variable.
    """

    shape: Shape
    expr: Expr
    pointer: bool
    origin: tuple[str, ...] = ()


@dataclass(frozen=True)
class BuiltGroup:
    """A parameter set that is made here."""

    cls: type[Any]
    items: Mapping[str, Any]


@dataclass(frozen=True)
class Method:
    """A method of a value, not called yet."""

    owner: Any
    name: str


@dataclass(frozen=True)
class Closure:
    """A function defined within a function: it is written out where it is called.

    Parameters
    ----------
    scope
        Variables around it.
    file, module
        Where it is written, and the names that it finds there.
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
    """Return a known NamedTuple, tuple or dictionary as a structure of values."""
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


# --- Memory that is changed in its place, where the laws return it as a new value

Site = tuple[str, int]
"""a change of memory: the C function in which it stands, and the how manieth it is there"""


@dataclass
class Memories:
    """Versions of the memory in a C function, by the place in which it stands.

    Python keeps a memory's old values beside the new ones; in C they are gone. What reads a version
    that is gone tells which change came too early: the next translation lets that change begin
    with a copy.

    Parameters
    ----------
    function
        Name of the C function.
    copied
        Changes that begin with a copy; what is found here is added.
    """

    function: str = ""
    copied: set[Site] = field(default_factory=set)
    versions: dict[str, int] = field(default_factory=dict)
    ended: dict[tuple[str, int], Site] = field(default_factory=dict)
    changes: int = 0

    def at(self, cls: type[Any], place: str, pointer: bool) -> Record:
        """Return the memory as it stands in a place now."""
        version = self.versions.setdefault(place, 0)
        uses = frozenset({("local", place), ("version", place, version)})
        return Record(cls, Expr(place, uses=uses), pointer)

    def stays(self, place: str) -> bool:
        """Return whether the next change of a place is made there, without a copy before it."""
        self.changes += 1
        site = (self.function, self.changes)
        if site in self.copied:
            return False
        self.ended[place, self.versions[place]] = site
        return True

    def changed(self, place: str) -> None:
        """Count a change of a place."""
        self.versions[place] += 1

    def versions_in(self, uses: Iterable[Use]) -> list[Use]:
        """Return what of a text's needs are versions of memory."""
        return [use for use in uses if use[0] == "version"]

    def read(self, uses: Iterable[Use]) -> None:
        """Let every version stay that a text reads."""
        for _, place, version in self.versions_in(uses):
            if self.versions[place] != version:
                self.copied.add(self.ended[place, version])

    def is_now(self, record: Record) -> bool:
        """Return whether a memory is what stands in its place now."""
        self.read(record.expr.uses)
        place = record.expr.text
        return ("version", place, self.versions[place]) in record.expr.uses

    def keep(self, place: str) -> None:
        """Let a place stay as it was at first."""
        if self.versions[place]:
            self.copied.add(self.ended[place, 0])
