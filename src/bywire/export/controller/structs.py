"""C structures for NamedTuples, parameter sets and several results, with derived parameters.

A derived parameter is a member of its parameter set, next to the parameters. So a law for two
wheels has one for each wheel. ``NAME_ecu_derive`` updates derived parameters, and `values` computes
them during export.
"""

from __future__ import annotations

import ast
import operator
import re
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bywire.core import ops
from bywire.core.parameters import field_notes, leaf_fields
from bywire.core.signals import signal_in
from bywire.export.controller.c_text import Precision, c_name, unique
from bywire.export.controller.values import (
    PRIMARY,
    UNARY,
    Array,
    Built,
    BuiltGroup,
    Choice,
    Expr,
    Group,
    Known,
    Nodes,
    Number,
    Record,
    Shape,
    Update,
    Use,
    Uses,
    is_named_tuple,
    is_parameter_class,
    lifted,
    shape_of,
)

STEADY = frozenset({"local", "field", "own", "library", "constant"})
"""kinds of dependencies that derived parameters may have, without calls of laws"""
_EXACT = frozenset({"fabs", "sqrt", "fabsf", "sqrtf"})
_NAME = re.compile(r"(?<![\w.>])[A-Za-z_]\w*(->)?")
_NUMBER = re.compile(r"(?<![\w.])(\d+\.\d*(?:e[-+]?\d+)?|\d+e[-+]?\d+)f?")
_WORDS = {"+": "plus", "-": "minus", "*": "times", "/": "over"}
_NAMED = {"6.283185307179586": "two_pi", "3.141592653589793": "pi"}
_LONG = 40
_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    "sine": ops.sin,
    "cosine": ops.cos,
    "exponential": ops.exp,
    "logarithm": ops.log,
    "power_of": ops.power,
    "whole": ops.floor,
    "larger": ops.fmax,
    "smaller": ops.fmin,
    "fabs": ops.fabs,
    "fabsf": ops.fabs,
    "sqrt": ops.sqrt,
    "sqrtf": ops.sqrt,
}
_ARITHMETIC: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


@dataclass(frozen=True)
class Term:
    """A derived number in terms of the function that reads it.

    Parameters
    ----------
    holder
        The function's argument that contains the member.
    struct, member
        Structure, and its member for the number.
    """

    function: str
    holder: str
    struct: str
    member: str
    expr: Expr


@dataclass(frozen=True)
class Derived:
    """A derived number of one parameter set, from the root of all: ``par.PLACE = TEXT``."""

    place: str
    text: str
    uses: Uses

    @property
    def statement(self) -> str:
        """Assignment of the number in C."""
        return f"par->{self.place} = {re.sub(r'(?<![.])par[.]', 'par->', self.text)};"


@dataclass
class Derivations:
    """All derived terms of a translation, and the arguments of its functions.

    Parameters
    ----------
    refused
        Function and text of each term with two values for one member. This translation adds to
        them.
    """

    refused: set[tuple[str, str]] = field(default_factory=set)
    terms: list[Term] = field(default_factory=list)
    calls: dict[str, list[tuple[str, Mapping[str, Any]]]] = field(default_factory=dict)

    def member(
        self, function: str, holder: str, struct: str, expr: Expr, hint: str, taken: Iterable[str]
    ) -> str:
        """Return the name of a term's member; a new term gets a new member."""
        for each in self.terms:
            if (each.function, each.holder, each.expr.text) == (function, holder, expr.text):
                return each.member
        name = unique(c_name(hint or worded(expr.text)), {c_name(each) for each in taken})
        self.terms.append(Term(function, holder, struct, name, expr))
        return name

    def called(self, function: str, caller: str, arguments: Mapping[str, Any]) -> None:
        """Record a call."""
        self.calls.setdefault(function, []).append((caller, arguments))

    def _roots(self, function: str) -> Iterator[tuple[dict[str, str], Uses]]:
        """Yield the arguments of each call, in terms of the root of all parameters."""
        if function not in self.calls:
            yield {"par": "par"}, frozenset()
            return
        for caller, arguments in self.calls[function]:
            for outer, uses in self._roots(caller):
                inner = {}
                for name, value in arguments.items():
                    if isinstance(value, Expr):
                        inner[name] = rooted(value.text.removeprefix("&"), outer)
                        uses |= value.uses
                yield inner, uses

    def derived(self, uses: frozenset[Use]) -> list[Derived]:
        """Return the numbers to compute, in the order of their dependencies."""
        wanted, needs = [], set(uses)
        for term in reversed(self.terms):
            if ("field", term.struct, term.member) in needs:
                wanted.append(term)
                needs |= term.expr.uses
        made: dict[str, Derived] = {}
        for term in reversed(wanted):
            for roots, outer in self._roots(term.function):
                place = f"{roots[term.holder]}.{term.member}".removeprefix("par.")
                kept = frozenset(u for u in term.expr.uses | outer if u[0] in STEADY - {"local"})
                each = Derived(place, rooted(term.expr.text, roots), kept)
                if made.setdefault(place, each).text != each.text:
                    self.refused.add((term.function, term.expr.text))
        return list(made.values())


