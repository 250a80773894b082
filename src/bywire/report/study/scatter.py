"""Figure: a key figure over the quantities that drive it, each case a point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from bywire.core.typing import Array
from bywire.report import style
from bywire.report.line_role import Role
from bywire.report.study.readable_axis import (
    Scale,
    beyond,
    few_labels,
    limit_text,
    scale_of,
    write_out,
)

_MOST = 4000  # points drawn of those that meet the limit
_MANY = 1000  # points from which on they are small and translucent
_LINES = 300  # of parallel coordinates, about, of either kind


@dataclass(frozen=True)
class Axis:
    """What an axis shows: name, SI unit, and the value of each case, shape (cases,)."""

    name: str
    unit: str
    values: Array

    @property
    def label(self) -> str:
        """What the axis says: names of parameters, which have dots, as they are."""
        return self.name if "." in self.name else self.name.replace("_", " ")

    @property
    def scale(self) -> Scale:
        """How the values are written."""
        return scale_of(self.values, self.unit)

    @property
    def shown(self) -> Array:
        """The values as they are written."""
        return self.scale.factor * self.values


def scatter(
    figure_of: Axis, drivers: Sequence[Axis], limit: float, met: NDArray[np.bool_]
) -> Figure:
    """Draw a key figure over its drivers.

    Parameters
    ----------
    figure_of, drivers
        The key figure, and what it is drawn over.
    limit
        What is required [the figure's unit]; only named where it lies far off.
    met
        Whether each case meets it; the others are crosses.
    """
    figure = Figure(figsize=(style.WIDTH, 2.8), layout="constrained", facecolor="white")
    panels = figure.subplots(1, len(drivers), sharey=True, squeeze=False)[0]
    look = style.STROKES[Role.LIMIT]
    values, scale = figure_of.shown, figure_of.scale
    known = np.isfinite(values)
    good, bad = np.flatnonzero(met & known), np.flatnonzero(~met & known)
    good = good[:: max(1, good.size // _MOST)]
    many, many_bad = good.size + bad.size > _MANY, bad.size > _MANY
    far = beyond(scale.factor * limit, values[known])
    for axes, driver in zip(panels, drivers, strict=True):
        style.dress(axes)
        axes.plot(driver.shown[good], values[good], color=style.BLUE, marker=".",
                  markersize=2.5 if many else 4.0, markeredgewidth=0.0, linestyle="none",
                  alpha=0.5 if many else 0.7, rasterized=True)  # fmt: skip
        axes.plot(driver.shown[bad], values[bad], color=look.color, marker="x",
                  markersize=2.5 if many_bad else 4.5, linestyle="none",
                  markeredgewidth=0.6 if many_bad else 1.0,
                  alpha=0.4 if many_bad else 1.0, rasterized=many_bad)  # fmt: skip
        if not far:
            axes.axhline(scale.factor * limit, color=look.color, linestyle=look.linestyle,
                         linewidth=look.linewidth)  # fmt: skip
        few_labels(axes.xaxis, (style.WIDTH - 1.0) / len(drivers) - 0.2)
        axes.set_xlabel(driver.scale.label(driver.name))
    first = panels[0]
    style.few_ticks(first, 5)
    write_out(first.yaxis)
    first.set_ylabel(scale.label(figure_of.label))
    if far:
        low, high = first.get_ylim()
        room = 0.15 * (high - low)  # for the text, beside the points
        first.set_ylim(low - (far < 0) * room, high + (far > 0) * room)
        first.text(
            0.02, 0.98 if far > 0 else 0.02,
            f"{limit_text(limit, figure_of.unit)} {'↑' if far > 0 else '↓'}",
            transform=first.transAxes, va="top" if far > 0 else "bottom", color=look.color,
            fontsize=style.TEXT_SIZE,
        )  # fmt: skip
    entries = [
        (good.size, Line2D([], [], color=style.BLUE, marker=".", linestyle="none",
                           label="meets the limit")),
        (bad.size, Line2D([], [], color=look.color, marker="x", markersize=4.5, linestyle="none",
                          label="misses the limit")),
        (not far, Line2D([], [], color=look.color, linestyle=":", label="limit")),
    ]  # fmt: skip
    _legend(figure, [handle for is_drawn, handle in entries if is_drawn])
    return figure


def parallel_coordinates(
    axes_of: Sequence[Axis], met: NDArray[np.bool_], limits: Mapping[str, float]
) -> Figure:
    """Draw every case as a line over all axes, those that miss a requirement in front.

    Parameters
    ----------
    axes_of
        What varies, then key figures; each axis goes from its least to its largest value.
    met
        Whether each case meets all requirements.
    limits
        Limits of the key figures that have one, in their unit: a mark on the axis, or at its end
        where no case reaches it.
    """
    axes_of = [each for each in axes_of if np.isfinite(each.values).any()]
    figure, (axes,) = style.new_figure(3.4)
    ends = [(float(np.nanmin(a.shown)), float(np.nanmax(a.shown))) for a in axes_of]
    scaled = np.array([
        (a.shown - low) / (high - low or 1.0) for a, (low, high) in zip(axes_of, ends, strict=True)
    ])  # fmt: skip
    places = np.arange(len(axes_of))
    entries: list[Artist] = []
    for rows, color, opacity, text in (
        (np.flatnonzero(met), style.BLUE, 0.25, "meets all requirements"),
        (np.flatnonzero(~met), style.VERMILLION, 0.3 if np.sum(~met) > _LINES / 3 else 0.7,
         "misses a requirement"),
    ):  # fmt: skip
        if rows.size:
            shown = rows[:: max(1, rows.size // _LINES)]
            _draw_lines(axes, scaled[:, shown], color, opacity)
            entries.append(Line2D([], [], color=color, label=text))
    box = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
    is_inside = False
    for place, (each, (low, high)) in enumerate(zip(axes_of, ends, strict=True)):
        axes.plot([place, place], [0.0, 1.0], color=style.GRAY, linewidth=0.8)
        for end, height, side in ((high, 1.03, "bottom"), (low, -0.03, "top")):
            axes.text(place, height, f"{end:.3g}", ha="center", va=side, fontsize=7.0, bbox=box)
        if each.name not in limits:
            continue
        limit = each.scale.factor * limits[each.name]
        if low <= limit <= high:
            is_inside = True
            axes.plot(place + np.array([-0.12, 0.12]), 2 * [(limit - low) / (high - low or 1.0)],
                      color=style.BLACK, linewidth=1.8, zorder=4.0)  # fmt: skip
        else:
            is_above = limit > high
            axes.text(place, 1.11 if is_above else -0.11,
                      f"limit {limit:.4g} {'↑' if is_above else '↓'}", ha="center",
                      va="bottom" if is_above else "top", fontsize=7.0,
                      bbox=box)  # fmt: skip
    if is_inside:
        entries.append(Line2D([], [], color=style.BLACK, linewidth=1.8, label="limit"))
    labels = [a.scale.label(a.label, "\n") for a in axes_of]
    axes.set_xticks(places, labels, rotation=35, ha="right")
    axes.tick_params(axis="x", length=0.0)
    axes.set_yticks([])
    axes.set_ylim(-0.2, 1.2)
    axes.grid(False)
    axes.spines[["left", "bottom"]].set_visible(False)
    _legend(figure, entries)
    return figure


def _draw_lines(axes: Axes, ordinates: Array, color: str, opacity: float) -> None:
    """Draw a line for each column, all as one artist: an artist each takes three times as long."""
    lines = np.stack(np.broadcast_arrays(np.arange(len(ordinates)), ordinates.T), axis=-1)
    axes.add_collection(LineCollection(
        list(lines), colors=color, alpha=opacity, linewidths=0.6, capstyle="projecting",
        joinstyle="round", zorder=2.0,
    ))  # fmt: skip


def _legend(figure: Figure, entries: Sequence[Artist]) -> None:
    figure.legend(handles=list(entries), loc="outside upper left", ncols=3, frameon=False,
                  fontsize=style.TEXT_SIZE)  # fmt: skip
