"""Evaluation of Python expressions, with operators, attributes and calls, on objects or C text."""

from __future__ import annotations

import ast
import builtins
import operator
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, Protocol

from bywire.core import ops
from bywire.core.errors import ModelError
from bywire.core.parameters import ParameterSet
from bywire.export.controller.c_text import c_name
from bywire.export.controller.elementary import MAGNITUDE
from bywire.export.controller.functions import Body
from bywire.export.controller.structs import is_number, literal
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
    is_parameter_class,
    lifted,
)


class Functions(Protocol):
    """Protocol of all functions of an export; see `Translation`."""

    def constant(self, module: str, name: str, found: Any) -> Known:
        """Return an object of a module; a number keeps the name of its C constant."""
        ...

    def call(self, at: Context, node: ast.AST, function: Any, given: list[Any], named: Any) -> Any:
        """Return the result of a call."""
        ...

    def inlined(
        self, at: Context, node: ast.AST, closure: Closure, given: list[Any], named: Any
    ) -> Any:
        """Return the result of an inner function, which is inlined in its caller."""
        ...


class Context(Protocol):
    """Protocol of an evaluator of expressions; see `Evaluator`."""

    translation: Functions
    body: Body

    def refuse(self, node: ast.AST, what: str) -> ModelError:
        """Return the error for code that cannot be translated to C."""
        ...

    def number(self, node: ast.AST, value: Any) -> Expr:
        """Return the C text of a number or a truth value."""
        ...

    def known(self, node: ast.AST, value: Any, why: str) -> Any:
        """Return the object of a value that must be known at export."""
        ...

    def sequence(self, node: ast.AST, value: Any) -> tuple[Any, ...]:
        """Return the values of a tuple or similar."""
        ...


# --- Fields and methods of a value, written after a dot in Python


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
    raise at.refuse(node, f"the object has no attribute {name!r}")


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
        raise at.refuse(node, f"{owner.cls.__name__} has no attribute {name!r}")
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


def _unary(at: Context, node: ast.UnaryOp, value: Any) -> Any:
    """Return the result of a unary operator."""
    if isinstance(value, Known):
        return Known(_SIGNS[type(node.op)](value.value))
    expr = at.number(node, value)
    if isinstance(node.op, ast.USub) and not expr.truth:
        return Expr(f"-{expr.at(PRIMARY)}", UNARY, expr.uses)
    if isinstance(node.op, ast.Not) and expr.truth:
        return Expr(f"!{expr.at(PRIMARY)}", UNARY, expr.uses, truth=True)
    raise at.refuse(node, "this operator is not supported")


def binary(at: Context, node: ast.BinOp, left: Any, right: Any) -> Any:
    """Return the result of a binary operator."""
    left, right = lifted(left), lifted(right)
    kind = type(node.op)
    if isinstance(left, Known) and isinstance(right, Known) and kind in _KNOWN:
        return Known(_KNOWN[kind](left.value, right.value))
    if isinstance(left, Items) and isinstance(right, Items) and kind is ast.Add:
        return Items(left.values + right.values)
    if kind is ast.Pow and isinstance(right, Known) and right.value in (2, 2.0):
        return _square(at, node, left)
    if kind not in _ARITHMETIC:
        raise at.refuse(node, "this operator is not supported")
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
        raise at.refuse(node, "this comparison is not supported")
    a, b = at.body.operands(*(at.number(node, each) for each in (left, right)))
    return Expr(f"{a.at(SUM)} {sign} {b.at(SUM)}", COMPARED, a.uses | b.uses, truth=True)


def _equal(at: Context, node: ast.AST, left: Any, right: Any, sign: str) -> Expr:
    """Return an equality comparison of floats that does not cause compiler warnings."""
    a, b = (at.body.settled(at.number(node, v), "compared") for v in (left, right))
    both = f"({a.at(SUM)} <= {b.at(SUM)}) && ({a.at(SUM)} >= {b.at(SUM)})"
    uses = a.uses | b.uses
    if sign == "==":
        return Expr(both, BOTH, uses, truth=True)
    return Expr(f"!({both})", UNARY, uses, truth=True)


def _connected(at: Context, node: ast.BoolOp, values: Iterable[Any]) -> Any:
    """Return "and" or "or" of values, without the values that cannot change the result."""
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
            raise at.refuse(each, "a number is used as a truth value")
        parts.append(expr)
    if not parts:
        return value
    sign, level = ("&&", BOTH) if is_and else ("||", EITHER)
    uses = frozenset().union(*(each.uses for each in parts))
    text = f" {sign} ".join(each.at(PRIMARY) for each in parts)
    return Expr(text, level if len(parts) > 1 else PRIMARY, uses, truth=True)


