"""Where a module declares a thing: the line on which the name that holds it is bound."""

from __future__ import annotations

import ast
import inspect
from types import ModuleType


def declared_at(module: ModuleType, thing: object) -> str:
    """Return file and line of what a module declares; the file alone where nobody knows the line.

    Parameters
    ----------
    module
        Module that holds it, by a name of its own or in a tuple; what it imports has no line there.
    thing
        Object, or class.
    """
    line = declared_line(module, thing)
    file = module.__file__ or module.__name__
    return f"{file}, line {line}" if line else file


def declared_line(module: ModuleType, thing: object) -> int:
    """Return the line on which a module declares a thing; 0 where nobody knows."""
    try:
        tree = ast.parse(inspect.getsource(module))
    except (OSError, TypeError, SyntaxError):  # typed into a console, or changed since
        return 0
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and vars(module).get(node.name) is thing:
            return node.lineno
        if isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            held = [vars(module).get(each.id) for each in targets if isinstance(each, ast.Name)]
            line = next((_line(node, value, thing) for value in held if value is not None), 0)
            if line:
                return line
    return 0


def _line(node: ast.Assign | ast.AnnAssign, held: object, thing: object) -> int:
    """Return the line of a thing in an assignment whose name holds it; 0 where it does not."""
    if held is thing:
        return node.lineno
    if type(held) is not tuple or not any(each is thing for each in held):
        return 0
    written = node.value
    if isinstance(written, ast.Tuple) and len(written.elts) == len(held):
        return written.elts[[each is thing for each in held].index(True)].lineno
    return node.lineno
