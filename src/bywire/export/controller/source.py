"""The Python of a function: its syntax tree, its place, and the comments in it."""

from __future__ import annotations

import ast
import inspect
import types
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from bywire.core.errors import ModelError, place_of

Function = ast.FunctionDef | ast.Lambda


@cache
def _text(name: str) -> str:
    return Path(name).read_text(encoding="utf-8")


@cache
def _functions(name: str) -> Mapping[int, Sequence[Function]]:
    """Return the functions of a file by the line that their code begins at."""
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
        Where its source is not there, or two functions stand on its line.
    """
    code = function.__code__
    try:
        here = _functions(code.co_filename).get(code.co_firstlineno, ())
    except OSError:
        raise ModelError(
            f"{place_of(function)}: the ECU cannot be exported as C: the source of "
            f"{function.__qualname__} is not there; put it into a file"
        ) from None
    matches = [node for node in here if _is_of(node, code)]
    if len(matches) != 1:
        raise ModelError(
            f"{code.co_filename}, line {code.co_firstlineno}: the ECU cannot be exported as C: "
            f"{len(matches)} functions stand on the line of {function.__qualname__}; give it a "
            "line of its own"
        )
    return matches[0]


def _is_of(node: Function, code: types.CodeType) -> bool:
    if isinstance(node, ast.FunctionDef):
        return node.name == code.co_name
    names = [each.arg for each in node.args.args]
    return code.co_name == "<lambda>" and names == list(code.co_varnames[: code.co_argcount])


def notes_above(file: str, line: int) -> list[str]:
    """Return the comment right above a line of a file."""
    lines = _text(file).splitlines()
    notes: list[str] = []
    at = line - 2
    while at >= 0 and lines[at].strip().startswith("# "):
        notes.insert(0, lines[at].strip()[2:])
        at -= 1
    return notes


def description(function: types.FunctionType) -> list[str]:
    """Return what a function does: first line, equations and references of its docstring."""
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
    """Return how often every variable is assigned; what is assigned in a loop counts twice."""
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
    """Return what a function sees of the functions around it."""
    cells = function.__closure__ or ()
    return {
        name: cell.cell_contents
        for name, cell in zip(function.__code__.co_freevars, cells, strict=True)
    }
