"""Help, JSON, reports, forms and signatures are what they were.

A wanted change is renewed with ``python tests/snapshots`` and read before it is committed.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from snapshots.compared import difference
from snapshots.subjects import GROUPS, plain


@pytest.mark.parametrize("group", GROUPS)
def test_what_users_see_is_unchanged(group: str) -> None:
    """In a process of its own: other tests load brakes, which commands would offer."""
    check = [sys.executable, str(Path(__file__).parent), "--check", group]
    done = subprocess.run(check, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


def test_a_change_is_found() -> None:
    assert not difference("gain 8.6821 at 4 Hz", "gain 8.6822 at 4 Hz")
    assert "gain 8.9" in difference("a\ngain 8.6821", "a\ngain 8.9")
    assert "stable" in difference("stable", "unstable")
    assert "line 2" in difference("a", "a\nb")


def test_numbers_are_kept_and_digests_are_not() -> None:
    digest = "5a1c" * 16
    text = plain(f"value 0.009689293411397553, of {digest}", Path("/folder"))
    assert text == "value 0.009689293411397553, of HASH"
