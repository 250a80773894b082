"""The lines of overlaid panels: a color each recording, what a line is by its dashes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.core.units import convert
from bywire.report import style
from bywire.report.channel import Channel, channel
from bywire.report.decimation import decimate
from bywire.report.line_role import Role
from bywire.report.panels import Panel
from bywire.report.ripple import inside
from bywire.report.time_traces import NEAR, limit_of
from bywire.report.value_scale import Color

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

DOTS: style.Dash = (0, (1.2, 1.2))
"""of the second line of a panel"""
_APART = 0.03  # of what lines reach over: closer, a set point of a line's color lies below it
_BRIEF = 0.01  # of the time axis: what shows no longer is not seen


@dataclass(frozen=True)
class Look:
    """What tells a recording from others: its label, color and dashes."""

    label: str
    color: str | Color
    dash: style.Dash


def draw_line(axes: Axes, shown: Channel, look: Look, factor: float, *, second: bool) -> float:
    """Draw a line, of a ripple that fills an area its average; return its averaging time [s]."""
    average = inside(shown)
    shown, width = (shown, 0.0) if average is None else average
    axes.plot(
        *decimate(factor * shown.time, shown.values),
        color=look.color,
        linestyle=DOTS if second else look.dash,
        linewidth=0.9 if second else 1.2,
        zorder=2.8 if second else 3.0,
        label="_",
    )
    return width


def draw_target(
    axes: Axes,
    name: str,
    lines: Sequence[str],
    recordings: Sequence[xr.Dataset],
    looks: Sequence[Look],
    factor: float,
) -> list[Line2D]:
    """Draw a set point: once, in black, where it is the same in all recordings.

    Where each has its own, in its color, they are left out that lie below the lines of their
    recordings. ``lines``: names of those, the first one followed.
    """
    stroke = style.STROKES[Role.SET_POINT]
    shown = [channel(recording, name) for recording in recordings]
    same = all(
        np.array_equal(each.time, shown[0].time) and np.array_equal(each.values, shown[0].values)
        for each in shown[1:]
    )
    followed = [channel(recording, lines[0]) for recording in recordings]
    if not (same or _are_seen(shown, followed)):
        return []
    colors = [stroke.color] if same else [look.color for look in looks]
    for each, color in zip(shown, colors, strict=False):
        average = inside(each)
        each = each if average is None else average[0]
        axes.plot(
            *decimate(factor * each.time, each.values),
            color=color,
            linestyle=stroke.linestyle,
            linewidth=0.9,
            zorder=3.2 if same else 2.9,
            label="_",
        )
    return [entry(shown[0].label, stroke.color if same else style.GRAY, stroke.linestyle)]


def _are_seen(targets: Sequence[Channel], followed: Sequence[Channel]) -> bool:
    """Return whether a set point of any recording shows beside the line that follows it."""
    ends = [each for line in followed for each in (np.nanmin(line.values), np.nanmax(line.values))]
    close = _APART * (max(ends) - min(ends))
    brief = _BRIEF * max(float(line.time[-1] - line.time[0]) for line in followed)
    return any(
        float(np.sum(np.diff(line.time)[np.abs(target.values - line.values)[1:] > close])) > brief
        for target, line in zip(targets, followed, strict=True)
    )


def draw_limits_of(
    axes: Axes,
    panel: Panel,
    recordings: Sequence[xr.Dataset],
    looks: Sequence[Look],
    first: Channel,
) -> list[Line2D]:
    """Draw the limits of a panel's first trace where it comes near; each once."""
    stroke = style.STROKES[Role.LIMIT]
    levels = [limit_of(recording, panel) for recording in recordings]
    is_one = len(set(levels)) == 1
    drawn = set()
    for recording, look, level in zip(recordings, looks, levels, strict=True):
        if level is None:
            continue
        values = channel(recording, first.name).values
        level = convert(level, first.symbol, first.unit)
        for side in (1.0, -1.0):
            at = side * level
            if float(np.nanmax(side * values)) < NEAR * level or at in drawn:
                continue
            drawn.add(at)
            axes.axhline(
                at,
                color=stroke.color if is_one else look.color,
                linestyle=stroke.linestyle,
                linewidth=stroke.linewidth,
                zorder=stroke.zorder,
                label="_",
            )
    color = stroke.color if is_one else style.GRAY
    return [entry("limit", color, stroke.linestyle)] if drawn else []


def entry(label: str, color: str | Color, dash: Any) -> Line2D:
    """Return an entry of a legend."""
    from matplotlib.lines import Line2D

    text = style.plain(label, 110)
    return Line2D([], [], color=color, linestyle=dash, linewidth=1.4, label=text)
