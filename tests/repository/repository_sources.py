"""What the tests of the repository share: its files, and what its modules import."""

from __future__ import annotations

import ast
import subprocess
import tomllib
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src" / "bywire"
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
MODULES = sorted(PACKAGE.rglob("*.py"))
BENCHMARKS = sorted((ROOT / "benchmarks").rglob("*.py"))
_HOLDS_STATEMENTS = (ast.stmt, ast.ExceptHandler, ast.match_case)
FOLDERS = (".git", ".venv", ".venv-newest", "results", "dist", "build", "node_modules")


def label(path: Path) -> str:
    """Return how a file is named in the tests' output."""
    return path.relative_to(ROOT).as_posix()


@cache
def tree(path: Path) -> ast.Module:
    """Return the syntax tree of a module."""
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


def offenders(
    gate: Callable[[ast.Module], list[str]], modules: Iterable[Path] = MODULES
) -> dict[str, list[str]]:
    """Return what a gate objects to, by file."""
    objections = {label(path): gate(tree(path)) for path in modules}
    return {name: listed for name, listed in objections.items() if listed}


def imports(module: ast.AST, *, typing_too: bool = True) -> Iterator[str]:
    """Yield the full names of the modules that a module imports, inside functions as well."""
    for node in ast.iter_child_nodes(module):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
        elif isinstance(node, ast.If) and not typing_too and _is_for_typing(node.test):
            continue
        elif isinstance(node, _HOLDS_STATEMENTS):
            yield from imports(node, typing_too=typing_too)


def _is_for_typing(test: ast.expr) -> bool:
    return getattr(test, "id", getattr(test, "attr", "")) == "TYPE_CHECKING"


def importers(library: str, *, typing_too: bool = True) -> set[str]:
    """Return the modules of the package that import a library, relative to the package."""
    return {
        path.relative_to(PACKAGE).as_posix()
        for path in MODULES
        for name in imported(path, typing_too=typing_too)
        if name == library or name.startswith(f"{library}.")
    }


@cache
def imported(path: Path, *, typing_too: bool) -> frozenset[str]:
    """Return the full names of the modules that a file imports."""
    return frozenset(imports(tree(path), typing_too=typing_too))


@cache
def tracked() -> tuple[Path, ...]:
    """Return the files of the repository: those that git knows or would add, where it is there."""
    try:
        command = ["git", "-C", str(ROOT), "ls-files", "-co", "--exclude-standard", "-z"]
        names = subprocess.run(command, capture_output=True, check=True, text=True).stdout
        found = [ROOT / name for name in names.split("\0") if name]
    except (OSError, subprocess.CalledProcessError):  # an unpacked archive
        found = [p for p in ROOT.rglob("*") if not {*p.relative_to(ROOT).parts} & {*FOLDERS}]
        found = [p for p in found if "cache" not in str(p.relative_to(ROOT))]
    return tuple(sorted(path for path in found if path.is_file()))
