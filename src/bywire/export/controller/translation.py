"""Translation of an ECU's functions from Python to C, statement by statement."""

from __future__ import annotations

import ast
import importlib
import inspect
import types
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any

from bywire.core import ops
from bywire.core.errors import ModelError, place_of
from bywire.export.controller.c_text import c_name, unique
from bywire.export.controller.evaluation import Context, Evaluator, attribute
from bywire.export.controller.functions import (
    Body,
    CFunction,
    as_value,
    finish,
    given_back,
    kind_of,
    passed,
    received,
)
from bywire.export.controller.structs import Structs, ctype_of
from bywire.export.controller.values import (
    Array,
    Built,
    BuiltGroup,
    Closure,
    Expr,
    Given,
    Group,
    Items,
    Known,
    Memories,
    Method,
    Record,
    Site,
    Table,
    Update,
    Uses,
    lifted,
)

Function = ast.FunctionDef | ast.Lambda


@cache
def _text(name: str) -> str:
    return Path(name).read_text(encoding="utf-8")


@cache
def _functions(name: str) -> Mapping[int, Sequence[Function]]:
    """Return the functions of a file by the first line of their code."""
    found: dict[int, list[Function]] = {}
    for node in ast.walk(ast.parse(_text(name))):
        if isinstance(node, ast.FunctionDef):
            first = min([node.lineno, *(each.lineno for each in node.decorator_list)])
            found.setdefault(first, []).append(node)
        elif isinstance(node, ast.Lambda):
            found.setdefault(node.lineno, []).append(node)
    return found


def node_of(function: types.FunctionType) -> Function:
    """Return the syntax tree of a function.

    Raises
    ------
    ModelError
        If the source is missing, or if two functions are on the same line.
    """
    code = function.__code__
    try:
        here = _functions(code.co_filename).get(code.co_firstlineno, ())
    except OSError:
        raise ModelError(
            f"{place_of(function)}: bywire cannot export the ECU as C, because the source of "
            f"{function.__qualname__} is missing. Define it in a file",
            name=function.__qualname__,
        ) from None
    matches = [node for node in here if _is_of(node, code)]
    if len(matches) != 1:
        raise ModelError(
            f"{code.co_filename}, line {code.co_firstlineno}: bywire cannot export the ECU as C, "
            f"because {len(matches)} functions share the line of {function.__qualname__}. Put each "
            "function on its own line",
            name=function.__qualname__,
        )
    return matches[0]


def _is_of(node: Function, code: types.CodeType) -> bool:
    if isinstance(node, ast.FunctionDef):
        return node.name == code.co_name
    names = [each.arg for each in node.args.args]
    return code.co_name == "<lambda>" and names == list(code.co_varnames[: code.co_argcount])


def notes_above(file: str, line: int) -> list[str]:
    """Return the comment directly above a line of a file."""
    lines = _text(file).splitlines()
    notes: list[str] = []
    at = line - 2
    while at >= 0 and lines[at].strip().startswith("# "):
        notes.insert(0, lines[at].strip()[2:])
        at -= 1
    return notes


def description(function: types.FunctionType) -> list[str]:
    """Return the first line, the equations and the references of a function's docstring."""
    lines = inspect.cleandoc(function.__doc__ or "").splitlines()
    said, part = lines[:1], ""
    for line in lines[1:]:
        if line.startswith(".. math::"):
            part, line = "equation", line.removeprefix(".. math::")
        elif line == "References":
            part = "references"
        elif part == "equation" and line and not line.startswith(" "):
            part = ""
        if part and line.strip("- ") and line != "References":
            said.append(line.strip())
    module = function.__module__.rpartition("bywire.")[2] or function.__module__
    return [*said, f"Source: {module}.{function.__qualname__}"]


def stores(node: ast.AST) -> Counter[str]:
    """Return the number of assignments to each variable; an assignment in a loop counts twice."""
    counted: Counter[str] = Counter()
    weights: dict[ast.AST, int] = {node: 1}
    for each in ast.walk(node):
        weight = weights.get(each, 1)
        inner = 2 if isinstance(each, (ast.For, ast.While)) else weight
        for child in ast.iter_child_nodes(each):
            weights[child] = inner
        if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store):
            counted[each.id] += weight
        elif isinstance(each, ast.arg):
            counted[each.arg] += 1
        elif isinstance(each, ast.AugAssign) and isinstance(each.target, ast.Name):
            counted[each.target.id] += 1
    return counted