def is_exact(uses: Iterable[Use]) -> bool:
    """Return whether an expression has the same value wherever it is computed."""
    return all(u[0] in STEADY and (u[0] != "library" or u[1] in _EXACT) for u in uses)


def rooted(text: str, roots: Mapping[str, str]) -> str:
    """Return a text with the arguments of a function replaced by their values."""

    def replaced(found: re.Match[str]) -> str:
        name, arrow = found[0].removesuffix("->"), found[1]
        if name not in roots:
            return found[0]
        root = roots[name]
        is_path = re.fullmatch(r"[\w.]+", root) is not None
        return f"{root}." if arrow else root if is_path else f"({root})"

    return _NAME.sub(replaced, text)


def worded(text: str) -> str:
    """Return a name that describes an expression.

    Examples
    --------
    >>> worded("par->p_high - par->p_low")
    'p_high_minus_p_low'
    """
    words = []
    for part in re.findall(r"[A-Za-z_][\w.]*(?:->[\w.]+)*|[\d.]+(?:e[-+]?\d+)?|[-+*/]", text):
        last = re.split(r"->|[.](?=[A-Za-z_])", part)[-1]
        words.append({**_WORDS, **_NAMED}.get(part, last.removesuffix(".0").replace(".", "_")))
    name = "_".join(words)
    return name if len(name) <= _LONG else "term"


def values(
    derived: Iterable[Derived],
    par: Any,
    constants: Mapping[str, float],
    number: Callable[[float], Any],
) -> dict[str, Any]:
    """Return the derived numbers of a parameter set by place, as Python computes them."""
    made: dict[str, Any] = {}
    names: dict[str, Any] = {name: number(value) for name, value in constants.items()}
    names["par"] = _Place(par, "", made, number)

    def computed(node: ast.expr) -> Any:
        match node:
            case ast.BinOp():
                return _ARITHMETIC[type(node.op)](computed(node.left), computed(node.right))
            case ast.UnaryOp():
                return -computed(node.operand)
            case ast.Call(func=ast.Name(id=name)):
                return _FUNCTIONS[name](*map(computed, node.args))
            case ast.Attribute():
                return getattr(computed(node.value), node.attr)
            case ast.Name():
                return names[node.id]
            case ast.Constant(value=float() as value):
                return number(value)
        raise TypeError(f"{ast.unparse(node)} does not depend on parameters alone")

    with np.errstate(all="ignore"):
        for each in derived:
            text = _NUMBER.sub(r"\1", each.text)
            made[each.place] = computed(ast.parse(text, mode="eval").body)
    return made


@dataclass(frozen=True)
class _Place:
    """A parameter set with the names of its C members, and its derived numbers."""

    group: Any
    path: str
    made: Mapping[str, Any]
    number: Callable[[float], Any]

    def __getattr__(self, name: str) -> Any:
        place = f"{self.path}{name}"
        if place in self.made:
            return self.made[place]
        known = {c_name(each): each for each in type(self.group).model_fields}
        value = getattr(self.group, known[name])
        if hasattr(type(value), "model_fields"):
            return _Place(value, f"{place}.", self.made, self.number)
        return self.number(value)


# --- Structures


