"""Figures of a document drawn side by side, in copies of this process."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import TYPE_CHECKING

from bywire.core.copies import may_copy, processes
from bywire.core.machine import worker_count
from bywire.report.document import Picture

if TYPE_CHECKING:
    from bywire.report.document import FigureBlock

FEW = 4
"""figures up to which copies are not worth their start"""

# What a copy draws: it has them from the process that it was copied from.
_blocks: list[FigureBlock] = []


@contextmanager
def drawn_side_by_side(blocks: Sequence[FigureBlock]) -> Iterator[None]:
    """Draw figures while the block runs, where they are many and this process may be copied.

    When it ends their place is taken by what was drawn. Others are drawn when they are asked for.
    """
    count = worker_count(most=len(blocks))
    if len(blocks) <= FEW or count == 1 or not may_copy():
        yield
        return
    from bywire.report import drawing  # noqa: F401 - loaded once, for all copies

    _blocks[:] = blocks
    with processes(count, list, is_copied=True) as pool:
        # What is long is begun first: at the end it would have all but one copy wait.
        order = sorted(range(len(blocks)), key=lambda k: not blocks[k].is_long)
        drawn = {k: pool.submit(_picture, k) for k in order}
        yield
        try:
            for k, each in drawn.items():
                blocks[k].__dict__["figure"] = each.result()
        except BrokenProcessPool:  # killed, most likely for want of memory: the rest is drawn here
            pass
    _blocks.clear()


def _picture(k: int) -> Picture:
    from bywire.report.drawing import axes_of, figure_bytes

    figure = _blocks[k].figure
    png, svg = (figure_bytes(figure, kind) for kind in ("png", "svg"))
    return Picture(png, svg, axes_of(figure))