def closure_of(function: types.FunctionType) -> dict[str, Any]:
    """Return the variables that a function uses from its enclosing functions."""
    cells = function.__closure__ or ()
    return {
        name: cell.cell_contents
        for name, cell in zip(function.__code__.co_freevars, cells, strict=True)
    }


# --- Statements: assignments, structural conditions, loops over tuples, returns


@dataclass
class Returned:
    """A value that a function returned, and its expression."""

    value: Any
    node: ast.AST


class Executor(Evaluator):
    """Executor that runs the statements of a function once, to find its structure."""

    def run(self, statements: list[ast.stmt]) -> Returned | None:
        """Return the returned value; None if the function continues."""
        for statement in statements:
            rule = getattr(self, f"_do_{type(statement).__name__.lower()}", None)
            if rule is None:
                what = f"the statement {type(statement).__name__} is not supported"
                raise self.refuse(statement, what)
            self.body.notes[:] = notes_above(self.file, statement.lineno)
            returned = rule(statement)
            if returned is not None:
                return returned  # type: ignore[no-any-return]
        return None

    def _do_expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            raise self.refuse(node, "a statement without a result is not supported")

    def _do_pass(self, node: ast.Pass) -> None:
        return None

    def _do_return(self, node: ast.Return) -> Returned:
        if node.value is None:
            raise self.refuse(node, "a law must return a value")
        return Returned(self.value(node.value), node.value)

    def _do_if(self, node: ast.If) -> Returned | None:
        return self.run(node.body if self.truth(node.test) else node.orelse)

    def _do_for(self, node: ast.For) -> Returned | None:
        for entry in self.sequence(node.iter, self.value(node.iter)):
            self.bind(node.target, entry)
            returned = self.run(node.body)
            if returned is not None:
                return returned
        return self.run(node.orelse)

    def _do_functiondef(self, node: ast.FunctionDef) -> None:
        self.scope[node.name] = Closure(node, self.scope, self.file, self.module)

    def _do_importfrom(self, node: ast.ImportFrom) -> None:
        home = importlib.import_module(node.module or "", self.module.get("__package__"))
        for each in node.names:
            self.scope[each.asname or each.name] = Known(getattr(home, each.name))

    def _do_raise(self, node: ast.Raise) -> None:
        raise self.refuse(node, "the law rejects these parameters")

    def _do_annassign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self._assign(node.target, self.value(node.value))

    def _do_augassign(self, node: ast.AugAssign) -> None:
        load = ast.copy_location(ast.parse(ast.unparse(node.target), mode="eval").body, node)
        whole = ast.copy_location(ast.BinOp(load, node.op, node.value), node)
        self._assign(node.target, self.value(ast.fix_missing_locations(whole)))

    def _do_assign(self, node: ast.Assign) -> None:
        value = self.value(node.value)
        for target in node.targets:
            self._assign(target, value)

    def _assign(self, target: ast.expr, value: Any) -> None:
        if isinstance(target, ast.Name):
            self.scope[target.id] = self.named(target.id, value)
            return
        if not isinstance(target, (ast.Tuple, ast.List)):
            raise self.refuse(target, "only a name can be assigned")
        values = list(self.sequence(target, value))
        names = {each.id for each in target.elts if isinstance(each, ast.Name)}
        for at, each in enumerate(values[1:], 1):
            used = {use[1] for use in _uses(each) if use[0] == "local"}
            is_memory = self.body.structs.is_memory(each)
            if used & names and not isinstance(each, Update) and not is_memory:
                values[at] = self.body.variable("then", each)
        for each, entry in zip(target.elts, values, strict=True):
            self._assign(each, entry)

    def named(self, name: str, value: Any) -> Any:
        """Return a value named like a Python variable; an unknown value gets a C variable."""
        value = lifted(value)
        body = self.body
        if isinstance(value, Expr):
            there = body.derived(value, name)
            if there is not value:
                return there
        if isinstance(value, (Known, Closure, Method, Array)):
            return value
        if body.structs.is_memory(value):
            is_new = isinstance(value, Built)
            return body.variable(name, value) if is_new else body.settled(value, name)
        if isinstance(value, Update) and self._is_own(name, value.record):
            body.update(value.record, value.items)
            return value.record
        if isinstance(value, Group) and (value.origin or body.is_stable(value.expr)):
            return value
        if isinstance(value, (Items, Table)):
            return body.settled(value, name)
        if not isinstance(value, (Expr, Record, Built, Update, Group, BuiltGroup)):
            raise TypeError(type(value).__name__)
        return self._variable(name, value)

    def _is_own(self, name: str, record: Record) -> bool:
        """Return whether the variable of this name already contains a NamedTuple."""
        own = self.scope.get(name)
        return isinstance(own, Record) and own.expr.text == record.expr.text and not own.pointer

    def _variable(self, name: str, value: Any) -> Any:
        body: Body = self.body
        ctype = ctype_of(body.structs, value)
        held = self.scope.get(name)
        place = held.expr if isinstance(held, (Record, Group)) else held
        is_own = isinstance(place, Expr) and body.types.get(place.text) == ctype
        if is_own and isinstance(place, Expr):
            if isinstance(value, Update):
                value = body.variable(f"{name}_new", value)
            body.moving.add(place.text)
            return body.variable(name, value, place.text)
        target = body.fresh(name)
        body.types[target] = ctype
        if body.stores[name] > 1:
            body.moving.add(target)
        return body.variable(name, value, target)


