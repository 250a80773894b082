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
        targets = node.targets if isinstance(node, ast.Assign) else []
        targets = [node.target] if isinstance(node, ast.AnnAssign) else targets
        for target in targets:
            held = vars(module).get(target.id) if isinstance(target, ast.Name) else None
            if held is thing and held is not None:
                return node.lineno
            if type(held) is tuple and any(each is thing for each in held):
                written = node.value
                if isinstance(written, ast.Tuple) and len(written.elts) == len(held):
                    return written.elts[[each is thing for each in held].index(True)].lineno
                return node.lineno
    return 0
