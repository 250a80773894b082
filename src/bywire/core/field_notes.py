"""What the fields of a parameter set mean, read from the texts that stand under them.

Read when somebody asks and not when a class is built: reading sources took a tenth of the
start-up of every command.
"""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from types import MappingProxyType

from bywire.core.parameters import ParameterSet


@cache
def field_notes(cls: type[ParameterSet], prefix: str = "") -> Mapping[str, str]:
    """Return the meaning of every number and choice of a parameter class, by dotted name.

    Parameters
    ----------
    cls
        Its fields carry a string right below them; a field without one has the note ``""``.
    prefix
        Put before every name.
    """
    written: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        if issubclass(base, ParameterSet) and base is not ParameterSet:
            written |= _written_under_fields(base)
    notes: dict[str, str] = {}
    for name, info in cls.model_fields.items():
        inner = info.annotation
        if isinstance(inner, type) and issubclass(inner, ParameterSet):
            notes |= field_notes(inner, f"{prefix}{name}.")
        else:
            notes[f"{prefix}{name}"] = written.get(name, "")
    return MappingProxyType(notes)


def _written_under_fields(cls: type) -> Mapping[str, str]:
    try:
        source = inspect.getsource(sys.modules[cls.__module__])
    except (KeyError, OSError, TypeError):  # typed into a console: no source to read
        return {}
    return _written_in(source).get(cls.__qualname__, {})


@cache
def _written_in(source: str) -> Mapping[str, Mapping[str, str]]:
    """Return what stands under the fields of all classes of a file, by qualified name.

    Read at once: `inspect` parses a whole file for the source of each class.
    """
    return {name: _texts(definition) for name, definition in _classes(ast.parse(source))}


def _classes(node: ast.AST, prefix: str = "") -> Iterator[tuple[str, ast.ClassDef]]:
    """Yield the classes below a node with their qualified names."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.ClassDef):
            yield f"{prefix}{child.name}", child
            yield from _classes(child, f"{prefix}{child.name}.")
        elif isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from _classes(child, f"{prefix}{child.name}.<locals>.")
        elif not isinstance(child, ast.expr):  # a class may stand in a condition
            yield from _classes(child, prefix)


def _texts(definition: ast.ClassDef) -> Mapping[str, str]:
    """Return the strings right below the fields of a class, by field."""
    notes: dict[str, str] = {}
    for field, below in zip(definition.body, definition.body[1:], strict=False):
        match field, below:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(text))),
            ):
                notes[name] = inspect.cleandoc(text)
    return notes
