"""Arguments of C functions: what decides which function serves, what it is given, and as what."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from bywire.export.controller.body import Body
from bywire.export.controller.c_values import built_shape, ctype_of
from bywire.export.controller.structs import Structs
from bywire.export.controller.values import (
    Array,
    Built,
    BuiltGroup,
    Expr,
    Group,
    Items,
    Known,
    Record,
    Table,
    Update,
    lifted,
)


@dataclass(frozen=True)
class Argument:
    """An argument in C."""

    name: str
    declaration: str


def kind_of(value: Any, structs: Structs) -> Any:
    """Return what of an argument decides which C function serves."""
    value = lifted(value)
    if isinstance(value, Expr):
        return "truth" if value.truth else "number"
    if isinstance(value, Known):
        if isinstance(value.value, float):
            return "number"
        return ("known", type(value.value), _hashable(value.value))
    if structs.is_memory(value):
        return "memory"
    if isinstance(value, Record) and value.pointer:
        return ("pointer", value.cls)
    if isinstance(value, (Record, Built)):
        return ("tuple", value.cls)
    if isinstance(value, Update):
        return ("tuple", value.record.cls)
    if isinstance(value, Items):
        return ("items", *(kind_of(each, structs) for each in value.values))
    if isinstance(value, Table):
        return ("table", *((name, kind_of(each, structs)) for name, each in value.items.items()))
    if isinstance(value, Array):
        return ("array", value.length)
    if isinstance(value, Group):
        return ("group", value.shape)
    if isinstance(value, BuiltGroup):
        return ("group", built_shape(value))
    return ("other", id(value))


def _hashable(value: Any) -> Any:
    try:
        hash(value)
    except TypeError:
        return id(value)
    return value


def received(value: Any, name: str, body: Body) -> Iterator[tuple[Any, Argument | None]]:
    """Yield what an argument is within the function, then its arguments in C."""
    value, structs = lifted(value), body.structs
    if isinstance(value, Known) and not isinstance(value.value, float):
        yield value, None
        return
    if isinstance(value, (Items, Table)):
        inner: dict[Any, Any] = {}
        arguments: list[Argument] = []
        each = value.items.items() if isinstance(value, Table) else enumerate(value.values)
        for key, entry in each:
            (inner[key], first), *more = received(entry, f"{name}_{key}", body)
            arguments += [a for _, a in [(None, first), *more] if a is not None]
        yield (
            Table(inner) if isinstance(value, Table) else Items(tuple(inner.values())),
            arguments[0] if arguments else None,
        )
        yield from ((None, a) for a in arguments[1:])
        return
    target = body.fresh(name)
    here = Expr(target, uses=frozenset({("local", target)}))
    ctype = ctype_of(structs, value) if not isinstance(value, Array) else structs.precision.real
    body.types[target] = ctype
    if isinstance(value, (Expr, Known)):
        is_truth = isinstance(value, Expr) and value.truth
        yield Expr(target, uses=here.uses, truth=is_truth), Argument(target, f"{ctype} {target}")
    elif stays_there(value, structs):
        there = Record(value.cls, here, pointer=True)
        yield there, Argument(target, f"const {ctype} *{target}")
    elif structs.is_memory(value):
        there = body.memory.at(structs.memory, target, pointer=True)
        yield there, Argument(target, f"{ctype} *{target}")
    elif isinstance(value, (Record, Built, Update)):
        cls = value.record.cls if isinstance(value, Update) else value.cls
        yield Record(cls, here), Argument(target, f"{ctype} {target}")
    elif isinstance(value, Array):
        declared = f"const {ctype} {target}[{value.length}]"
        yield Array(here, value.length), Argument(target, declared)
    else:
        shape = value.shape if isinstance(value, Group) else built_shape(value)
        made = Group(shape, here, pointer=True, origin=(target,))
        yield made, Argument(target, f"const {ctype} *{target}")


def stays_there(value: Any, structs: Structs) -> bool:
    """Return whether a NamedTuple is handed on as a pointer to what nobody changes: inputs."""
    return isinstance(value, Record) and value.pointer and not structs.is_memory(value)


def passed(value: Any, body: Body) -> Iterator[Expr | Record]:
    """Yield the C arguments of a value, in the order of `received`; memory as it is."""
    value = lifted(value)
    if isinstance(value, Known) and not isinstance(value.value, float):
        return
    if isinstance(value, (Items, Table)):
        each = value.items.values() if isinstance(value, Table) else value.values
        for entry in each:
            yield from passed(entry, body)
    elif body.structs.is_memory(value):
        made = body.settled(value, "memory")
        yield body.variable("memory", made) if isinstance(made, Built) else made
    elif isinstance(value, Array) or stays_there(value, body.structs):
        yield value.expr
    elif isinstance(value, BuiltGroup) or (isinstance(value, Group) and not value.expr.is_path):
        yield from passed(body.variable("values", value), body)
    elif isinstance(value, Group):
        sign = "" if value.pointer else "&"
        yield Expr(f"{sign}{value.expr.text}", uses=value.expr.uses)
    else:
        yield body.rvalue(value)
