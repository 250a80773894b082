"""Help, JSON, reports, forms and signatures are what they were.

A wanted change is renewed with ``python tests/snapshots`` and read before it is committed.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from snapshots.compared import difference
from snapshots.subjects import GROUPS

STORED = Path(__file__).parent / "stored"


@pytest.mark.parametrize("group", GROUPS)
def test_what_users_see_is_unchanged(group: str) -> None:
    found = dict(GROUPS[group]())
    stored = {path.stem: path.read_text() for path in (STORED / group).glob("*.txt")}
    assert found.keys() == stored.keys()
    changed = {name: difference(stored[name], text) for name, text in found.items()}
    assert not {name: said for name, said in changed.items() if said}


def test_a_change_is_found() -> None:
    assert not difference("gain 8.6821 at 4 Hz", "gain 8.6822 at 4 Hz")
    assert "gain 8.9" in difference("a\ngain 8.6821", "a\ngain 8.9")
    assert "stable" in difference("stable", "unstable")
    assert "line 2" in difference("a", "a\nb")
