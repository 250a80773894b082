"""Figure: the loop of drive over response that dry friction and play open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.kpis.smoothing import smoothed
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.channel import Channel, channel
from bywire.report.decimation import kept_samples
from bywire.report.wording import duration

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ARROWS_AT = (0.35, 0.75)
"""where along a branch its arrows sit, as shares of its drawn length"""


def hysteresis_loop(
    recordings: Mapping[str, xr.Dataset],
    response: str,
    drive: str,
    demand: str = "",
    average: float = 0.0,
) -> Figure:
    """Draw drive over response, applying solid and releasing dashed, one color per recording.

    Parameters
    ----------
    recordings
        Recordings of a ramp up and down again, by the label that the legend shows.
    response, drive
        Variables, for instance a pressure and a current.
    demand
        Variable whose maximum divides applying from releasing; where a recording lacks it, the
        drive does.
    average
        Averaging time [s] of the loop, usually one dither period; the ripple around it is then
        drawn pale. 0 draws the raw signals.

    Raises
    ------
    ParameterError
        When there is no recording.
    """
    from matplotlib.lines import Line2D

    if not recordings:
        raise ParameterError("hysteresis_loop: no recording given: give at least one")
    figure, (axes,) = style.new_figure(4.2)
    for k, (label, recording) in enumerate(recordings.items()):
        color = style.SEQUENCE[k % len(style.SEQUENCE)]
        x, y = channel(recording, response), channel(recording, drive)
        by = channel(recording, demand) if demand in recording.data_vars else y
        turn = _turn(by.values)
        if average > 0:
            kept = np.union1d(kept_samples(x.time, x.values), kept_samples(x.time, y.values))
            axes.plot(
                x.values[kept],
                y.values[kept],
                color=color,
                linewidth=0.4,
                alpha=style.PALE_OPACITY,
            )
            x, y = (replace(v, values=smoothed(v.time, v.values, average)) for v in (x, y))
        _draw_branch(axes, x, y, slice(0, turn + 1), color, "-")
        _draw_branch(axes, x, y, slice(turn, None), color, (0, (4, 2)))
        axes.plot([], [], color=color, label=style.plain(label))
    handles, _ = axes.get_legend_handles_labels()
    handles += [
        Line2D([], [], color=style.GRAY, linestyle="-", label="applying"),
        Line2D([], [], color=style.GRAY, linestyle="--", label="releasing"),
    ]
    if average > 0:
        label = f"ripple around the average over {duration(average)}"
        opacity = style.PALE_OPACITY
        handles.append(Line2D([], [], color=style.GRAY, linewidth=6.0, alpha=opacity, label=label))
    style.legend_above(axes, handles)
    axes.set_xlabel(style.channel_label(x))
    axes.set_ylabel(style.channel_label(y))
    return figure


def _turn(values: Array) -> int:
    """Return the middle of the samples at the maximum, so that a plateau is shared fairly."""
    if bool(np.all(np.isnan(values))):
        return 0
    top = np.flatnonzero(values >= np.nanmax(values))
    return int(top[len(top) // 2])


def _draw_branch(
    axes: Axes, x: Channel, y: Channel, branch: slice, color: str, dash: style.Dash
) -> None:
    """Draw one branch, thinned over time so that the extremes of both variables stay."""
    time, xs, ys = x.time[branch], x.values[branch], y.values[branch]
    if len(time) < 2:
        return
    kept = np.union1d(kept_samples(time, xs), kept_samples(time, ys))
    axes.plot(xs[kept], ys[kept], color=color, linestyle=dash, linewidth=1.1)
    length = _length_along(xs[kept], ys[kept])
    for share in ARROWS_AT:
        ends = [share - 0.01, share + 0.01]
        (tail_x, tip_x), (tail_y, tip_y) = (np.interp(ends, length, v[kept]) for v in (xs, ys))
        if np.isfinite([tail_x, tail_y, tip_x, tip_y]).all():
            axes.annotate(
                "",
                xy=(tip_x, tip_y),
                xytext=(tail_x, tail_y),
                arrowprops={
                    "arrowstyle": "-|>",
                    "color": color,
                    "linewidth": 0.0,
                    "mutation_scale": 15.0,
                    "shrinkA": 0.0,
                    "shrinkB": 0.0,
                },
            )


def _length_along(x: Array, y: Array) -> Array:
    """Return the share of the drawn length up to every point, 0 to 1."""
    steps = np.hypot(*(np.diff(v) / (float(np.ptp(v)) or 1.0) for v in (x, y)))
    length = np.concatenate([[0.0], np.cumsum(np.nan_to_num(steps))])
    return length / (length[-1] or 1.0)
