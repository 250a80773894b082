"""Figure: the same variables of several recordings on top of each other, one color each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from bywire.core.errors import ParameterError
from bywire.report import style
from bywire.report.channel import channel
from bywire.report.decimation import decimate

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROOM = "  "  # short labels of wide letters need more than the legend's mean width of a letter
_DASHES: tuple[style.Dash, ...] = ("-", (0, (4, 2)), (0, (1.5, 1.5)))


def overlaid_traces(recordings: Mapping[str, xr.Dataset], variables: Mapping[str, str]) -> Figure:
    """Draw variables over time, one panel each, with a line for every recording.

    Parameters
    ----------
    recordings
        Recordings by the label that the legend shows.
    variables
        What to draw, with its name at the ordinate; those that no recording has, or that are zero
        in all, are left out.

    Raises
    ------
    ParameterError
        When nothing is left to draw.
    """
    shown = [name for name in variables if any(_moves(r, name) for r in recordings.values())]
    if not shown:
        raise ParameterError(
            f"overlaid_traces: the {len(recordings)} recordings have none of the variables "
            f"{', '.join(variables)}: name others"
        )
    figure, rows = style.new_figure(0.5 + 1.7 * len(shown), [1.0] * len(shown))
    for axes, name in zip(rows, shown, strict=True):
        unit = _draw(axes, recordings, name)
        axes.set_ylabel(style.axis_label(variables[name], unit, "\n"))
        style.few_ticks(axes, 6)
        axes.margins(x=0.0)
    style.legend_above(rows[0])
    _, scale = style.time_scale(next(iter(recordings.values()))["time"].values)
    rows[-1].set_xlabel(f"time [{scale}]")
    figure.align_ylabels(rows)
    return figure


def _moves(recording: xr.Dataset, name: str) -> bool:
    return name in recording.data_vars and bool(np.any(recording[name].values))


def _draw(axes: Axes, recordings: Mapping[str, xr.Dataset], name: str) -> str:
    """Draw one variable of all recordings that have it; return its SI unit."""
    scale, _ = style.time_scale(next(iter(recordings.values()))["time"].values)
    unit = "1"
    for k, (label, recording) in enumerate(recordings.items()):
        if name not in recording.data_vars:
            continue
        line, turn = channel(recording, name), k // len(style.SEQUENCE)
        axes.plot(
            *decimate(scale * line.time, line.values),
            linewidth=1.1,
            color=style.SEQUENCE[k % len(style.SEQUENCE)],
            linestyle=_DASHES[turn % len(_DASHES)],
            label=style.plain(label) + _ROOM,
        )
        unit = line.symbol
    return unit
