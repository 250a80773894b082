"""Size of the brake's page, and its response time to a slider."""

from __future__ import annotations

from pathlib import Path

from benchmarks.page_latency import page_latency
from benchmarks.page_size import page_size
from benchmarks.result import Result
from benchmarks.suite import Part
from bywire.usecases.export import page


def _written(path: Path) -> tuple[int, int]:
    written = page("hard-braking", path)
    return written.size, written.compressed


def _measured() -> list[Result]:
    size = page_size("page.size_kb", _written, 75.0)
    return size + page_latency("page.latency_ms", _written)


PART = Part("motorcycle page", _measured)
