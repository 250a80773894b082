"""Figure: how key figures are spread over the cases of a study, with limits and percentiles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon

from bywire.core.typing import Array
from bywire.report import style
from bywire.report.legend import legend_outside
from bywire.report.line_role import Role
from bywire.report.readable_axis import (
    beyond,
    few_labels,
    limit_text,
    name_beyond,
    scale_of,
    size_of,
)

_COLUMNS = 2
_HEIGHT = 1.5  # of a panel [inch]
_ROOM = 2.7  # width of a panel [inch]
_BINS = 60  # at most


@dataclass(frozen=True)
class Spread:
    """A key figure over the cases.

    Parameters
    ----------
    values
        In ``unit``, shape (cases,); NaN where it is not defined.
    unit
        SI unit, or ``"%"``.
    nominal
        What the bench itself gives; NaN where it is not defined.
    limit
        Limit that is required; None where there is none.
    """

    values: Array
    unit: str
    nominal: float
    limit: float | None = None


def histograms(spreads: Mapping[str, Spread], has_band: bool = True) -> Figure:
    """Draw a histogram of every key figure, by name, each in a panel of its own.

    Dashed the bench itself, dotted the limit.

    Parameters
    ----------
    spreads
        By name.
    has_band
        Whether a shaded band holds 90 % of the cases: of those that were drawn.
    """
    rows = -(-len(spreads) // _COLUMNS)
    figure = Figure(
        figsize=(style.WIDTH, 0.5 + _HEIGHT * rows), layout="constrained", facecolor="white"
    )
    grid = figure.subplots(rows, _COLUMNS, squeeze=False)
    bound, own = style.STROKES[Role.LIMIT], style.STROKES[Role.SET_POINT]
    has_limit = False
    for axes, (name, spread) in zip(grid.flat, spreads.items(), strict=False):
        style.dress(axes)
        scale = scale_of(spread.values, spread.unit)
        values = scale(spread.values[np.isfinite(spread.values)])
        _draw_counts(axes, values)
        if has_band:
            axes.axvspan(*np.quantile(values, (0.05, 0.95)), color=style.SHADE, zorder=0)
        for at, look in ((spread.nominal, own), (spread.limit, bound)):
            if at is None or not np.isfinite(at):
                continue
            if look is bound and (far := beyond(scale(at), values)):
                text = limit_text(at, spread.unit, size_of(spread.values))
                name_beyond(axes, text, far, look.color)
                continue
            has_limit |= look is bound
            axes.axvline(
                scale(at), color=look.color, linestyle=look.linestyle, linewidth=look.linewidth
            )
        style.few_ticks(axes, 3)
        few_labels(axes.xaxis, _ROOM)
        axes.set_xlabel(scale.label(name.replace("_", " ")))
        axes.set_ylabel("cases")
    for spare in list(grid.flat)[len(spreads) :]:
        spare.set_visible(False)
    lines: list[Artist] = [
        Line2D([], [], color=own.color, linestyle="--", label="the bench itself")
    ]
    if has_limit:
        lines.append(Line2D([], [], color=bound.color, linestyle=":", label="limit"))
    if has_band:
        lines.append(Patch(color=style.SHADE, label="90 % of the cases"))
    legend_outside(figure, lines)
    return figure


def _draw_counts(axes: Axes, values: Array) -> None:
    """Fill the outline of the counts of values.

    As a patch, its limits would be sought like those of curves: half as long as to lay out and
    draw the panel.
    """
    counts, edges = np.histogram(values, _bins(values))
    heights = np.concatenate([[0.0], np.repeat(counts, 2), [0.0]])
    outline = np.column_stack([np.repeat(edges, 2), heights])
    area = Polygon(outline, facecolor=style.BLUE, alpha=0.75)
    area.sticky_edges.y.append(0.0)
    axes.add_artist(area)
    axes.update_datalim(outline)
    axes.autoscale_view()


def _bins(values: Array) -> int:
    """Return how many bins show the shape of values and not their scatter."""
    edges = np.histogram_bin_edges(values, bins="auto") if np.ptp(values) > 0 else values[:2]
    return int(np.clip(edges.size - 1, 1, _BINS))
