"""Figure: every case a line over parallel axes, what varies and what comes of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bywire.core.typing import Array
from bywire.report import style
from bywire.report.legend import legend_outside
from bywire.report.study.case_axis import CaseAxis
from bywire.report.study.drawn_cases import DrawnCases

_MANY = 100  # lines from which on they are translucent
_NONE = 1.3  # where cases are that do not have a figure, in lengths of an axis
_BOX = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}


def parallel_coordinates(
    axes_of: Sequence[CaseAxis], cases: DrawnCases, limits: Mapping[str, float]
) -> Figure:
    """Draw cases as lines over all axes, those that miss a requirement in front.

    Parameters
    ----------
    axes_of
        What varies, then key figures; each axis goes from its least to its largest value, and
        above it stands what does not have one.
    cases
        Which are drawn, by whether they meet all requirements.
    limits
        Limits of the key figures that have one, in their unit: a mark on the axis, or at its end
        where no case reaches it.
    """
    axes_of = [each for each in axes_of if np.isfinite(each.values).any()]
    figure, (axes,) = style.new_figure(3.4)
    ends = [(float(np.nanmin(a.shown)), float(np.nanmax(a.shown))) for a in axes_of]
    scaled = np.array(
        [
            (a.shown - low) / (high - low or 1.0)
            for a, (low, high) in zip(axes_of, ends, strict=True)
        ]
    )
    is_lacking = ~np.isfinite(scaled)
    scaled[is_lacking] = _NONE
    places = np.arange(len(axes_of))
    entries: list[Artist] = []
    for rows, color, opacity, text in (
        (cases.met, style.BLUE, 0.25, "meets all requirements"),
        (
            cases.missed,
            style.VERMILLION,
            0.3 if cases.missed.size > _MANY else 0.7,
            "misses a requirement",
        ),
    ):
        if rows.size:
            _draw_lines(axes, scaled[:, rows], color, opacity)
            entries.append(Line2D([], [], color=color, label=text))
    is_inside = False
    for place, (each, (low, high)) in enumerate(zip(axes_of, ends, strict=True)):
        axes.plot([place, place], [0.0, 1.0], color=style.GRAY, linewidth=0.8)
        _write_values(axes, place, each, (low, high))
        if is_lacking[place].any():
            axes.text(
                place, _NONE + 0.02, "none", ha="center", va="bottom", fontsize=7.0, bbox=_BOX
            )
        if each.name not in limits:
            continue
        limit = each.scale(limits[each.name])
        if low <= limit <= high:
            is_inside = True
            axes.plot(
                place + np.array([-0.12, 0.12]),
                2 * [(limit - low) / (high - low or 1.0)],
                color=style.BLACK,
                linewidth=1.8,
                zorder=4.0,
            )
        else:
            is_above = limit > high
            axes.text(
                place,
                1.11 if is_above else -0.11,
                f"limit {limit:.4g} {'↑' if is_above else '↓'}",
                ha="center",
                va="bottom" if is_above else "top",
                fontsize=7.0,
                bbox=_BOX,
            )
    if is_inside:
        entries.append(Line2D([], [], color=style.BLACK, linewidth=1.8, label="limit"))
    labels = [a.entitled("\n") for a in axes_of]
    axes.set_xticks(places, labels, rotation=35, ha="right")
    axes.tick_params(axis="x", length=0.0)
    axes.set_yticks([])
    axes.set_ylim(-0.2, _NONE + 0.1 if is_lacking.any() else 1.2)
    axes.grid(False)
    axes.spines[["left", "bottom"]].set_visible(False)
    legend_outside(figure, entries)
    return figure


def _write_values(axes: Axes, place: int, shown: CaseAxis, ends: tuple[float, float]) -> None:
    """Write the ends of an axis beyond it, and the choices that lie between beside it."""
    low, high = ends
    numbers = {low: f"{low:.3g}", high: f"{high:.3g}"}
    texts = {float(k): name for k, name in enumerate(shown.names)} or numbers
    for value, text in texts.items():
        if value == high:
            axes.text(place, 1.03, text, ha="center", va="bottom", fontsize=7.0, bbox=_BOX)
        if value == low:
            axes.text(place, -0.03, text, ha="center", va="top", fontsize=7.0, bbox=_BOX)
        if low < value < high:
            axes.text(
                place,
                (value - low) / (high - low),
                text,
                ha="center",
                va="center",
                fontsize=7.0,
                bbox=_BOX,
                zorder=4.5,
            )


def _draw_lines(axes: Axes, ordinates: Array, color: str, opacity: float) -> None:
    """Draw a line for each column, all as one artist: an artist each takes three times as long."""
    lines = np.stack(np.broadcast_arrays(np.arange(len(ordinates)), ordinates.T), axis=-1)
    axes.add_collection(
        LineCollection(
            list(lines),
            colors=color,
            alpha=opacity,
            linewidths=0.6,
            capstyle="projecting",
            joinstyle="round",
            zorder=2.0,
        )
    )