def chosen(at: Context, node: ast.AST, condition: Any, then: Any, otherwise: Any) -> Any:
    """Return the result of ``ops.where``."""
    if isinstance(condition, Known):
        return then if condition.value else otherwise
    test = at.number(node, condition)
    if not test.truth:
        raise at.refuse(node, "a number is used as a truth value")
    a, b = (at.number(node, each) for each in (then, otherwise))
    text = f"{test.at(PRIMARY)} ? {a.at(CHOICE + 1)} : {b.at(CHOICE + 1)}"
    return Expr(text, CHOICE, test.uses | a.uses | b.uses, a.truth and b.truth)


# --- Expressions

_LIBRARY = {ops.fabs: "fabs", ops.sqrt: "sqrt", ops.log: "log", ops.power: "pow"}
_OURS: dict[Any, str] = {
    ops.floor: "whole",
    ops.sin: "sine",
    ops.cos: "cosine",
    ops.exp: "exponential",
}
_OURS_IN_DOUBLE: dict[Any, str] = {**_OURS, ops.log: "logarithm", ops.power: "power_of"}
_EXTREMES = {ops.fmin: "smaller", ops.fmax: "larger"}
"""functions of core.ops that the C file defines at its top"""

_Named = dict[str, Any]


def called(at: Context, node: ast.Call, function: Any, given: list[Any], named: _Named) -> Any:
    """Return the result of a call."""
    if isinstance(function, Method):
        return _method(at, node, function, given, named)
    if isinstance(function, Closure):
        return at.translation.inlined(at, node, function, given, named)
    target = at.known(node, function, "this is not a function that bywire can translate")
    if isinstance(target, partial):
        held = {**{n: Known(v) for n, v in target.keywords.items()}, **named}
        return called(at, node, Known(target.func), [*map(Known, target.args), *given], held)
    if target in _LIBRARY or target in _OURS or target in _EXTREMES:
        return _elementary(at, node, target, given)
    if target is ops.where:
        return chosen(at, node, *given, *named.values())
    if is_named_tuple(target):
        return _made(at, node, target, given, named)
    if isinstance(target, types.MethodType) and isinstance(target.__self__, type):
        return _class_method(at, node, target, given, named)
    if isinstance(target, (type, types.BuiltinFunctionType)) and target in _BUILTINS:
        return _BUILTINS[target](at, node, given, named)
    every = [*given, *named.values()]
    if not isinstance(target, (types.FunctionType, types.MethodType)):
        if all(isinstance(each, Known) for each in every):
            values = {name: each.value for name, each in named.items()}
            return Known(target(*(each.value for each in given), **values))
        what = getattr(target, "__qualname__", repr(target))
        raise at.refuse(node, f"{what} is not supported. A law can call core.ops and other laws")
    if isinstance(target, types.MethodType):
        return at.translation.call(
            at, node, target.__func__, [Known(target.__self__), *given], named
        )
    return at.translation.call(at, node, target, given, named)


def _elementary(at: Context, node: ast.AST, function: Any, given: list[Any]) -> Any:
    """Return a function of core.ops applied to numbers."""
    if all(isinstance(each, Known) for each in given):
        return Known(function(*(each.value for each in given)))
    arguments = at.body.operands(*(at.body.as_number(at.number(node, v)) for v in given))
    uses: frozenset[Any] = frozenset().union(*(each.uses for each in arguments))
    if function in _EXTREMES:
        name = _EXTREMES[function]
        uses |= {("own", name)}
    elif function in (ours := _ours(at)):
        name = ours[function]
        uses |= {("own", name)}
        if name in MAGNITUDE:
            uses |= {("library", "fabs" + at.body.structs.precision.suffix)}
    else:
        name = _LIBRARY[function] + at.body.structs.precision.suffix
        uses |= {("library", name)}
    return Expr(f"{name}({', '.join(each.text for each in arguments)})", PRIMARY, uses)


def _ours(at: Context) -> dict[Any, str]:
    """Return the functions for which an export contains its own code."""
    return _OURS_IN_DOUBLE if at.body.structs.precision.name == "double" else _OURS


def _made(at: Context, node: ast.AST, cls: Any, given: list[Any], named: _Named) -> Built:
    defaults = {name: Known(value) for name, value in cls._field_defaults.items()}
    items = {**defaults, **dict(zip(cls._fields, given, strict=False)), **named}
    missing = [name for name in cls._fields if name not in items]
    if missing or len(given) > len(cls._fields):
        raise at.refuse(node, f"the values do not match the fields of {cls.__name__}")
    return Built(cls, {name: items[name] for name in cls._fields})


