"""Values in the translation of Python: Python objects, C text, or structures of both."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

Use = tuple[Any, ...]
"""dependencies of a C text: ("local", name), ("field", struct, name), ("call", function), ..."""
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
        Precedence of its last operator.
    uses
        Its dependencies.
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
        """Whether it is only a name, a field of one, or a literal."""
        return _PATH.fullmatch(self.text) is not None


@dataclass(frozen=True)
class Known:
    """A Python object known at export; ``name`` is that of the module's constant, if it is one."""

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
    """The memory argument of a function in its final state: by the argument's name in C."""

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
    """A parameter set in C.

    Parameters
    ----------
    expr
        Its place.
    pointer
        Whether the place is a pointer to it.
    origin
        The function's argument that contains it, and the path from there; None for a variable.
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
    """A method of a value, not called yet."""

    owner: Any
    name: str


@dataclass(frozen=True)
class Closure:
    """A function defined within a function: it is inlined where it is called.

    Parameters
    ----------
    scope
        Variables around it.
    file, module
        Its source file, and the names in its module.
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
"""a change of memory: the C function that contains it, and its number there"""


@dataclass
class Memories:
    """Versions of the memory in a C function, by its place.

    Python keeps old values of a memory; in C they are overwritten. When code reads an overwritten
    version, the change that came too early is recorded: the next translation lets this change begin
    with a copy.

    Parameters
    ----------
    function
        Name of the C function.
    copied
        Changes that begin with a copy; this translation adds to them.
    """

    function: str = ""
    copied: set[Site] = field(default_factory=set)
    versions: dict[str, int] = field(default_factory=dict)
    ended: dict[tuple[str, int], Site] = field(default_factory=dict)
    changes: int = 0

    def at(self, cls: type[Any], place: str, pointer: bool) -> Record:
        """Return the current version of the memory in a place."""
        version = self.versions.setdefault(place, 0)
        uses = frozenset({("local", place), ("version", place, version)})
        return Record(cls, Expr(place, uses=uses), pointer)

    def stays(self, place: str) -> bool:
        """Return whether the next change of a place is made in place, without a copy before it."""
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
        """Return the versions of memory among a text's dependencies."""
        return [use for use in uses if use[0] == "version"]

    def read(self, uses: Iterable[Use]) -> None:
        """Keep every version that a text reads."""
        for _, place, version in self.versions_in(uses):
            if self.versions[place] != version:
                self.copied.add(self.ended[place, version])

    def is_now(self, record: Record) -> bool:
        """Return whether a memory is the current version of its place."""
        self.read(record.expr.uses)
        place = record.expr.text
        return ("version", place, self.versions[place]) in record.expr.uses

    def keep(self, place: str) -> None:
        """Keep the first version of a place."""
        if self.versions[place]:
            self.copied.add(self.ended[place, 0])
