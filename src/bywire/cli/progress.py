"""Progress on standard error; silent where nobody watches."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bywire.bench.running import Progress

_INTERVAL = 0.1  # s between two drawings of the bar


@contextmanager
def progress_bar() -> Iterator[Progress]:
    """Yield a function that shows the finished share of a labeled piece of work."""
    if not sys.stderr.isatty():
        yield lambda label, share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        auto_refresh=False,  # by a thread of its own: then nobody could copy this process
    )
    tasks = {}
    with bar:
        drawn = -_INTERVAL

        def show(label: str, share: float) -> None:
            nonlocal drawn
            if label not in tasks:
                tasks[label] = bar.add_task(label, total=1.0)
            now = time.monotonic()
            is_due = now - drawn >= _INTERVAL
            drawn = now if is_due else drawn
            bar.update(tasks[label], completed=share, refresh=is_due)

        yield show
