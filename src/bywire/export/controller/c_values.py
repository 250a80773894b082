"""What values are in C: literals of known numbers, types, structures of parameter sets."""

from __future__ import annotations

from typing import Any

from bywire.export.controller.structs import Structs
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
    Number,
    Record,
    Shape,
    Update,
    lifted,
    shape_of,
)


def is_number(value: Any) -> bool:
    """Return whether a value is a known number."""
    known = value.value if isinstance(value, Known) else None
    return isinstance(known, (int, float)) and not isinstance(known, bool)


def literal(value: Known, structs: Structs) -> Expr:
    """Return the literal, or the constant's name, of a known number."""
    if isinstance(value.value, bool):
        return Expr("true" if value.value else "false", truth=True)
    if not is_number(value):
        raise TypeError(f"{value.value!r} is no number")
    if value.name:
        return Expr(value.name, uses=frozenset({("constant", value.name, float(value.value))}))
    text = structs.precision.literal(value.value)
    return Expr(text, UNARY if text.startswith("-") else PRIMARY)


def built_shape(value: BuiltGroup) -> Shape:
    """Return the structure of a parameter set that is made of values."""
    fields: list[tuple[str, Any]] = []
    for name, each in value.items.items():
        if isinstance(each, Group):
            fields.append((name, each.shape))
        elif isinstance(each, BuiltGroup):
            fields.append((name, built_shape(each)))
        elif isinstance(each, Expr) or is_number(each):
            fields.append((name, Number()))
        elif isinstance(each, Array):
            raise TypeError("a parameter set with a table cannot be made anew")
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
