"""Fixtures for tests of the simulation."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of a kernel cache for one test."""
    folder = tmp_path / "kernels"
    monkeypatch.setenv("BYWIRE_CACHE", str(folder))
    return folder