@dataclass(frozen=True)
class Member:
    """A field of a structure: name in Python, type, length of an array, and meaning.

    ``is_derived``: whether the field is derived from parameters.
    """

    name: str
    ctype: str
    length: int = 0
    note: str = ""
    is_derived: bool = False

    @property
    def declaration(self) -> str:
        """Line of the field in the structure, without the comment."""
        return f"{self.ctype} {c_name(self.name)}{f'[{self.length}]' if self.length else ''};"


@dataclass(frozen=True)
class Struct:
    """A C structure."""

    name: str
    members: dict[str, Member]
    doc: str = ""
    public: bool = False
    is_memory: bool = False


@dataclass
class Structs:
    """All structures of an export.

    Parameters
    ----------
    used
        Fields that the previous translation read; None if unknown.
    public
        Names of structures in the header, by class.
    memory
        The class that keeps all written fields, read or not.
    prefix
        Prefix of structure names in headers: all parameter sets, and those of ``shared``.
    shared
        Other classes whose structures are in a header.
    """

    precision: Precision
    used: frozenset[Use] | None
    public: Mapping[type[Any], str]
    memory: type[Any]
    prefix: str = ""
    shared: frozenset[type[Any]] = frozenset()
    known: dict[Any, Struct] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)
    derivations: Derivations = field(default_factory=Derivations)

    def of_tuple(self, cls: Any) -> Struct:
        """Return the structure of a NamedTuple class."""
        if cls not in self.known:
            hints = typing.get_type_hints(cls, include_extras=True)
            members = {name: self._signal(name, hints.get(name)) for name in cls._fields}
            self.known[cls] = Struct(
                self._name(cls), members, _doc(cls), cls in self.public, cls is self.memory
            )
        return self.known[cls]

    def is_memory(self, value: Any) -> bool:
        """Return whether a value is the memory, which functions change in place."""
        if hasattr(value, "record"):
            value = value.record
        return getattr(value, "cls", None) is self.memory

    def known_tuple(self, ctype: str) -> type[Any] | None:
        """Return the NamedTuple class of a C type; None for the type of a number."""
        for cls, struct in self.known.items():
            if struct.name == ctype and is_named_tuple(cls):
                return cls  # type: ignore[no-any-return]
        return None

    def of_group(self, shape: Shape) -> Struct:
        """Return the structure of a parameter set."""
        lengths = _lengths(shape)
        if lengths not in self.known:
            members = {}
            units, notes = _described(shape.cls)
            for name, kind in shape.fields:
                if isinstance(kind, Choice):
                    continue
                if isinstance(kind, Shape):
                    members[name] = Member(name, self.of_group(kind).name)
                    continue
                unit = units[name].unit.symbol if name in units else "1"
                length = kind.length if isinstance(kind, Nodes) else 0
                note = f"[{unit}] {notes.get(name, '')}".rstrip()
                members[name] = Member(name, self.precision.real, length, note)
            self.known[lengths] = Struct(self._name(shape.cls), members, _doc(shape.cls), True)
        return self.known[lengths]

    def of_result(self, function: str, members: Mapping[str, str]) -> Struct:
        """Return the structure for a function with several results, by their types."""
        made = {name: Member(name, ctype) for name, ctype in members.items()}
        name = unique(f"{function}_Result", self.names)
        self.names.add(name)
        self.known["result", name] = Struct(name, made, f"Results of {function}.")
        return self.known["result", name]

    def derive(self, function: str, holder: str, shape: Shape, expr: Expr, hint: str) -> Expr:
        """Return a derived number as a member of its parameter set."""
        struct = self.of_group(shape)
        taken = struct.members
        name = self.derivations.member(function, holder, struct.name, expr, hint, taken)
        note = "derived from other parameters"
        struct.members.setdefault(name, Member(name, self.precision.real, 0, note, True))
        uses = frozenset({("local", holder), ("field", struct.name, name)})
        return Expr(f"{holder}->{name}", uses=uses)

    def keeps(self, struct: Struct, name: str) -> bool:
        """Return whether any code reads a field."""
        return self.used is None or ("field", struct.name, name) in self.used

    def kept(self, struct: Struct) -> list[Member]:
        """Return the fields that code reads."""
        return [each for name, each in struct.members.items() if self.keeps(struct, name)]

    def ordered(self) -> list[Struct]:
        """Return the structures that have fields, in the order of their dependencies."""
        by_name = {each.name: each for each in self.known.values()}
        done: dict[str, Struct] = {}

        def add(struct: Struct) -> None:
            for member in self.kept(struct):
                if member.ctype in by_name and member.ctype not in done:
                    add(by_name[member.ctype])
            if self.kept(struct):
                done[struct.name] = struct

        for struct in self.known.values():
            if struct.name not in done:
                add(struct)
        return list(done.values())

    def _signal(self, name: str, hint: Any) -> Member:
        inner = typing.get_args(hint)[0] if typing.get_origin(hint) is typing.Annotated else hint
        if is_named_tuple(inner):
            return Member(name, self.of_tuple(inner).name)
        signal = signal_in(hint)
        note = "" if signal is None else f"[{signal.unit}] {signal.label}"
        return Member(name, self.precision.real, 0, note)

    def _name(self, cls: type[Any]) -> str:
        if cls in self.public:
            return self.public[cls]
        place = cls.__module__.split(".")
        is_shown = cls in self.shared or is_parameter_class(cls)
        begin = f"{self.prefix}_" if is_shown and self.prefix else ""
        own = f"{place[-1]}_{cls.__name__.lstrip('_')}"
        name = c_name(f"{begin}{own}")
        if name in self.names and len(place) > 1:
            name = c_name(f"{begin}{place[-2]}_{own}")
        name = unique(name, self.names)
        self.names.add(name)
        return name


