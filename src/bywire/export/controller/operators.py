"""Operators and members of Python's values, as C text."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Iterable
from functools import cached_property
from typing import Any, Protocol

from bywire.core.errors import ModelError
from bywire.export.controller.body import Body
from bywire.export.controller.c_text import c_name
from bywire.export.controller.values import (
    BOTH,
    CHOICE,
    COMPARED,
    EITHER,
    PRIMARY,
    PRODUCT,
    SUM,
    UNARY,
    Array,
    Built,
    BuiltGroup,
    Choice,
    Closure,
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


class Functions(Protocol):
    """All functions of an export; see `Translation`."""

    def constant(self, module: str, name: str, found: Any) -> Known:
        """Return a module's object; a number of its own is called by its name in C."""
        ...

    def call(self, at: Context, node: ast.AST, function: Any, given: list[Any], named: Any) -> Any:
        """Return what a function gives."""
        ...

    def inlined(
        self, at: Context, node: ast.AST, closure: Closure, given: list[Any], named: Any
    ) -> Any:
        """Return what an inner function gives, written out in its caller."""
        ...


class Context(Protocol):
    """Who evaluates an expression; see `Evaluator`."""

    translation: Functions
    body: Body

    def refuse(self, node: ast.AST, what: str) -> ModelError:
        """Return the error for what C does not get."""
        ...

    def number(self, node: ast.AST, value: Any) -> Expr:
        """Return the C text of a number or a truth value."""
        ...

    def known(self, node: ast.AST, value: Any, why: str) -> Any:
        """Return the object of a value that export has to know."""
        ...

    def sequence(self, node: ast.AST, value: Any) -> tuple[Any, ...]:
        """Return the values of a tuple and its like."""
        ...


# --- Fields and methods, as Python finds them behind a dot


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


# --- Arithmetic, comparisons, truth values and choices

_ARITHMETIC: dict[type[Any], tuple[str, int, Callable[[Any, Any], Any]]] = {
    ast.Add: ("+", SUM, operator.add),
    ast.Sub: ("-", SUM, operator.sub),
    ast.Mult: ("*", PRODUCT, operator.mul),
    ast.Div: ("/", PRODUCT, operator.truediv),
}
_KNOWN: dict[type[Any], Callable[[Any, Any], Any]] = {
    **{kind: function for kind, (_, _, function) in _ARITHMETIC.items()},
    ast.Pow: operator.pow,
    ast.Mod: operator.mod,
    ast.FloorDiv: operator.floordiv,
    ast.BitOr: operator.or_,
    ast.BitAnd: operator.and_,
    ast.BitXor: operator.xor,
    ast.LShift: operator.lshift,
    ast.RShift: operator.rshift,
}
_SIGNS: dict[type[Any], Callable[[Any], Any]] = {
    ast.Not: operator.not_,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
    ast.Invert: operator.invert,
}
_COMPARED: dict[type[Any], tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Lt: ("<", operator.lt),
    ast.LtE: ("<=", operator.le),
    ast.Gt: (">", operator.gt),
    ast.GtE: (">=", operator.ge),
    ast.Eq: ("==", operator.eq),
    ast.NotEq: ("!=", operator.ne),
    ast.In: ("in", lambda a, b: a in b),
    ast.NotIn: ("not in", lambda a, b: a not in b),
    ast.Is: ("is", operator.is_),
    ast.IsNot: ("is not", operator.is_not),
}


def unary(at: Context, node: ast.UnaryOp, value: Any) -> Any:
    """Return what an operator gives of one value."""
    if isinstance(value, Known):
        return Known(_SIGNS[type(node.op)](value.value))
    expr = at.number(node, value)
    if isinstance(node.op, ast.USub) and not expr.truth:
        return Expr(f"-{expr.at(PRIMARY)}", UNARY, expr.uses)
    if isinstance(node.op, ast.Not) and expr.truth:
        return Expr(f"!{expr.at(PRIMARY)}", UNARY, expr.uses, truth=True)
    raise at.refuse(node, "this operator is not translated")