def _uses(value: Any) -> frozenset[Any]:
    if isinstance(value, Expr):
        return value.uses
    if isinstance(value, (Record, Group)):
        return value.expr.uses
    if isinstance(value, (Built, BuiltGroup, Table)):
        return frozenset().union(*(_uses(each) for each in value.items.values()))
    if isinstance(value, Items):
        return frozenset().union(*(_uses(each) for each in value.values))
    return frozenset()


# --- Functions: one version of each law for every structure of its arguments

DEEP = 40
"""call depth above which a law is treated as recursive"""


@dataclass
class Translation:
    """Functions, structures and constants of an export.

    Parameters
    ----------
    is_plant
        ``is_plant(function, arguments)``: whether a function belongs to the plant side.
    prefix
        Prefix of function names in headers.
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
        """Return an object of a module; a number keeps the name of its C constant."""
        if isinstance(value, float) and module != "math" and name.strip("_").isupper():
            called = c_name(f"{module.rpartition('.')[2]}_{name.strip('_')}").upper()
            if self.constants.setdefault(called, value) == value:
                return Known(value, called)
        return Known(value)

    def call(self, at: Context, node: ast.AST, function: Any, given: list[Any], named: Any) -> Any:
        """Return the result of a call, which is a C call if the result is unknown at export."""
        function = inspect.unwrap(function)
        if not isinstance(function, types.FunctionType):
            raise at.refuse(node, f"{function!r} is not supported")
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
        """Return the C call, and its memory arguments by name."""
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
        """Return the C function of a Python function for one kind of arguments."""
        # An elementary function has a single version for all kinds of arguments.
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
                    f"bywire cannot export the ECU as C, because {function.__qualname__} calls "
                    "itself",
                    name=function.__qualname__,
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
            raise at.refuse(node, "a law must return a value")
        return returned

    def inlined(
        self, at: Context, node: ast.AST, closure: Closure, given: list[Any], named: Any
    ) -> Any:
        """Return the result of a function that is defined in its caller and inlined there."""
        names = [each.arg for each in closure.node.args.args]
        values = {**dict(zip(names, given, strict=False)), **named}
        if set(values) != set(names):
            raise at.refuse(node, "an inner function must be called with all its arguments")
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
    """Return a function's result in terms of the caller's arguments."""
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
        raise at.refuse(node, "a law must return numbers, not a table of parameters")
    return value
