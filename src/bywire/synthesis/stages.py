"""Progress of a search in stages: what each is called, and the share of it that is done."""

from __future__ import annotations

from collections.abc import Callable

from bywire.core.typing import Progress

Report = Callable[[float], None]
"""``report(share)``: the share of a stage that is done, 0 to 1"""


def stage(progress: Progress | None, label: str) -> Report:
    """Return what reports the share of one stage; nothing is shown where nobody watches."""
    if progress is None:
        return lambda share: None
    return lambda share: progress(label, min(max(share, 0.0), 1.0))


def piece(report: Report, k: int, count: int) -> Report:
    """Return what reports the share of one of several pieces of a stage."""
    return lambda share: report((k + share) / count)


def suffixed(progress: Progress | None, text: str) -> Progress | None:
    """Return progress whose labels say besides what they are of."""
    if progress is None:
        return None
    return lambda label, share: progress(f"{label}, {text}", share)
