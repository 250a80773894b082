"""Size of the brake's page."""

from __future__ import annotations

from pathlib import Path

from bywire.api.page import page
from bywire.benchmark.page_size import page_size
from bywire.benchmark.suite import Part


def _written(path: Path) -> tuple[int, int]:
    made = page("hard-braking", path)
    return made.size, made.compressed


PART = Part("motorcycle page", lambda: page_size("page.size_kb", _written, 75.0))
