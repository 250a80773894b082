"""How large a bench in a page is, as a server sends it."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from benchmarks.result import Result, at_most


def page_size(name: str, write: Callable[[Path], tuple[int, int]], goal: float) -> list[Result]:
    """Measure a page.

    Parameters
    ----------
    name
        Of the figure.
    write
        ``write(path)``: writes the page and returns its bytes, as a file and compressed.
    goal
        The most that it may have, compressed [kB].
    """
    with tempfile.TemporaryDirectory() as folder:
        size, compressed = write(Path(folder) / "page.html")
    what = f"page of the bench, compressed; {size / 1e3:.0f} kB as it lies on a disk"
    return [at_most(name, compressed / 1e3, goal, "kB", what)]
