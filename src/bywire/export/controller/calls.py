"""Calls: of Python's own functions, of methods of values, of ``core.ops``, of other functions."""

from __future__ import annotations

import ast
import builtins
import types
from collections.abc import Callable
from functools import partial
from typing import Any

from bywire.core import ops
from bywire.core.parameters import ParameterSet
from bywire.export.controller.context import Context
from bywire.export.controller.elementary import MAGNITUDE
from bywire.export.controller.members import attribute
from bywire.export.controller.operators import chosen
from bywire.export.controller.values import (
    PRIMARY,
    SUM,
    Built,
    BuiltGroup,
    Choice,
    Closure,
    Expr,
    Group,
    Items,
    Known,
    Method,
    Record,
    Table,
    Update,
    is_named_tuple,
    is_parameter_class,
    lifted,
)

_LIBRARY = {ops.fabs: "fabs", ops.sqrt: "sqrt", ops.log: "log", ops.power: "pow"}
_OURS: dict[Any, str] = {
    ops.floor: "whole",
    ops.sin: "sine",
    ops.cos: "cosine",
    ops.exp: "exponential",
}
_OURS_IN_DOUBLE: dict[Any, str] = {**_OURS, ops.log: "logarithm", ops.power: "power_of"}
EXTREMES = {ops.fmin: "smaller", ops.fmax: "larger"}
"""functions of core.ops that stand at the top of the C"""

Named = dict[str, Any]


def called(at: Context, node: ast.Call, function: Any, given: list[Any], named: Named) -> Any:
    """Return what a call gives."""
    if isinstance(function, Method):
        return _method(at, node, function, given, named)
    if isinstance(function, Closure):
        return at.translation.inlined(at, node, function, given, named)
    target = at.known(node, function, "it is no function that export knows")
    if isinstance(target, partial):
        held = {**{n: Known(v) for n, v in target.keywords.items()}, **named}
        return called(at, node, Known(target.func), [*map(Known, target.args), *given], held)
    if target in _LIBRARY or target in _OURS or target in EXTREMES:
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
        raise at.refuse(node, f"{what} is not translated: laws call core.ops and each other")
    if isinstance(target, types.MethodType):
        return at.translation.call(
            at, node, target.__func__, [Known(target.__self__), *given], named
        )
    return at.translation.call(at, node, target, given, named)


def _elementary(at: Context, node: ast.AST, function: Any, given: list[Any]) -> Any:
    """Return a function of core.ops of numbers."""
    if all(isinstance(each, Known) for each in given):
        return Known(function(*(each.value for each in given)))
    arguments = at.body.operands(*(at.body.as_number(at.number(node, v)) for v in given))
    uses: frozenset[Any] = frozenset().union(*(each.uses for each in arguments))
    if function in EXTREMES:
        name = EXTREMES[function]
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
    """Return the functions that exports bring themselves."""
    return _OURS_IN_DOUBLE if at.body.structs.precision.name == "double" else _OURS


def _made(at: Context, node: ast.AST, cls: Any, given: list[Any], named: Named) -> Built:
    defaults = {name: Known(value) for name, value in cls._field_defaults.items()}
    items = {**defaults, **dict(zip(cls._fields, given, strict=False)), **named}
    missing = [name for name in cls._fields if name not in items]
    if missing or len(given) > len(cls._fields):
        raise at.refuse(node, f"fields and values of {cls.__name__} do not match")
    return Built(cls, {name: items[name] for name in cls._fields})


def _class_method(at: Context, node: ast.AST, target: Any, given: list[Any], named: Named) -> Any:
    cls, name = target.__self__, target.__func__.__name__
    if is_named_tuple(cls) and name == "_make":
        return Built(cls, dict(zip(cls._fields, at.sequence(node, given[0]), strict=True)))
    if is_parameter_class(cls) and name == "model_construct":
        return BuiltGroup(cls, {n: named[n] for n in cls.model_fields if n in named})
    if all(isinstance(each, Known) for each in (*given, *named.values())):
        values = {n: each.value for n, each in named.items()}
        return Known(target(*(each.value for each in given), **values))
    return at.translation.call(at, node, target.__func__, [Known(cls), *given], named)


def _method(at: Context, node: ast.AST, method: Method, given: list[Any], named: Named) -> Any:
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
    raise at.refuse(node, f"the method {name} is not translated")


def _zipped(at: Context, node: ast.AST, given: list[Any], named: Named) -> Any:
    rows = [at.sequence(node, each) for each in given]
    return Items(tuple(Items(row) for row in zip(*rows, strict=False)))


def _enumerated(at: Context, node: ast.AST, given: list[Any], named: Named) -> Any:
    rows = enumerate(at.sequence(node, given[0]))
    return Items(tuple(Items((Known(k), each)) for k, each in rows))


def _listed(at: Context, node: ast.AST, given: list[Any], named: Named) -> Any:
    return Items(at.sequence(node, given[0]) if given else ())


def _length(at: Context, node: ast.AST, given: list[Any], named: Named) -> Any:
    return Known(len(at.sequence(node, given[0])))


def _dictionary(at: Context, node: ast.AST, given: list[Any], named: Named) -> Any:
    items: dict[str, Any] = {}
    for each in map(lifted, given):
        if isinstance(each, Group):
            items |= {
                n: Known(kind.value) if isinstance(kind, Choice) else _entry(at, node, each, n)
                for n, kind in each.shape.fields
            }
        elif isinstance(each, (BuiltGroup, Table)):
            items |= each.items
        else:
            for pair in at.sequence(node, each):
                name, value = at.sequence(node, pair)
                items[at.known(node, name, "keys must be known at export")] = value
    return Table({**items, **named})


def _entry(at: Context, node: ast.AST, owner: Any, name: str) -> Any:
    return attribute(at, node, owner, name)


def _attribute_named(at: Context, node: ast.AST, given: list[Any], named: Named) -> Any:
    name = at.known(node, given[1], "names of fields must be known at export")
    return _entry(at, node, given[0], name)


def _sum(at: Context, node: ast.AST, given: list[Any], named: Named) -> Any:
    total: Any = [*given[1:], *named.values(), Known(0)][0]
    for each in at.sequence(node, given[0]):
        if isinstance(total, Known) and isinstance(each, Known):
            total = Known(total.value + each.value)
            continue
        a, b = (at.body.as_number(at.number(node, v)) for v in (total, each))
        total = Expr(f"{a.at(SUM)} + {b.at(SUM + 1)}", SUM, a.uses | b.uses)
    return total


def _extreme(function: Any) -> Callable[..., Any]:
    """Return the rule of max or min, which keep the first of equal values."""

    def rule(at: Context, node: ast.AST, given: list[Any], named: Named) -> Any:
        values = given if len(given) > 1 else list(at.sequence(node, given[0]))
        best = values[0]
        for each in values[1:]:
            best = _elementary(at, node, function, [best, each])
        return best

    return rule


def _float(at: Context, node: ast.AST, given: list[Any], named: Named) -> Any:
    value = given[0]
    if isinstance(value, Known):
        return Known(float(value.value))
    return at.body.as_number(at.number(node, value))


def _absolute(at: Context, node: ast.AST, given: list[Any], named: Named) -> Any:
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
