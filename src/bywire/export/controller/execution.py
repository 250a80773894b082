"""Statements of Python: assignments, structural conditions, loops over tuples, returns."""

from __future__ import annotations

import ast
import importlib
from dataclasses import dataclass
from typing import Any

from bywire.export.controller.body import Body
from bywire.export.controller.c_values import ctype_of
from bywire.export.controller.evaluation import Evaluator
from bywire.export.controller.source import notes_above
from bywire.export.controller.values import (
    Array,
    Built,
    BuiltGroup,
    Closure,
    Expr,
    Group,
    Items,
    Known,
    Method,
    Record,
    Table,
    Update,
    lifted,
)


@dataclass
class Returned:
    """What a function returned, and the expression that says so."""

    value: Any
    node: ast.AST


class Executor(Evaluator):
    """Runs the statements of a function once, for its structure."""

    def run(self, statements: list[ast.stmt]) -> Returned | None:
        """Return what the statements return; None where they go on."""
        for statement in statements:
            rule = getattr(self, f"_do_{type(statement).__name__.lower()}", None)
            if rule is None:
                what = f"a statement {type(statement).__name__} is not translated"
                raise self.refuse(statement, what)
            self.body.notes[:] = notes_above(self.file, statement.lineno)
            returned = rule(statement)
            if returned is not None:
                return returned  # type: ignore[no-any-return]
        return None

    def _do_expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            raise self.refuse(node, "a statement without a result is not translated")

    def _do_pass(self, node: ast.Pass) -> None:
        return None

    def _do_return(self, node: ast.Return) -> Returned:
        if node.value is None:
            raise self.refuse(node, "a law returns a value")
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
        raise self.refuse(node, "the law refuses these parameters")

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
            raise self.refuse(target, "only names can be assigned")
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
        """Return a value under the name of a Python variable, put into one of C where it runs."""
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
        """Return whether a NamedTuple stands in the variable of this name already."""
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