def _class_method(at: Context, node: ast.AST, target: Any, given: list[Any], named: _Named) -> Any:
    cls, name = target.__self__, target.__func__.__name__
    if is_named_tuple(cls) and name == "_make":
        return Built(cls, dict(zip(cls._fields, at.sequence(node, given[0]), strict=True)))
    if is_parameter_class(cls) and name == "model_construct":
        return BuiltGroup(cls, {n: named[n] for n in cls.model_fields if n in named})
    if all(isinstance(each, Known) for each in (*given, *named.values())):
        values = {n: each.value for n, each in named.items()}
        return Known(target(*(each.value for each in given), **values))
    return at.translation.call(at, node, target.__func__, [Known(cls), *given], named)


def _method(at: Context, node: ast.AST, method: Method, given: list[Any], named: _Named) -> Any:
    owner, name = method.owner, method.name
    if isinstance(owner, (Record, Built)):
        if name == "_replace":
            if isinstance(owner, Built):
                return Built(owner.cls, {**owner.items, **named})
            return Update(owner, named)
        if name == "_asdict":
            values = at.sequence(node, owner)
            return Table(dict(zip(owner.cls._fields, values, strict=True)))
    if isinstance(owner, Table):
        found: dict[str, Callable[[], Any]] = {
            "items": lambda: Items(tuple(Items((Known(n), v)) for n, v in owner.items.items())),
            "keys": lambda: Items(tuple(map(Known, owner.items))),
            "values": lambda: Items(tuple(owner.items.values())),
        }
        if name in found:
            return found[name]()
    if isinstance(owner, (Group, BuiltGroup)):
        cls = owner.shape.cls if isinstance(owner, Group) else owner.cls
        function = getattr(cls, name, None)
        if isinstance(function, types.FunctionType) and name not in vars(ParameterSet):
            return at.translation.call(at, node, function, [owner, *given], named)
    raise at.refuse(node, f"the method {name} is not supported")


def _zipped(at: Context, node: ast.AST, given: list[Any], named: _Named) -> Any:
    rows = [at.sequence(node, each) for each in given]
    return Items(tuple(Items(row) for row in zip(*rows, strict=False)))


def _enumerated(at: Context, node: ast.AST, given: list[Any], named: _Named) -> Any:
    rows = enumerate(at.sequence(node, given[0]))
    return Items(tuple(Items((Known(k), each)) for k, each in rows))


def _listed(at: Context, node: ast.AST, given: list[Any], named: _Named) -> Any:
    return Items(at.sequence(node, given[0]) if given else ())


def _length(at: Context, node: ast.AST, given: list[Any], named: _Named) -> Any:
    return Known(len(at.sequence(node, given[0])))


def _dictionary(at: Context, node: ast.AST, given: list[Any], named: _Named) -> Any:
    items: dict[str, Any] = {}
    for each in map(lifted, given):
        if isinstance(each, Group):
            items |= {
                n: Known(kind.value) if isinstance(kind, Choice) else attribute(at, node, each, n)
                for n, kind in each.shape.fields
            }
        elif isinstance(each, (BuiltGroup, Table)):
            items |= each.items
        else:
            for pair in at.sequence(node, each):
                name, value = at.sequence(node, pair)
                items[at.known(node, name, "keys must be known at export")] = value
    return Table({**items, **named})


def _attribute_named(at: Context, node: ast.AST, given: list[Any], named: _Named) -> Any:
    name = at.known(node, given[1], "field names must be known at export")
    return attribute(at, node, given[0], name)


def _sum(at: Context, node: ast.AST, given: list[Any], named: _Named) -> Any:
    total: Any = [*given[1:], *named.values(), Known(0)][0]
    for each in at.sequence(node, given[0]):
        if isinstance(total, Known) and isinstance(each, Known):
            total = Known(total.value + each.value)
            continue
        a, b = (at.body.as_number(at.number(node, v)) for v in (total, each))
        total = Expr(f"{a.at(SUM)} + {b.at(SUM + 1)}", SUM, a.uses | b.uses)
    return total


def _extreme(function: Any) -> Callable[..., Any]:
    """Return the rule for max or min, which return the first of equal values."""

    def rule(at: Context, node: ast.AST, given: list[Any], named: _Named) -> Any:
        values = given if len(given) > 1 else list(at.sequence(node, given[0]))
        best = values[0]
        for each in values[1:]:
            best = _elementary(at, node, function, [best, each])
        return best

    return rule


