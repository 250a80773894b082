"""Figure: root locus, the poles of a loop or a plant against a parameter."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from bywire.analysis.linear.linear_model import STILL
from bywire.analysis.locus import Border, Locus
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.legend import legend_outside
from bywire.report.pole_map import slow_radius
from bywire.report.s_plane import draw_plane, planes, shown_radius
from bywire.report.wording import amount, in_display_unit

_COLORS = "viridis"
_ROOM = 1.3  # around what must be seen


def root_locus(locus: Locus, bandwidth: float) -> Figure:
    """Draw the poles' ways in two planes: all that the sampling can tell, and the slow ones.

    Parameters
    ----------
    locus
        The poles.
    bandwidth
        Largest bandwidth of the loop over the range [Hz]; NaN where there is none: the poles that
        turn unstable then choose the second plane.
    """
    rates = locus.rates
    sizes = [float(s) for s in np.abs(rates[np.isfinite(rates)]) if s > STILL]
    whole = shown_radius(sizes, locus.period)
    slow = min(max([slow_radius(sizes, bandwidth, whole), *_borders(locus)]), whole)
    crossing = _crossing(locus)
    if not math.isfinite(bandwidth) and crossing > 0.0:
        slow = min(crossing, whole)
    figure, panels = planes(("poles", "the slow ones"), 4.6)
    values, _ = in_display_unit(np.asarray(locus.values), locus.unit)
    norm = Normalize(values[0], values[-1])
    for axes, radius in zip(panels, (whole, slow), strict=True):
        inside = rates[np.isfinite(rates) & (np.abs(rates) <= radius)]
        draw_plane(axes, radius, locus.period, float(np.max(inside.real, initial=0.0)))
        _ways(axes, locus, norm, values)
    bar = figure.colorbar(
        ScalarMappable(norm, _COLORS), ax=panels, aspect=40, pad=0.02, format="%g"
    )
    bar.ax.tick_params(labelsize=style.TEXT_SIZE)
    bar.set_label(style.axis_label(locus.name, locus.unit), fontsize=style.TEXT_SIZE)
    handles, _ = panels[0].get_legend_handles_labels()
    legend_outside(figure, handles, columns=1)
    return figure


def _borders(locus: Locus) -> list[float]:
    return [_ROOM * abs(border.rate) for border in locus.borders]


def _crossing(locus: Locus) -> float:
    """Return the radius that shows the whole ways of the poles that turn unstable; 0 for none."""
    rates = np.where(np.isfinite(locus.rates), locus.rates, 0.0)
    turning = (rates.real > STILL).any(axis=0) & (rates.real < -STILL).any(axis=0)
    return _ROOM * float(np.max(np.abs(rates[:, turning]), initial=0.0))


def border_text(border: Border, name: str, unit: str) -> str:
    """Return where a loop turns unstable, and how."""
    side = "below" if border.above else "above"
    swing = border.rate.imag / (2.0 * np.pi)
    how = f"swings at {swing:.3g} Hz" if swing > 1e-3 else "drifts away"
    return f"unstable {side} {name} = {amount(border.value, unit)}: it {how}"


def _ways(axes: Axes, locus: Locus, norm: Normalize, values: Array) -> None:
    rates = locus.rates
    for column in rates.T:
        moves = np.isfinite(column) & (np.abs(column) > STILL)
        upper = moves & (column.imag >= -STILL)
        if not upper.any():
            continue
        line = np.where(upper, column, np.nan)
        axes.plot(line.real, line.imag, color=style.GRAY, linewidth=0.6, zorder=2.0)
        axes.scatter(
            line.real,
            line.imag,
            c=values,
            cmap=_COLORS,
            norm=norm,
            s=7,
            zorder=3,
            linewidths=0.0,
        )
    for k, marker, text in ((0, "x", "first"), (-1, "o", "last")):
        ends = rates[k]
        shown = ends[np.isfinite(ends) & (np.abs(ends) > STILL) & (ends.imag >= -STILL)]
        axes.plot(
            shown.real,
            shown.imag,
            marker,
            color=style.BLACK,
            markersize=5,
            zorder=4,
            markerfacecolor="none",
            linestyle="none",
            label=style.plain(f"{text}: {locus.name} = {amount(locus.values[k], locus.unit)}"),
        )
    for border in locus.borders:
        axes.plot(
            border.rate.real,
            border.rate.imag,
            "*",
            color=style.VERMILLION,
            markersize=11,
            markeredgecolor="white",
            zorder=5,
            linestyle="none",
            label=style.plain(border_text(border, locus.name, locus.unit)),
        )
