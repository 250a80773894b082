"""Figures: spread of key figures over the cases of a study, and probabilities of values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon
from numpy.typing import NDArray

from bywire.core.typing import Array
from bywire.report import style
from bywire.report.channel import size_of
from bywire.report.panels import Role
from bywire.report.readable_axis import (
    Scale,
    beyond,
    few_labels,
    limit_text,
    name_beyond,
    scale_of,
    write_out,
)
from bywire.report.style import legend_outside
from bywire.studies.statistics import Share

_COLUMNS = 2
_HEIGHT = 1.5  # height of a panel [inch]
_ROOM = 2.7  # width of a panel [inch]


@dataclass(frozen=True)
class Histogram:
    """Histogram of a key figure's values in all cases, in ``unit``.

    Parameters
    ----------
    counts, edges
        Number of cases in each bin, and the edges of the bins.
    ends
        Least and largest value.
    band
        Ends of the band that contains 90 % of the cases.
    unit
        SI unit, or ``"%"``.
    nominal
        Value in the bench itself; NaN where it is not defined.
    limit
        Required limit; None for none.
    """

    counts: NDArray[np.int64]
    edges: Array
    ends: tuple[float, float]
    band: tuple[float, float]
    unit: str
    nominal: float
    limit: float | None = None


def histograms(spreads: Mapping[str, Histogram], has_band: bool = True) -> Figure:
    """Draw a histogram of every key figure, by name, each in its own panel.

    The dashed line is the bench itself, the dotted line the limit.

    Parameters
    ----------
    spreads
        By name.
    has_band
        Whether to shade a band that contains 90 % of the cases, for randomly drawn cases.
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
        ends = np.array(spread.ends)
        scale = scale_of(ends, spread.unit)
        _draw_counts(axes, spread.counts, _scaled(scale, spread))
        if has_band:
            axes.axvspan(*scale(np.array(spread.band)), color=style.SHADE, zorder=0)
        for at, look in ((spread.nominal, own), (spread.limit, bound)):
            if at is None or not np.isfinite(at):
                continue
            if look is bound and (far := beyond(scale(at), scale(ends))):
                text = limit_text(at, spread.unit, size_of(ends))
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


def _scaled(scale: Scale, spread: Histogram) -> Array:
    """Return the edges of bins in the unit of the axis; a single value has a bin around it."""
    least, largest = spread.ends
    return scale(spread.edges) if largest > least else scale(least) + np.array([-0.5, 0.5])


def _draw_counts(axes: Axes, counts: NDArray[np.int64], edges: Array) -> None:
    """Fill the outline of a histogram.

    A patch would make matplotlib search its limits like those of curves, which takes half as long
    as layout and drawing of the panel.
    """
    heights = np.concatenate([[0.0], np.repeat(counts, 2), [0.0]])
    outline = np.column_stack([np.repeat(edges, 2), heights])
    area = Polygon(outline, facecolor=style.BLUE, alpha=0.75)
    area.sticky_edges.y.append(0.0)
    axes.add_artist(area)
    axes.update_datalim(outline)
    axes.autoscale_view()


# --- Probability that a key figure is worse than a value, down to rare values


@dataclass(frozen=True)
class Curve:
    """A key figure and its exceedance probability.

    Parameters
    ----------
    name, unit
        The figure, in SI or ``"%"``.
    limit, admitted
        Limit, and maximum probability of missing it.
    values
        Shape (points,).
    probability, low, high
        Estimate and interval at each value; NaN where it is undefined.
    """

    name: str
    unit: str
    limit: float
    admitted: float
    values: Array
    probability: Array
    low: Array
    high: Array


