"""Values stated by a source: levels and ranges behind our curves, and texts for tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bywire.core.units import convert, difference_unit
from bywire.report.channel import Channel
from bywire.report.wording import amount

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from bywire.bench.stated import StatedFigure, StatedLevel, StatedRange
    from bywire.report.style import Dash

_DASHES: tuple[Dash, ...] = ((0, (7, 3)), (0, (7, 2, 2, 2)), (0, (2, 2)))
_OPACITY = 0.15  # opacity of a band: the curves' grid shines through


def draw_stated(axes: Axes, levels: Sequence[StatedLevel | StatedRange], shown: Channel) -> None:
    """Draw levels as lines across an axes and ranges as bands, each with its own legend entry.

    They are drawn behind the curves. ``shown``: a channel of the axes, for its unit.
    """
    from bywire.report import style  # loaded with Matplotlib, which texts for tables do not need

    for k, each in enumerate(levels):
        low, high, *lines = (
            convert(value, shown.symbol, shown.unit)
            for value in (each.low, each.high, *each.levels)
        )
        if high > low:
            axes.axhspan(low, high, facecolor=style.GREEN, alpha=_OPACITY, linewidth=0, zorder=1.4)
        for at, line in enumerate(lines):
            axes.axhline(
                line,
                color=style.GREEN,
                linewidth=1.4,
                linestyle=_DASHES[k % len(_DASHES)],
                zorder=2.3,
                label=None if at else style.plain(f"stated: {each.label}"),
            )


def stated_level(level: StatedLevel | StatedRange, unit: str) -> str:
    """Return the stated value of a signal in an SI unit, for example ``200 N·m ± 10 N·m``."""
    if len(level.levels) > 1:
        return f"{amount(level.low, unit)} to {amount(level.high, unit)}"
    return _within(level.levels[0], level.high - level.levels[0], unit)


def stated_figure(figure: StatedFigure, unit: str) -> str:
    """Return the stated limit of a key figure in its unit, for example ``<= 15 %``."""
    written = _within(figure.value, figure.tolerance, unit)
    return f"{figure.bound} {written}".strip()


def _within(value: float, tolerance: float, unit: str) -> str:
    off = f" ± {amount(tolerance, difference_unit(unit))}" if tolerance else ""
    return amount(value, unit) + off
