"""Figures of single cases: points versus drivers, or lines across parallel axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from bywire.core.typing import Array
from bywire.report import style
from bywire.report.channel import size_of
from bywire.report.panels import Role
from bywire.report.readable_axis import (
    CHARACTER,
    Scale,
    beyond,
    few_labels,
    limit_text,
    scale_of,
    write_out,
)
from bywire.report.study.drawn_cases import DrawnCases
from bywire.report.style import legend_outside

_JITTER = 0.3  # spread of the points of a choice, relative to the distance between choices
_GOLDEN = 0.5 * (5.0**0.5 - 1.0)  # its multiples are spread evenly, for any number of them
_LONGEST = 24  # characters of a choice that fit


@dataclass(frozen=True)
class CaseAxis:
    """An axis over the cases.

    Parameters
    ----------
    name, unit
        Label, and SI unit, or ``"%"``.
    values
        Value of each drawn case, shape (cases,), NaN if a case has no value. For choices, the index
        of each case's choice.
    choices
        Names of the choices, in order; empty for numbers.
    ends
        Least and largest value of all cases. Default: of the drawn cases.
    rows
        Row of each drawn case among all cases. Default: all cases are drawn.
    """

    name: str
    unit: str
    values: Array
    choices: tuple[str, ...] = ()
    ends: tuple[float, float] | None = None
    rows: NDArray[np.intp] | None = None

    @property
    def extremes(self) -> Array:
        """Least and largest value of all cases; empty if there are none."""
        if self.ends is not None:
            return np.array(self.ends)
        known = self.values[np.isfinite(self.values)]
        return np.array([known.min(), known.max()]) if known.size else np.empty(0)

    @property
    def label(self) -> str:
        """Label of the axis; names of parameters, which have dots, unchanged."""
        return self.name if "." in self.name else self.name.replace("_", " ")

    @property
    def scale(self) -> Scale:
        """Scale of the values."""
        return Scale(1.0, "") if self.choices else scale_of(self.extremes, self.unit)

    @property
    def shown(self) -> Array:
        """Values in that scale."""
        return self.scale(self.values)

    @property
    def apart(self) -> Array:
        """Values of the points; those of a choice are spread, always in the same way."""
        if not self.choices:
            return self.shown
        rows = np.arange(self.values.size) if self.rows is None else self.rows
        places = rows * _GOLDEN % 1.0
        return self.values + _JITTER * (2.0 * places - 1.0)

    @property
    def names(self) -> list[str]:
        """Texts of the choices at an axis."""
        return [style.plain(each, _LONGEST) for each in self.choices]

    def entitled(self, gap: str = " ") -> str:
        """Return the label of the axis; ``gap`` separates name and unit."""
        return style.plain(self.label, 40) if self.choices else self.scale.label(self.label, gap)

    def write_at(self, axis: Axis, room: float) -> None:
        """Label an abscissa, about ``room`` long [inch], once its data are drawn."""
        if not self.choices:
            few_labels(axis, room)
            return
        axis.axes.set_xlim(-0.6, len(self.choices) - 0.4)
        is_long = max(map(len, self.names)) + 2 > room / (len(self.choices) * CHARACTER)
        axis.set_ticks(range(len(self.choices)), self.names)
        if is_long:
            for label in axis.get_ticklabels():
                label.set(rotation=30, ha="right", rotation_mode="anchor")


def choice_axis(
    name: str,
    values: Sequence[str],
    choices: Sequence[str],
    rows: NDArray[np.intp] | None = None,
) -> CaseAxis:
    """Return the axis of a structural choice.

    Parameters
    ----------
    name
        Name of the choice.
    values
        The choice of each case.
    choices
        All choices, in order.
    rows
        See `CaseAxis`.
    """
    places = {choice: k for k, choice in enumerate(choices)}
    values_at = np.array([places[each] for each in values], float)
    return CaseAxis(name, "", values_at, tuple(choices), rows=rows)


# --- A key figure versus the quantities that drive it

_EDGE = 1.03  # position of cases without the figure, in heights of a panel
_MANY_POINTS = 1000  # number of points from which they are small and translucent


def scatter(
    figure_of: CaseAxis, drivers: Sequence[CaseAxis], limit: float, cases: DrawnCases
) -> Figure:
    """Draw a key figure versus its drivers.

    Parameters
    ----------
    figure_of, drivers
        The key figure, and the quantities on the abscissas.
    limit
        Limit [the figure's unit]; only written if it is far away.
    cases
        Drawn cases. Cases that miss the limit are crosses. Cases without the figure also miss the
        limit; they are triangles at the upper edge.
    """
    figure = Figure(figsize=(style.WIDTH, 2.8), layout="constrained", facecolor="white")
    panels = figure.subplots(1, len(drivers), sharey=True, squeeze=False)[0]
    look = style.STROKES[Role.LIMIT]
    values, scale = figure_of.shown, figure_of.scale
    good, bad = cases.met, cases.missed
    many, many_bad = good.size + bad.size > _MANY_POINTS, bad.size > _MANY_POINTS
    far = beyond(scale(limit), scale(figure_of.extremes))
    for axes, driver in zip(panels, drivers, strict=True):
        style.dress(axes)
        axes.plot(
            driver.apart[good],
            values[good],
            color=style.BLUE,
            marker=".",
            markersize=2.5 if many else 4.0,
            markeredgewidth=0.0,
            linestyle="none",
            alpha=0.5 if many else 0.7,
            rasterized=True,
        )
        axes.plot(
            driver.apart[bad],
            values[bad],
            color=look.color,
            marker="x",
            markersize=2.5 if many_bad else 4.5,
            linestyle="none",
            markeredgewidth=0.6 if many_bad else 1.0,
            alpha=0.4 if many_bad else 1.0,
            rasterized=many_bad,
        )
        if cases.lacking.size:
            axes.plot(
                driver.apart[cases.lacking],
                np.full(cases.lacking.size, _EDGE),
                "v",
                color=look.color,
                markersize=3.5,
                markeredgewidth=0.0,
                clip_on=False,
                alpha=0.6,
                transform=axes.get_xaxis_transform(),
                rasterized=cases.lacking.size > _MANY_POINTS,
            )
        if not far:
            axes.axhline(
                scale(limit), color=look.color, linestyle=look.linestyle, linewidth=look.linewidth
            )
        driver.write_at(axes.xaxis, (style.WIDTH - 1.0) / len(drivers) - 0.2)
        axes.set_xlabel(driver.entitled())
    first = panels[0]
    style.few_ticks(first, 5)
    write_out(first.yaxis)
    first.set_ylabel(figure_of.entitled())
    if far:
        low, high = first.get_ylim()
        room = 0.15 * (high - low)  # space for the text, beside the points
        text = limit_text(limit, figure_of.unit, size_of(figure_of.extremes))
        first.set_ylim(low - (far < 0) * room, high + (far > 0) * room)
        first.text(
            0.02,
            0.98 if far > 0 else 0.02,
            f"{text} {'↑' if far > 0 else '↓'}",
            transform=first.transAxes,
            va="top" if far > 0 else "bottom",
            color=look.color,
            fontsize=style.TEXT_SIZE,
        )
    entries = [
        (
            good.size,
            Line2D([], [], color=style.BLUE, marker=".", linestyle="none", label="meets the limit"),
        ),
        (
            bad.size,
            Line2D(
                [],
                [],
                color=look.color,
                marker="x",
                markersize=4.5,
                linestyle="none",
                label="misses the limit",
            ),
        ),
        (
            cases.lacking.size,
            Line2D(
                [],
                [],
                color=look.color,
                marker="v",
                markersize=3.5,
                linestyle="none",
                label="no figure, so missed",
            ),
        ),
        (not far, Line2D([], [], color=look.color, linestyle=":", label="limit")),
    ]
    legend_outside(figure, [handle for is_drawn, handle in entries if is_drawn])
    return figure


# --- Parallel axes: varied quantities and their effect

_MANY_LINES = 100  # number of lines from which they are translucent
_NONE = 1.3  # position of cases without a figure, in lengths of an axis
_BOX = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}


def parallel_coordinates(
    axes_of: Sequence[CaseAxis], cases: DrawnCases, limits: Mapping[str, float]
) -> Figure:
    """Draw cases as lines across all axes, with cases that miss a requirement in front.

    Parameters
    ----------
    axes_of
        Varied quantities, then key figures; each axis goes from its minimum to its maximum, with
        undefined values above it.
    cases
        Drawn cases, by whether they meet all requirements.
    limits
        Limits of key figures, in their unit: a mark on the axis, or at its end if no case reaches
        the limit.
    """
    axes_of = [each for each in axes_of if each.extremes.size]
    figure, (axes,) = style.new_figure(3.4)
    ends = [(float(low), float(high)) for a in axes_of for low, high in [a.scale(a.extremes)]]
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
            0.3 if cases.missed.size > _MANY_LINES else 0.7,
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
    """Write the end values of an axis beyond it, and other choices next to it."""
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
    """Draw a line for each column as a single artist: separate ones take three times as long."""
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
