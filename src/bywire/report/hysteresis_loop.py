"""Figure: the loop of current over pressure that dry friction opens."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bywire.core.errors import ParameterError
from bywire.report import style
from bywire.report.channel import Channel, FloatArray, channel
from bywire.report.decimation import decimate

if TYPE_CHECKING:
    import xarray as xr

ARROWS_AT = (0.35, 0.75)
"""where along the time of a branch its arrows sit, as shares"""


def hysteresis_loop(
    recordings: Mapping[str, xr.Dataset],
    *,
    pressure: str = "p_mc",
    current: str = "i",
    demand: str = "i_star",
) -> Figure:
    """Draw current over pressure, applying solid and releasing dashed, one color per recording.

    Parameters
    ----------
    recordings
        Recordings of a ramp up and down again, by the label that the legend shows.
    pressure, current
        Variables. A current with dither is best low-passed first: the ripple hides the loop.
    demand
        Variable whose maximum divides applying from releasing; where a recording lacks it, the
        current does.

    Raises
    ------
    ParameterError
        When there is no recording.
    """
    if not recordings:
        raise ParameterError("hysteresis_loop: no recording given: give at least one")
    figure, (axes,) = style.new_figure(4.2)
    for k, (label, recording) in enumerate(recordings.items()):
        color = style.SEQUENCE[k % len(style.SEQUENCE)]
        x, y = channel(recording, pressure), channel(recording, current)
        by = channel(recording, demand) if demand in recording.data_vars else y
        turn = _turn(by.values)
        for branch, dash in ((slice(0, turn + 1), "-"), (slice(turn, None), (0, (4, 2)))):
            _draw_branch(axes, x, y, branch, color, dash)
        axes.plot([], [], color=color, label=style.plain(label))
    handles, _ = axes.get_legend_handles_labels()
    handles += [
        Line2D([], [], color=style.GRAY, linestyle="-", label="applying"),
        Line2D([], [], color=style.GRAY, linestyle="--", label="releasing"),
    ]
    style.legend_above(axes, columns=4, handles=handles)
    axes.set_xlabel(style.channel_label(x))
    axes.set_ylabel(style.channel_label(y))
    return figure


def _turn(values: FloatArray) -> int:
    """Return the middle of the samples at the maximum, so that a plateau is shared fairly."""
    if bool(np.all(np.isnan(values))):
        return 0
    top = np.flatnonzero(values >= np.nanmax(values))
    return int(top[len(top) // 2])


def _draw_branch(
    axes: Axes, x: Channel, y: Channel, branch: slice, color: str, dash: object
) -> None:
    """Draw one branch, thinned over time so that the extremes of both variables stay."""
    time, xs, ys = x.time[branch], x.values[branch], y.values[branch]
    if len(time) < 2:
        return
    kept = np.union1d(decimate(time, xs)[0], decimate(time, ys)[0])
    xs, ys = np.interp(kept, time, xs), np.interp(kept, time, ys)
    axes.plot(xs, ys, color=color, linestyle=dash, linewidth=1.1)
    for share in ARROWS_AT:
        _draw_arrow(axes, xs, ys, share, color)
