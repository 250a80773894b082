"""Expressions of Python, evaluated on known objects and on C text."""

from __future__ import annotations

import ast
import builtins
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from bywire.core.errors import ModelError
from bywire.export.controller.body import Body
from bywire.export.controller.c_values import is_number, literal
from bywire.export.controller.calls import called
from bywire.export.controller.context import Functions
from bywire.export.controller.members import attribute
from bywire.export.controller.operators import binary, compared, connected, unary
from bywire.export.controller.values import (
    Array,
    Built,
    Closure,
    Expr,
    Items,
    Known,
    Record,
    Table,
    lifted,
)


@dataclass
class Evaluator:
    """Evaluates the expressions of a function.

    Parameters
    ----------
    file
        Where it is written, for what cannot be translated.
    module
        Names of the function's module.
    scope
        Values of its variables.
    """

    translation: Functions
    body: Body
    file: str
    module: Mapping[str, Any]
    scope: dict[str, Any] = field(default_factory=dict)

    def refuse(self, node: ast.AST, what: str) -> ModelError:
        """Return the error for an expression or a statement that C does not get."""
        line = getattr(node, "lineno", 0)
        shown = ast.unparse(node).splitlines()[0][:60]
        return ModelError(
            f"{self.file}, line {line}: the ECU cannot be exported as C: {what}, in: {shown}"
        )

    def value(self, node: ast.expr) -> Any:
        """Return what an expression is."""
        rule = getattr(self, f"_{type(node).__name__.lower()}", None)
        if rule is None:
            raise self.refuse(node, f"{type(node).__name__} is not translated")
        try:
            return rule(node)
        except (ArithmeticError, LookupError) as error:  # as Python would have it at run time
            raise self.refuse(node, str(error)) from None

    def number(self, node: ast.AST, value: Any) -> Expr:
        """Return the C text of a number or a truth value."""
        value = lifted(value)
        if isinstance(value, Expr):
            return value
        if isinstance(value, Known) and (is_number(value) or isinstance(value.value, bool)):
            return literal(value, self.body.structs)
        raise self.refuse(node, "a number is wanted here")

    def known(self, node: ast.AST, value: Any, why: str) -> Any:
        """Return the object of a value that export has to know."""
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
        raise self.refuse(node, "loops run over tuples of a known length only")

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
        raise self.refuse(node, "a dictionary with known keys is wanted here")

    def _joinedstr(self, node: ast.JoinedStr) -> Any:
        parts = []
        for each in node.values:
            inner = each.value if isinstance(each, ast.FormattedValue) else each
            value = self.value(inner)
            parts.append(str(self.known(each, value, "texts must be known at export")))
        return Known("".join(parts))

    def _lambda(self, node: ast.Lambda) -> Any:
        return Closure(node, dict(self.scope), self.file, self.module)

    def _ifexp(self, node: ast.IfExp) -> Any:
        return self.value(node.body if self.truth(node.test) else node.orelse)

    def truth(self, node: ast.expr) -> bool:
        """Return whether a structural condition holds."""
        value = self.value(node)
        if isinstance(value, (Items, Table)):
            return bool(value.values if isinstance(value, Items) else value.items)
        why = "it depends on a value that only the running ECU knows: use ops.where"
        return bool(self.known(node, value, why))

    def _unaryop(self, node: ast.UnaryOp) -> Any:
        return unary(self, node, self.value(node.operand))

    def _binop(self, node: ast.BinOp) -> Any:
        return binary(self, node, self.value(node.left), self.value(node.right))

    def _compare(self, node: ast.Compare) -> Any:
        if len(node.ops) > 1:
            raise self.refuse(node, "chained comparisons are not translated")
        return compared(self, node, self.value(node.left), self.value(node.comparators[0]))

    def _boolop(self, node: ast.BoolOp) -> Any:
        return connected(self, node, map(self.value, node.values))

    def _subscript(self, node: ast.Subscript) -> Any:
        value = lifted(self.value(node.value))
        if isinstance(value, Table):
            key = self.known(node, self.value(node.slice), "keys must be known at export")
            return value.items[key]
        entries = self.sequence(node, value)
        if isinstance(node.slice, ast.Slice):
            bounds = [
                None if each is None else self.known(node, self.value(each), "slices must be known")
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
        """Let loop variables stand for values, without variables of C."""
        if isinstance(target, ast.Name):
            self.scope[target.id] = self.body.settled(value, target.id)
            return
        if not isinstance(target, (ast.Tuple, ast.List)):
            raise self.refuse(target, "only names can be assigned")
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
