"""Examples and the template import two levels deep: what moves inside bywire does not move them."""

from __future__ import annotations

import ast

from repository_sources import PACKAGE, ROOT, label, tracked, tree


def too_deep(module: ast.Module) -> list[str]:
    """Return the imports from bywire that go deeper than a room."""
    found = [node.module for node in ast.walk(module) if isinstance(node, ast.ImportFrom)]
    return [
        name for name in found
        if name and name.startswith("bywire.") and name.count(".") > 1
        and not name.startswith("bywire.template.")
    ]  # fmt: skip


def test_examples_import_two_levels_deep():
    folders = (ROOT / "examples", PACKAGE / "template")
    files = [
        path for path in tracked()
        if path.suffix == ".py" and any(path.is_relative_to(folder) for folder in folders)
    ]  # fmt: skip
    assert files
    assert {label(path): deep for path in files if (deep := too_deep(tree(path)))} == {}


def test_the_gate_of_depth_can_fail():
    assert too_deep(ast.parse("from bywire.core.signals import Signal")) == ["bywire.core.signals"]
    assert too_deep(ast.parse("from bywire.authoring import Signal")) == []