def _described(cls: Any) -> tuple[Mapping[str, Any], Mapping[str, str]]:
    return leaf_fields(cls), field_notes(cls)


def _doc(cls: type[Any]) -> str:
    return (cls.__doc__ or "").strip().splitlines()[0] if cls.__doc__ else ""


def _lengths(shape: Shape) -> Any:
    """Return the table lengths, which distinguish the structures of a parameter class."""
    return (
        shape.cls,
        tuple(
            (name, kind.length if isinstance(kind, Nodes) else _lengths(kind))
            for name, kind in shape.fields
            if isinstance(kind, (Nodes, Shape))
        ),
    )


# --- Values in C: literals of known numbers, types, and structures of parameter sets


def is_number(value: Any) -> bool:
    """Return whether a value is a known number."""
    known = value.value if isinstance(value, Known) else None
    return isinstance(known, (int, float)) and not isinstance(known, bool)


def literal(value: Known, structs: Structs) -> Expr:
    """Return the literal, or the constant's name, of a known number."""
    if isinstance(value.value, bool):
        return Expr("true" if value.value else "false", truth=True)
    if not is_number(value):
        raise TypeError(f"{value.value!r} is not a number")
    if value.name:
        return Expr(value.name, uses=frozenset({("constant", value.name, float(value.value))}))
    text = structs.precision.literal(value.value)
    return Expr(text, UNARY if text.startswith("-") else PRIMARY)


def built_shape(value: BuiltGroup) -> Shape:
    """Return the structure of a parameter set constructed from values."""
    fields: list[tuple[str, Any]] = []
    for name, each in value.items.items():
        if isinstance(each, Group):
            fields.append((name, each.shape))
        elif isinstance(each, BuiltGroup):
            fields.append((name, built_shape(each)))
        elif isinstance(each, Expr) or is_number(each):
            fields.append((name, Number()))
        elif isinstance(each, Array):
            raise TypeError("a parameter set that contains a table cannot be rebuilt")
        elif hasattr(type(each.value), "model_fields"):
            fields.append((name, shape_of(each.value)))
        else:
            fields.append((name, Choice(each.value)))
    return Shape(value.cls, tuple(fields))


def ctype_of(structs: Structs, value: Any) -> str:
    """Return the C type of a number, a truth value or a structure."""
    value = lifted(value)
    if isinstance(value, (Record, Built)):
        return structs.of_tuple(value.cls).name
    if isinstance(value, Update):
        return structs.of_tuple(value.record.cls).name
    if isinstance(value, Group):
        return structs.of_group(value.shape).name
    if isinstance(value, BuiltGroup):
        return structs.of_group(built_shape(value)).name
    return "bool" if isinstance(value, Expr) and value.truth else structs.precision.real