def binary(at: Context, node: ast.BinOp, left: Any, right: Any) -> Any:
    """Return what an operator gives of two values."""
    left, right = lifted(left), lifted(right)
    kind = type(node.op)
    if isinstance(left, Known) and isinstance(right, Known) and kind in _KNOWN:
        return Known(_KNOWN[kind](left.value, right.value))
    if isinstance(left, Items) and isinstance(right, Items) and kind is ast.Add:
        return Items(left.values + right.values)
    if kind is ast.Pow and isinstance(right, Known) and right.value in (2, 2.0):
        return _square(at, node, left)
    if kind not in _ARITHMETIC:
        raise at.refuse(node, "this operator is not translated")
    sign, level, _ = _ARITHMETIC[kind]
    a, b = (at.body.as_number(at.number(node, each)) for each in (left, right))
    a, b = at.body.operands(a, b)
    text = f"{a.at(level)} {sign} {b.at(level + 1)}"
    return Expr(text, level, a.uses | b.uses)


def _square(at: Context, node: ast.AST, value: Any) -> Expr:
    """Return the square of a value."""
    base = at.body.settled(at.number(node, value), "base")
    return Expr(f"{base.at(PRODUCT)} * {base.at(PRODUCT + 1)}", PRODUCT, base.uses)


def compared(at: Context, node: ast.Compare, left: Any, right: Any) -> Any:
    """Return a comparison."""
    sign, known = _COMPARED[type(node.ops[0])]
    if isinstance(right, (Items, Table)) and isinstance(left, Known):
        each = right.values if isinstance(right, Items) else map(Known, right.items)
        right = Known([v.value for v in each if isinstance(v, Known)])
    if isinstance(left, Known) and isinstance(right, Known):
        return Known(known(left.value, right.value))
    if sign in ("==", "!="):
        return _equal(at, node, left, right, sign)
    if sign not in ("<", "<=", ">", ">="):
        raise at.refuse(node, "this comparison is not translated")
    a, b = at.body.operands(*(at.number(node, each) for each in (left, right)))
    return Expr(f"{a.at(SUM)} {sign} {b.at(SUM)}", COMPARED, a.uses | b.uses, truth=True)


def _equal(at: Context, node: ast.AST, left: Any, right: Any, sign: str) -> Expr:
    """Return a comparison of floats for equality, in words that compilers do not warn of."""
    a, b = (at.body.settled(at.number(node, v), "compared") for v in (left, right))
    both = f"({a.at(SUM)} <= {b.at(SUM)}) && ({a.at(SUM)} >= {b.at(SUM)})"
    uses = a.uses | b.uses
    if sign == "==":
        return Expr(both, BOTH, uses, truth=True)
    return Expr(f"!({both})", UNARY, uses, truth=True)


def connected(at: Context, node: ast.BoolOp, values: Iterable[Any]) -> Any:
    """Return "and" or "or" of values, of which those behind a known end are not evaluated."""
    is_and = isinstance(node.op, ast.And)
    parts: list[Expr] = []
    value: Any = Known(is_and)
    for each, value in zip(node.values, values, strict=False):
        if isinstance(value, Known):
            if bool(value.value) != is_and and not parts:
                return value
            continue
        expr = at.number(each, value)
        if not expr.truth:
            raise at.refuse(each, "a number stands for a truth value")
        parts.append(expr)
    if not parts:
        return value
    sign, level = ("&&", BOTH) if is_and else ("||", EITHER)
    uses = frozenset().union(*(each.uses for each in parts))
    text = f" {sign} ".join(each.at(PRIMARY) for each in parts)
    return Expr(text, level if len(parts) > 1 else PRIMARY, uses, truth=True)


def chosen(at: Context, node: ast.AST, condition: Any, then: Any, otherwise: Any) -> Any:
    """Return what ``ops.where`` gives."""
    if isinstance(condition, Known):
        return then if condition.value else otherwise
    test = at.number(node, condition)
    if not test.truth:
        raise at.refuse(node, "a number stands for a truth value")
    a, b = (at.number(node, each) for each in (then, otherwise))
    text = f"{test.at(PRIMARY)} ? {a.at(CHOICE + 1)} : {b.at(CHOICE + 1)}"
    return Expr(text, CHOICE, test.uses | a.uses | b.uses, a.truth and b.truth)
