"""Every module, public class and public function says what it is for."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest
from repository_sources import MODULES, label, tree

Documented = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def public(node: ast.AST, prefix: str = "") -> Iterator[tuple[str, Documented]]:
    """Yield the public classes and functions of a module, and the methods of its classes."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, Documented) and not child.name.startswith("_"):
            yield f"{prefix}{child.name}", child
            if isinstance(child, ast.ClassDef):
                yield from public(child, f"{child.name}.")


def undocumented(module: ast.Module) -> list[str]:
    """Return what has no docstring."""
    found = [] if ast.get_docstring(module) else ["module"]
    return found + [name for name, node in public(module) if not ast.get_docstring(node)]


def misnamed_parameters(module: ast.Module) -> list[str]:
    """Return the names that a docstring explains and the function does not take."""
    found = []
    for name, node in public(module):
        if isinstance(node, ast.ClassDef):
            continue
        arguments = {a.arg for a in [*node.args.posonlyargs, *node.args.args]}
        arguments |= {a.arg for a in node.args.kwonlyargs}
        arguments |= {a.arg for a in (node.args.vararg, node.args.kwarg) if a}
        found += [f"{name}: {p}" for p in explained(node) if p not in arguments]
    return found


def explained(node: Documented) -> list[str]:
    """Return the parameters that a numpydoc docstring explains."""
    lines = (ast.get_docstring(node) or "").splitlines()
    if "Parameters" not in lines:
        return []
    names: list[str] = []
    for line in lines[lines.index("Parameters") + 2 :]:
        if line.startswith("---"):
            names.pop()  # the title of the next section
            break
        if line and not line.startswith(" "):
            names += [name.strip().lstrip("*") for name in line.split(":")[0].split(",")]
    return names


@pytest.mark.parametrize("path", MODULES, ids=label)
def test_everything_public_has_a_docstring(path):
    assert undocumented(tree(path)) == []


@pytest.mark.parametrize("path", MODULES, ids=label)
def test_docstrings_explain_parameters_that_exist(path):
    assert misnamed_parameters(tree(path)) == []


def test_the_gates_can_fail():
    bare = ast.parse("class A:\n    def f(self): ...\n    def _g(self): ...\ndef h(): ...\n")
    assert undocumented(bare) == ["module", "A", "A.f", "h"]
    lines = ["def f(x):", '    """F.', "", "    Parameters", "    ----------", "    y", '    """']
    assert misnamed_parameters(ast.parse("\n".join(lines))) == ["f: y"]
