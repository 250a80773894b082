"""What the fields of a parameter set mean, read from the texts that stand under them.

Read when somebody asks and not when a class is built: reading sources took a tenth of the
start-up of every command.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Mapping
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


def _written_under_fields(cls: type) -> dict[str, str]:
    try:
        source = textwrap.dedent(inspect.getsource(cls))
    except (OSError, TypeError):  # typed into a console: no source to read
        return {}
    (definition,) = ast.parse(source).body
    assert isinstance(definition, ast.ClassDef)
    notes: dict[str, str] = {}
    for field, below in zip(definition.body, definition.body[1:], strict=False):
        match field, below:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(text))),
            ):
                notes[name] = inspect.cleandoc(text)
    return notes