def _float(at: Context, node: ast.AST, given: list[Any], named: _Named) -> Any:
    value = given[0]
    if isinstance(value, Known):
        return Known(float(value.value))
    return at.body.as_number(at.number(node, value))


def _absolute(at: Context, node: ast.AST, given: list[Any], named: _Named) -> Any:
    return _elementary(at, node, ops.fabs, given)


_BUILTINS: dict[Any, Callable[..., Any]] = {
    builtins.zip: _zipped,
    builtins.enumerate: _enumerated,
    builtins.tuple: _listed,
    builtins.list: _listed,
    builtins.len: _length,
    builtins.dict: _dictionary,
    builtins.getattr: _attribute_named,
    builtins.sum: _sum,
    builtins.max: _extreme(ops.fmax),
    builtins.min: _extreme(ops.fmin),
    builtins.float: _float,
    builtins.abs: _absolute,
}


# --- Expressions


@dataclass
class Evaluator:
    """Evaluator of the expressions of a function.

    Parameters
    ----------
    file
        Source file of the function, for error messages.
    module
        Names in the function's module.
    scope
        Values of the function's variables.
    """

    translation: Functions
    body: Body
    file: str
    module: Mapping[str, Any]
    scope: dict[str, Any] = field(default_factory=dict)

    def refuse(self, node: ast.AST, what: str) -> ModelError:
        """Return the error for an expression or a statement that cannot be translated to C."""
        line = getattr(node, "lineno", 0)
        shown = ast.unparse(node).splitlines()[0][:60]
        return ModelError(
            f"{self.file}, line {line}: bywire cannot export the ECU as C, because {what}. "
            f"The code is: {shown}",
            name=f"{self.file}, line {line}",
            value=shown,
        )

    def value(self, node: ast.expr) -> Any:
        """Return the value of an expression."""
        rule = getattr(self, f"_{type(node).__name__.lower()}", None)
        if rule is None:
            raise self.refuse(node, f"{type(node).__name__} is not supported")
        try:
            return rule(node)
        except (ArithmeticError, LookupError) as error:  # as Python would raise it at run time
            raise self.refuse(node, str(error)) from None

    def number(self, node: ast.AST, value: Any) -> Expr:
        """Return the C text of a number or a truth value."""
        value = lifted(value)
        if isinstance(value, Expr):
            return value
        if isinstance(value, Known) and (is_number(value) or isinstance(value.value, bool)):
            return literal(value, self.body.structs)
        raise self.refuse(node, "this must be a number")

    def known(self, node: ast.AST, value: Any, why: str) -> Any:
        """Return the object of a value that must be known at export."""
        if isinstance(value, Known):
            return value.value
        raise self.refuse(node, why)

    def sequence(self, node: ast.AST, value: Any) -> tuple[Any, ...]:
        """Return the values of a tuple, a list, a table of parameters or a NamedTuple."""
        value = lifted(value)
        if isinstance(value, Items):
            return value.values
        if isinstance(value, Built):
            return tuple(value.items.values())
        if isinstance(value, Record):
            kept = self.body.settled(value, "entry")
            return tuple(attribute(self, node, kept, name) for name in value.cls._fields)
        if isinstance(value, Array):
            each = (f"{value.expr.text}[{k}]" for k in range(value.length))
            return tuple(Expr(text, uses=value.expr.uses) for text in each)
        if isinstance(value, Table):
            return tuple(Known(name) for name in value.items)
        if isinstance(value, Known) and hasattr(value.value, "__iter__"):
            return tuple(lifted(Known(each)) for each in value.value)
        raise self.refuse(node, "a loop can iterate only over a tuple of known length")

    def _constant(self, node: ast.Constant) -> Any:
        return Known(node.value)

    def _name(self, node: ast.Name) -> Any:
        if node.id in self.scope:
            return self.scope[node.id]
        if node.id in self.module:
            found = self.module[node.id]
            return self.translation.constant(self.module.get("__name__", ""), node.id, found)
        if hasattr(builtins, node.id):
            return Known(getattr(builtins, node.id))
        raise self.refuse(node, f"{node.id!r} has no value")

    def _attribute(self, node: ast.Attribute) -> Any:
        return attribute(self, node, self.value(node.value), node.attr)

    def _tuple(self, node: ast.Tuple) -> Any:
        return Items(tuple(self._spread(node.elts)))

    _list = _tuple

    def _spread(self, nodes: list[ast.expr]) -> Iterator[Any]:
        for each in nodes:
            if isinstance(each, ast.Starred):
                yield from self.sequence(each, self.value(each.value))
            else:
                yield self.value(each)

    def _dict(self, node: ast.Dict) -> Any:
        items: dict[str, Any] = {}
        for key, each in zip(node.keys, node.values, strict=True):
            if key is None:
                items |= self.table(each, self.value(each))
            else:
                name = self.known(key, self.value(key), "keys must be known at export")
                items[name] = self.value(each)
        return Table(items)

    def table(self, node: ast.AST, value: Any) -> Mapping[str, Any]:
        """Return the values of a dictionary by name."""
        value = lifted(value)
        if isinstance(value, Table):
            return value.items
        raise self.refuse(node, "this must be a dictionary with known keys")

    def _joinedstr(self, node: ast.JoinedStr) -> Any:
        parts = []
        for each in node.values:
            inner = each.value if isinstance(each, ast.FormattedValue) else each
            value = self.value(inner)
            parts.append(str(self.known(each, value, "strings must be known at export")))
        return Known("".join(parts))

    def _lambda(self, node: ast.Lambda) -> Any:
        return Closure(node, dict(self.scope), self.file, self.module)

    def _ifexp(self, node: ast.IfExp) -> Any:
        return self.value(node.body if self.truth(node.test) else node.orelse)

    def truth(self, node: ast.expr) -> bool:
        """Return whether a structural condition is true."""
        value = self.value(node)
        if isinstance(value, (Items, Table)):
            return bool(value.values if isinstance(value, Items) else value.items)
        why = "the condition depends on a value that is unknown at export. Use ops.where"
        return bool(self.known(node, value, why))

    def _unaryop(self, node: ast.UnaryOp) -> Any:
        return _unary(self, node, self.value(node.operand))

    def _binop(self, node: ast.BinOp) -> Any:
        return binary(self, node, self.value(node.left), self.value(node.right))

    def _compare(self, node: ast.Compare) -> Any:
        if len(node.ops) > 1:
            raise self.refuse(node, "chained comparisons are not supported")
        return compared(self, node, self.value(node.left), self.value(node.comparators[0]))

    def _boolop(self, node: ast.BoolOp) -> Any:
        return _connected(self, node, map(self.value, node.values))

    def _subscript(self, node: ast.Subscript) -> Any:
        value = lifted(self.value(node.value))
        if isinstance(value, Table):
            key = self.known(node, self.value(node.slice), "keys must be known at export")
            return value.items[key]
        entries = self.sequence(node, value)
        if isinstance(node.slice, ast.Slice):
            bounds = [
                None
                if each is None
                else self.known(node, self.value(each), "slices must be known at export")
                for each in (node.slice.lower, node.slice.upper, node.slice.step)
            ]
            return Items(entries[slice(*bounds)])
        index = self.known(node, self.value(node.slice), "indices must be known at export")
        return entries[index]

    def _comprehended(self, generators: list[ast.comprehension]) -> Iterator[None]:
        if not generators:
            yield
            return
        first, *rest = generators
        for entry in self.sequence(first.iter, self.value(first.iter)):
            self.bind(first.target, entry)
            if all(self.truth(test) for test in first.ifs):
                yield from self._comprehended(rest)

    def bind(self, target: ast.expr, value: Any) -> None:
        """Bind loop variables to values, without C variables."""
        if isinstance(target, ast.Name):
            self.scope[target.id] = self.body.settled(value, target.id)
            return
        if not isinstance(target, (ast.Tuple, ast.List)):
            raise self.refuse(target, "only a name can be assigned")
        for each, entry in zip(target.elts, self.sequence(target, value), strict=True):
            self.bind(each, entry)

    def _listcomp(self, node: ast.ListComp | ast.GeneratorExp) -> Any:
        outer = dict(self.scope)
        values = tuple(self.value(node.elt) for _ in self._comprehended(node.generators))
        self.scope.clear()
        self.scope.update(outer)
        return Items(values)

    _generatorexp = _listcomp

    def _dictcomp(self, node: ast.DictComp) -> Any:
        outer = dict(self.scope)
        items = {}
        for _ in self._comprehended(node.generators):
            key = self.known(node.key, self.value(node.key), "keys must be known at export")
            items[key] = self.value(node.value)
        self.scope.clear()
        self.scope.update(outer)
        return Table(items)

    def _call(self, node: ast.Call) -> Any:
        arguments = list(self._spread(node.args))
        named: dict[str, Any] = {}
        for each in node.keywords:
            if each.arg is None:
                named |= self.table(each.value, self.value(each.value))
            else:
                named[each.arg] = self.value(each.value)
        return called(self, node, self.value(node.func), arguments, named)
