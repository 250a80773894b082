"""Examples in docstrings: what they say comes out does."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import pytest
from repository_sources import MODULES, PACKAGE, label

EXAMPLES = [path for path in MODULES if ">>>" in path.read_text(encoding="utf-8")]


@pytest.mark.parametrize("path", EXAMPLES, ids=label)
def test_examples_of_docstrings(path: Path) -> None:
    """Those of modules alone that have some: the others need not be imported for it."""
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    module = importlib.import_module(".".join(parts).removesuffix(".__init__"))
    outcome = doctest.testmod(module)
    assert outcome.attempted > 0
    assert outcome.failed == 0


def test_a_wrong_example_is_seen() -> None:
    test = doctest.DocTestParser().get_doctest(">>> 1 + 1\n3\n", {}, "sum", None, 0)
    assert doctest.DocTestRunner(verbose=False).run(test, out=lambda _: None).failed == 1
