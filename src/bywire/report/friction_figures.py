"""Figures: friction loop of response versus drive, and friction versus speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bywire.bench.kpis.samples import smoothed
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.channel import Channel, axis_unit, channel, kept_samples
from bywire.report.wording import amount

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ARROWS_AT = (0.35, 0.75)
"""positions of the arrows along a branch, as fractions of its drawn length"""


def hysteresis_loop(
    recordings: Mapping[str, xr.Dataset],
    response: str,
    drive: str,
    demand: str = "",
    average: float = 0.0,
) -> Figure:
    """Draw response versus drive, applying solid and releasing dashed, one color per recording.

    Parameters
    ----------
    recordings
        Recordings of a ramp up and back down, by their label in the legend.
    response, drive
        Variables, for example a pressure and a current.
    demand
        Variable whose maximum separates applying from releasing. Default, also for a recording
        without this variable: the drive.
    average
        Averaging time [s] of the loop, usually one dither period. The ripple around it is then
        pale. 0 draws the raw signals.

    Raises
    ------
    ParameterError
        Without a recording.
    """
    from matplotlib.lines import Line2D

    if not recordings:
        raise ParameterError("hysteresis_loop: no recording was passed. Pass at least one")
    figure, (axes,) = style.new_figure(4.2)
    units = {name: axis_unit(recordings.values(), name) for name in (drive, response)}
    for k, (label, recording) in enumerate(recordings.items()):
        color = style.SEQUENCE[k % len(style.SEQUENCE)]
        x, y = (channel(recording, name, unit) for name, unit in units.items())
        by = channel(recording, demand) if demand in recording.data_vars else x
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
        label = f"ripple around the average over {amount(average, 's', 3)}"
        opacity = style.PALE_OPACITY
        handles.append(Line2D([], [], color=style.GRAY, linewidth=6.0, alpha=opacity, label=label))
    style.legend_above(axes, handles)
    axes.set_xlabel(style.channel_label(x))
    axes.set_ylabel(style.channel_label(y))
    return figure


def _turn(values: Array) -> int:
    """Return the middle of the samples at the maximum, so that a plateau is split evenly."""
    if bool(np.all(np.isnan(values))):
        return 0
    top = np.flatnonzero(values >= np.nanmax(values))
    return int(top[len(top) // 2])


def _draw_branch(
    axes: Axes, x: Channel, y: Channel, branch: slice, color: str, dash: style.Dash
) -> None:
    """Draw one branch, thinned over time, with the extremes of both variables kept."""
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
    """Return the fraction of the drawn length at every point, 0 to 1."""
    steps = np.hypot(*(np.diff(v) / (float(np.ptp(v)) or 1.0) for v in (x, y)))
    length = np.concatenate([[0.0], np.cumsum(np.nan_to_num(steps))])
    return length / (length[-1] or 1.0)


# --- Dry friction versus speed at several load levels


def stribeck_curve(
    curve: xr.Dataset,
    *,
    friction: str = "",
    measured: Mapping[float, tuple[Array, Array]] | None = None,
) -> Figure:
    """Draw dry friction versus speed, with one line per level.

    At rest, friction is set-valued, so the line between its two breakaway values is vertical.

    Parameters
    ----------
    curve
        Dataset with the friction over two dimensions: the load, for example a pressure, and
        ascending speed, which contains 0 twice, once for each end of the interval at rest. All have
        units.
    friction
        Name of the friction variable; empty for the dataset's first variable.
    measured
        Measured speeds and frictions, SI, by level; drawn as points.

    Raises
    ------
    UnknownNameError
        When the dataset has no such variable.
    ParameterError
        When it does not depend on a load and a speed.
    """
    friction = friction or next(map(str, curve.data_vars), "")
    if friction not in curve.data_vars:
        raise unknown_name("variable", friction, map(str, curve.data_vars))
    array = curve[friction]
    if array.ndim != 2 or array.size == 0:
        raise ParameterError(
            f"{friction} has the shape {array.shape}. A Stribeck curve needs a level and a speed",
            name=friction,
            value=str(array.shape),
        )
    level, speed = (array[name] for name in array.dims)
    unit = str(level.attrs.get("units", "1"))
    figure, (axes,) = style.new_figure(3.8)
    for k, p in enumerate(level.values.astype(float)):
        color = style.SEQUENCE[k % len(style.SEQUENCE)]
        values = np.asarray(array.values[k], dtype=float)
        # Short intervals at rest are drawn above long ones, so that all are visible.
        above = 2.0 + 0.9 / (1.0 + float(np.ptp(values)))
        label = amount(p, unit)
        axes.plot(speed.values, values, color=color, linewidth=1.4, zorder=above, label=label)
        if measured is not None and p in measured:
            axes.plot(
                *measured[p],
                "o",
                color=color,
                markersize=3.5,
                markerfacecolor="white",
                zorder=4,
                label=f"{label}, measured",
            )
    axes.axhline(0.0, color=style.GRAY, linewidth=0.6, zorder=1)
    axes.margins(x=0.01)
    axes.set_xlabel(_title(speed, "speed"))
    axes.set_ylabel(_title(array, friction))
    style.legend_above(axes)
    return figure


def _title(shown: xr.DataArray, name: str) -> str:
    unit = str(shown.attrs.get("units", "1"))
    return style.axis_label(str(shown.attrs.get("long_name", name)), unit)
