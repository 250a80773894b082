"""All functions of an ECU in C: each law once for every structure in which it is called."""

from __future__ import annotations

import ast
import inspect
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from bywire.core import ops
from bywire.core.errors import ModelError
from bywire.export.controller.arguments import kind_of, passed, received
from bywire.export.controller.body import Body
from bywire.export.controller.c_text import c_name, unique
from bywire.export.controller.context import Context
from bywire.export.controller.execution import Executor, Returned
from bywire.export.controller.functions import CFunction, as_value, finish, given_back
from bywire.export.controller.members import attribute
from bywire.export.controller.memories import Memories, Site
from bywire.export.controller.source import closure_of, description, node_of, stores
from bywire.export.controller.structs import Structs
from bywire.export.controller.values import (
    Array,
    Closure,
    Expr,
    Given,
    Group,
    Items,
    Known,
    Record,
    Table,
    Uses,
    lifted,
)

DEEP = 40
"""calls within calls beyond which a law counts as recursive"""


@dataclass
class Translation:
    """Functions, structures and constants of an export.

    Parameters
    ----------
    is_plant
        ``is_plant(function, arguments)``: whether a function belongs to the plant's side.
    prefix
        What names of functions in headers begin with.
    """

    structs: Structs
    is_plant: Callable[[types.FunctionType, Mapping[str, Any]], bool]
    prefix: str = ""
    functions: dict[Any, CFunction] = field(default_factory=dict)
    names: set[str] = field(default_factory=set)
    constants: dict[str, float] = field(default_factory=dict)
    copied: set[Site] = field(default_factory=set)
    alive: list[Any] = field(default_factory=list)
    depth: int = 0

    def constant(self, module: str, name: str, value: Any) -> Known:
        """Return a module's object; a number of its own is called by its name in C."""
        if isinstance(value, float) and module != "math" and name.strip("_").isupper():
            called = c_name(f"{module.rpartition('.')[2]}_{name.strip('_')}").upper()
            if self.constants.setdefault(called, value) == value:
                return Known(value, called)
        return Known(value)

    def call(self, at: Context, node: ast.AST, function: Any, given: list[Any], named: Any) -> Any:
        """Return what a function gives, called in C where it is not known at export."""
        function = inspect.unwrap(function)
        if not isinstance(function, types.FunctionType):
            raise at.refuse(node, f"{function!r} is not translated")
        try:
            bound = inspect.signature(function).bind(*given, **named)
        except TypeError as error:
            raise at.refuse(node, f"{function.__qualname__}: {error}") from None
        arguments = self._arguments(at.body, bound)
        made = self.function(function, arguments, at.body)
        expr, memories = self._called(at, made, arguments)
        if not made.result:
            return _rooted(at, node, made.value, arguments, memories)
        changes = [memories[name].expr.text for name in memories if name in made.changes]
        value, result = made.value, ""
        if made.struct:
            result = at.body.fresh("result")
            here = Expr(result, uses=frozenset({("local", result)}))
            value = given_back(made, self.structs, here)
        if made.struct or changes:
            at.body.write(result, made.result, expr, changes=changes)
            return _rooted(at, node, value, arguments, memories)
        value = as_value(made.value, expr)
        return at.body.variable("values", value) if isinstance(value, Group) else value

    def _arguments(self, body: Body, bound: inspect.BoundArguments) -> dict[str, Any]:
        arguments: dict[str, Any] = {}
        for name, parameter in bound.signature.parameters.items():
            if name not in bound.arguments:
                if parameter.kind is inspect.Parameter.VAR_POSITIONAL:
                    arguments[name] = Items(())
                elif parameter.kind is inspect.Parameter.VAR_KEYWORD:
                    arguments[name] = Table({})
                else:
                    arguments[name] = Known(parameter.default)
                continue
            value = bound.arguments[name]
            if parameter.kind is inspect.Parameter.VAR_POSITIONAL:
                value = Items(tuple(value))
            elif parameter.kind is inspect.Parameter.VAR_KEYWORD:
                value = Table(value)
            arguments[name] = body.derived(value) if isinstance(value, Expr) else value
        return arguments

    def _called(
        self, at: Context, made: CFunction, arguments: Mapping[str, Any]
    ) -> tuple[Expr, dict[str, Record]]:
        """Return the call, and the memory that it is given by the names of its arguments."""
        wanted = {each.name for each in made.arguments}
        every = [e for value in arguments.values() for e in passed(value, at.body)]
        given = dict(zip(made.all_arguments, every, strict=True))
        self.structs.derivations.called(made.name, at.body.memory.function, given)
        memories: dict[str, Record] = {}
        kept: list[Expr] = []
        for name, value in zip(made.all_arguments, every, strict=True):
            if isinstance(value, Record):
                is_twice = value.expr.text in (each.expr.text for each in memories.values())
                if is_twice and made.changes:
                    value = at.body.variable("memory", value)
                memories[name] = at.body.owned(value) if name in made.changes else value
                value = at.body.address(memories[name])
            if name in wanted:
                kept.append(value)
        uses: Uses = frozenset({("call", made.name)}).union(*(each.uses for each in kept))
        return Expr(f"{made.name}({', '.join(each.text for each in kept)})", uses=uses), memories

    def function(
        self, function: types.FunctionType, arguments: Mapping[str, Any], caller: Body
    ) -> CFunction:
        """Return the C function of a Python function for arguments of a kind."""
        # Of elementary functions one serves, whatever decides their arguments.
        is_law = function.__module__ != ops.__name__
        steady = tuple(is_law and caller.is_steady(each) for each in arguments.values())
        closure = closure_of(function)
        self.alive += [*closure.values(), *(v for v in arguments.values())]
        kinds = tuple(kind_of(each, self.structs) for each in arguments.values())
        held = tuple((n, kind_of(Known(v), self.structs)) for n, v in closure.items())
        key = (function.__code__, held, kinds, steady)
        if key not in self.functions:
            self.depth += 1
            if self.depth > DEEP:
                raise ModelError(
                    f"{function.__code__.co_filename}, line {function.__code__.co_firstlineno}: "
                    f"the ECU cannot be exported as C: {function.__qualname__} calls itself"
                )
            made = self._translated(function, arguments, closure, steady)
            self.depth -= 1
            self.functions[key] = made
        return self.functions[key]

    def _translated(
        self,
        function: types.FunctionType,
        arguments: Mapping[str, Any],
        closure: dict[str, Any],
        steady: tuple[bool, ...],
    ) -> CFunction:
        node = node_of(function)
        short = "tick" if isinstance(node, ast.Lambda) else node.name
        module = function.__module__
        is_plant = self.is_plant(function, arguments)
        is_shown = is_plant and module != ops.__name__ and self.prefix
        own = f"{module.rpartition('.')[2]}_{short.lstrip('_')}"
        name = unique(c_name(f"{self.prefix}_{own}" if is_shown else own), self.names)
        self.names.add(name)
        made = CFunction(name, module, description(function), is_plant)
        body = Body(self.structs, stores(node), Memories(name, self.copied))
        scope: dict[str, Any] = {n: Known(v) for n, v in closure.items()}
        bound = next(iter(arguments.values()), None)
        if "__class__" in closure and isinstance(bound, Known):
            scope["super"] = Known(partial(super, closure["__class__"], bound.value))
        for (python_name, value), is_steady in zip(arguments.items(), steady, strict=True):
            (scope[python_name], first), *more = received(value, python_name, body)
            made.arguments += [a for _, a in [(None, first), *more] if a is not None]
            is_changed = body.stores[python_name] > 1 and not self.structs.is_memory(value)
            if is_changed and first is not None:
                body.moving.add(first.name)
            elif is_steady and first is not None:
                group = scope[python_name]
                body.fixed[first.name] = group.shape if isinstance(group, Group) else None
        made.all_arguments = [each.name for each in made.arguments]
        at = Executor(self, body, function.__code__.co_filename, function.__globals__, scope)
        returned = self._run(at, node)
        finish(made, body, returned.value, returned.node)
        return made

    def _run(self, at: Executor, node: ast.FunctionDef | ast.Lambda) -> Returned:
        if isinstance(node, ast.Lambda):
            return Returned(at.value(node.body), node.body)
        returned = at.run(node.body)
        if returned is None:
            raise at.refuse(node, "a law returns a value")
        return returned

    def inlined(
        self, at: Context, node: ast.AST, closure: Closure, given: list[Any], named: Any
    ) -> Any:
        """Return what a function gives that is defined within the caller, written out there."""
        names = [each.arg for each in closure.node.args.args]
        values = {**dict(zip(names, given, strict=False)), **named}
        if set(values) != set(names):
            raise at.refuse(node, "an inner function is called with all its arguments")
        inner = Executor(self, at.body, closure.file, closure.module, dict(closure.scope))
        inner.scope |= {n: at.body.settled(v, n) for n, v in values.items()}
        self.depth += 1
        if self.depth > DEEP:
            raise at.refuse(node, "an inner function calls itself")
        returned = self._run(inner, closure.node)
        self.depth -= 1
        return returned.value


def _rooted(
    at: Context,
    node: ast.AST,
    value: Any,
    arguments: Mapping[str, Any],
    memories: Mapping[str, Record],
) -> Any:
    """Return a function's result in its caller's words: what it was given is the caller's."""
    value = lifted(value)
    if isinstance(value, Given):
        given = memories[value.argument]
        return at.body.memory.at(given.cls, given.expr.text, given.pointer)
    if isinstance(value, Group) and value.origin:
        root, *path = value.origin
        group = next(v for n, v in arguments.items() if c_name(n) == root)
        for name in path:
            group = attribute(at, node, group, name)
        return group
    if isinstance(value, Items):
        each = (_rooted(at, node, v, arguments, memories) for v in value.values)
        return Items(tuple(each))
    if isinstance(value, Table):
        entries = value.items.items()
        return Table({n: _rooted(at, node, v, arguments, memories) for n, v in entries})
    if isinstance(value, Array):
        raise at.refuse(node, "a law returns numbers, not a table of parameters")
    return value
