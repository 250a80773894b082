"""Digests cover everything that definitions reach, over any number of steps."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from bywire.core.definitions import definitions_digest


@pytest.fixture
def digest_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], str]:
    """Return the digest of function ``root`` in a module with a text."""

    def digest(text: str) -> str:
        name = f"written_{len(list(tmp_path.iterdir()))}"
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
        importlib.invalidate_caches()
        module = importlib.import_module(name)
        try:
            return definitions_digest([module.root], [name])
        finally:
            del sys.modules[name]

    monkeypatch.syspath_prepend(str(tmp_path))
    return digest


def test_a_collection_may_name_itself(digest_of: Callable[[str], str]) -> None:
    text = 'TABLE = {"gain": 2.0}\nTABLE = {**TABLE, "offset": 1.0}\ndef root(): return TABLE\n'
    assert digest_of(text) == digest_of(f"# the same, with a comment\n{text}")
    assert digest_of(text) != digest_of(text.replace("2.0", "3.0"))


def test_chains_of_definitions_may_exceed_the_stack(digest_of: Callable[[str], str]) -> None:
    count = 2 * sys.getrecursionlimit()
    chain = "".join(f"def f{k}(): return f{k + 1}()\n" for k in range(count))
    text = f"{chain}def f{count}(): return 2.0\nroot = f0\n"
    assert digest_of(text) == digest_of(f"# the same, with a comment\n{text}")
    assert digest_of(text) != digest_of(text.replace("2.0", "3.0"))


def test_long_sums_may_exceed_the_stack(digest_of: Callable[[str], str]) -> None:
    text = f"def root(x): return {'x + ' * sys.getrecursionlimit()}2.0\n"
    assert digest_of(text) == digest_of(f"# the same, with a comment\n{text}")
    assert digest_of(text) != digest_of(text.replace("2.0", "3.0"))


def test_what_a_function_imports_hides_no_other_name(digest_of: Callable[[str], str]) -> None:
    """A collection is made of names of its module, whichever function reaches it."""
    text = (
        "def scale(): return 2.0\nTABLE = {'gain': scale()}\n"
        "def root():\n    from math import sqrt as scale\n    return TABLE, scale\n"
    )
    assert digest_of(text) != digest_of(text.replace("2.0", "3.0"))