def exceedance(curves: Sequence[Curve]) -> Figure:
    """Draw every curve with a logarithmic probability, each in a panel with its own abscissa."""
    figure, panels = style.new_figure(0.5 + 2.0 * len(curves), [1.0] * len(curves), is_shared=False)
    look = style.STROKES[Role.LIMIT]
    for axes, each in zip(panels, curves, strict=True):
        known = each.probability > 0.0
        scale = scale_of(np.append(each.values[known], each.limit), each.unit)
        values, limit = scale(each.values[known]), scale(each.limit)
        axes.fill_between(
            values, each.low[known], each.high[known], color=style.SHADE, label="interval"
        )
        axes.plot(values, each.probability[known], color=style.BLUE, label="estimate")
        axes.axvline(
            limit,
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            label="limit, admissible probability",
        )
        axes.axhline(
            each.admitted, color=look.color, linestyle=look.linestyle, linewidth=look.linewidth
        )
        axes.set_yscale("log")
        axes.set_ylabel("probability [-]")
        axes.set_ylim(top=2.0, bottom=0.3 * float(np.min(each.probability[known], initial=0.1)))
        few_labels(axes.xaxis, style.WIDTH - 1.0)
        axes.set_xlabel(scale.label(each.name.replace("_", " ")))
    style.legend_above(panels[0])
    return figure


# --- Convergence of a probability's estimate, case by case

_MARGIN = 8.0  # maximum displayed interval, relative to the admissible probability of failure
_LONG = 10.0  # ratio of case numbers above which their axis is logarithmic


def convergence(
    shares: Mapping[str, Sequence[Share]], wanted: Mapping[str, float | None], first: int = 1
) -> Figure:
    """Draw the fraction of the first cases that meet a requirement, versus their number.

    Ordinates reach from slightly below the required probability to 100 %.

    Parameters
    ----------
    shares
        Text of a requirement -> fraction of the first cases, with its interval, for increasing
        numbers.
    wanted
        Required probability, drawn as a dotted line; None for none.
    first
        Number of cases at which the curve starts, because the interval of a few cases is too wide.
    """
    figure, panels = style.new_figure(0.5 + 1.4 * len(shares), [1.0] * len(shares))
    look = style.STROKES[Role.LIMIT]
    entries: dict[str, Artist] = {}
    for axes, (text, each) in zip(panels, shares.items(), strict=True):
        drawn = [s for s in each if s.cases >= min(first, each[-1].cases // 2)]
        count = [share.cases for share in drawn]
        (entries["estimate"],) = axes.plot(
            count, [100.0 * s.value for s in drawn], color=style.BLUE
        )
        entries["interval"] = axes.fill_between(
            count,
            [100.0 * s.low for s in drawn],
            [100.0 * s.high for s in drawn],
            color=style.SHADE,
        )
        if (probability := wanted[text]) is not None:
            entries["required"] = axes.axhline(
                100.0 * probability,
                color=look.color,
                linestyle=look.linestyle,
                linewidth=look.linewidth,
            )
        bottom = 100.0 * _lowest(drawn, probability)
        margin = 0.05 * (100.0 - bottom)
        axes.set_ylim(bottom - margin, 100.0 + margin)
        style.few_ticks(axes, 4)
        write_out(axes.yaxis)
        axes.set_ylabel("probability [%]")
        axes.set_title(style.plain(text), fontsize=style.TEXT_SIZE, loc="left")
        if count[-1] > count[0]:
            axes.set_xlim(count[0], count[-1])
    last = panels[-1]
    low, high = last.get_xlim()
    if high > _LONG * low > 0.0:
        last.set_xscale("log")
        style.log_ticks(last.xaxis)
    else:
        few_labels(last.xaxis, style.WIDTH - 1.0)
    last.set_xlabel("cases [-]")
    for text, artist in entries.items():
        artist.set_label(text)
    legend_outside(figure, list(entries.values()), columns=3)
    return figure


def _lowest(drawn: Sequence[Share], wanted: float | None) -> float:
    """Return the minimum displayed probability."""
    reached = min(s.low for s in drawn)
    if wanted is not None:
        reached = max(min(reached, wanted), 1.0 - _MARGIN * (1.0 - wanted))
    return max(0.0, min(reached, drawn[-1].low, *(s.value for s in drawn)))
