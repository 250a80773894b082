"""What members and calls ask of whoever evaluates an expression."""

from __future__ import annotations

import ast
from typing import Any, Protocol

from bywire.core.errors import ModelError
from bywire.export.controller.body import Body
from bywire.export.controller.values import Closure, Expr, Known


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
