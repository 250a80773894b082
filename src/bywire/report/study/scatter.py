"""Figure: a key figure over the quantities that drive it, each case a point."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bywire.report import style
from bywire.report.legend import legend_outside
from bywire.report.line_role import Role
from bywire.report.readable_axis import beyond, limit_text, size_of, write_out
from bywire.report.study.case_axis import CaseAxis
from bywire.report.study.drawn_cases import DrawnCases

_EDGE = 1.03  # where cases without the figure stand, in heights of a panel
_MANY = 1000  # points from which on they are small and translucent


def scatter(
    figure_of: CaseAxis, drivers: Sequence[CaseAxis], limit: float, cases: DrawnCases
) -> Figure:
    """Draw a key figure over its drivers.

    Parameters
    ----------
    figure_of, drivers
        The key figure, and what it is drawn over.
    limit
        What is required [the figure's unit]; only named where it lies far off.
    cases
        Which are drawn; those that miss it are crosses, and those without the figure, which miss it
        too, triangles at the upper edge.
    """
    figure = Figure(figsize=(style.WIDTH, 2.8), layout="constrained", facecolor="white")
    panels = figure.subplots(1, len(drivers), sharey=True, squeeze=False)[0]
    look = style.STROKES[Role.LIMIT]
    values, scale = figure_of.shown, figure_of.scale
    good, bad = cases.met, cases.missed
    many, many_bad = good.size + bad.size > _MANY, bad.size > _MANY
    far = beyond(scale(limit), values[np.isfinite(values)])
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
        room = 0.15 * (high - low)  # for the text, beside the points
        text = limit_text(limit, figure_of.unit, size_of(figure_of.values))
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
                label="has no figure: misses it",
            ),
        ),
        (not far, Line2D([], [], color=look.color, linestyle=":", label="limit")),
    ]
    legend_outside(figure, [handle for is_drawn, handle in entries if is_drawn])
    return figure
