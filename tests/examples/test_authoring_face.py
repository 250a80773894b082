"""What a brake is written with: one place to import from, and examples need no deeper one."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from bywire import authoring

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").rglob("*.py"))
DEEP = re.compile(r"^\s*(?:from|import)\s+bywire\.\w+\.\w+", re.MULTILINE)


@pytest.mark.parametrize("name", authoring.__all__)
def test_every_name_is_there(name: str) -> None:
    assert getattr(authoring, name) is not None


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse(Path(authoring.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    seen = {}
    for node in block.body:
        assert isinstance(node, ast.ImportFrom)
        for alias in node.names:
            seen[alias.asname or alias.name] = (node.module, alias.name)
    assert sorted(seen) == sorted(authoring.__all__)
    for name, (module, attribute) in seen.items():
        home = import_module(module)
        there = getattr(home, attribute, None) or import_module(f"{module}.{attribute}")
        assert getattr(authoring, name) is there, name


def test_unknown_names_are_refused() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'Brke'"):
        authoring.Brke  # noqa: B018


def test_a_name_loads_its_home_alone() -> None:
    code = (
        "import sys\nfrom bywire.authoring import Brake\n"
        "assert not {'numpy', 'casadi', 'matplotlib'} & set(sys.modules), 'loaded'"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_examples_import_two_levels_deep(file: Path) -> None:
    assert DEEP.findall(file.read_text(encoding="utf-8")) == []
