"""Fields and methods of values, as Python finds them behind a dot."""

from __future__ import annotations

import ast
from functools import cached_property
from typing import Any

from bywire.export.controller.c_text import c_name
from bywire.export.controller.context import Context
from bywire.export.controller.values import (
    Array,
    Built,
    BuiltGroup,
    Choice,
    Expr,
    Group,
    Items,
    Known,
    Method,
    Nodes,
    Record,
    Shape,
    Table,
    Update,
    is_named_tuple,
    lifted,
)


def attribute(at: Context, node: ast.AST, owner: Any, name: str) -> Any:
    """Return the field or method of a value."""
    if isinstance(owner, Known):
        return _of_known(at, node, owner, name)
    if isinstance(owner, Update):
        owner = at.body.settled(owner, "changed")
    if isinstance(owner, Record):
        return _of_record(at, node, owner, name)
    if isinstance(owner, Built):
        if name in owner.items:
            return owner.items[name]
        return Known(owner.cls._fields) if name == "_fields" else Method(owner, name)
    if isinstance(owner, BuiltGroup) and name in owner.items:
        return owner.items[name]
    if isinstance(owner, Group) and name in owner.shape.by_name:
        return _of_group(at, owner, name)
    if isinstance(owner, (Group, BuiltGroup)):
        cls = owner.shape.cls if isinstance(owner, Group) else owner.cls
        member = getattr(cls, name, None)
        if isinstance(member, property):
            return at.translation.call(at, node, member.fget, [owner], {})
        if isinstance(member, cached_property):
            return at.translation.call(at, node, member.func, [owner], {})
        return Method(owner, name)
    if isinstance(owner, (Items, Table)):
        return Method(owner, name)
    raise at.refuse(node, f"it has no {name!r}")


def _of_known(at: Context, node: ast.AST, owner: Known, name: str) -> Any:
    if not hasattr(owner.value, name):
        raise at.refuse(node, f"it has no {name!r}")
    member = getattr(owner.value, name)
    if is_named_tuple(type(owner.value)) and callable(member):
        return Method(lifted(owner), name)
    module = owner.value.__name__ if isinstance(owner.value, type(ast)) else ""
    return at.translation.constant(module, name, member)


def _of_record(at: Context, node: ast.AST, owner: Record, name: str) -> Any:
    if name == "_fields":
        return Known(owner.cls._fields)
    if name not in owner.cls._fields:
        if name in ("_replace", "_asdict"):
            return Method(owner, name)
        raise at.refuse(node, f"{owner.cls.__name__} has no {name!r}")
    struct = at.body.structs.of_tuple(owner.cls)
    place = f"{owner.expr.text}{'->' if owner.pointer else '.'}{c_name(name)}"
    expr = Expr(place, uses=owner.expr.uses | {("field", struct.name, name)})
    ctype = struct.members[name].ctype
    inner = at.body.structs.known_tuple(ctype)
    return expr if inner is None else Record(inner, expr)


def _of_group(at: Context, owner: Group, name: str) -> Any:
    kind = owner.shape.by_name[name]
    if isinstance(kind, Choice):
        return Known(kind.value)
    struct = at.body.structs.of_group(owner.shape)
    place = f"{owner.expr.text}{'->' if owner.pointer else '.'}{c_name(name)}"
    expr = Expr(place, uses=owner.expr.uses | {("field", struct.name, name)})
    if isinstance(kind, Nodes):
        return Array(expr, kind.length)
    if isinstance(kind, Shape):
        return Group(kind, expr, False, (*owner.origin, name) if owner.origin else ())
    return expr
