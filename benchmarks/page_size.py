"""Size of a bench page as a server sends it."""

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
        Name of the figure.
    write
        ``write(path)``: writes the page and returns its bytes, as a file and compressed.
    goal
        Maximum compressed size [kB].
    """
    with tempfile.TemporaryDirectory() as folder:
        size, compressed = write(Path(folder) / "page.html")
    what = f"compressed bench page; {size / 1e3:.0f} kB on disk"
    return [at_most(name, compressed / 1e3, goal, "kB", what)]
