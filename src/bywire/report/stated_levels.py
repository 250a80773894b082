"""Levels that a source states, drawn under our curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bywire.core.units import convert
from bywire.report import style
from bywire.report.channel import Channel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from bywire.bench.stated import StatedLevel

_DASHES: tuple[style.Dash, ...] = ((0, (7, 3)), (0, (7, 2, 2, 2)), (0, (2, 2)))


def draw_stated(axes: Axes, levels: Sequence[StatedLevel], shown: Channel) -> None:
    """Draw levels as lines across an axes, below its curves, each with its own legend entry.

    ``shown``: a channel of the axes, for its unit.
    """
    for k, each in enumerate(levels):
        axes.axhline(
            convert(each.value, shown.symbol, shown.unit), color=style.GREEN, linewidth=1.4,
            linestyle=_DASHES[k % len(_DASHES)], zorder=2.3,
            label=style.plain(f"stated: {each.label}"),
        )  # fmt: skip
