"""Bars along the edges of panels over time: saturation above, faults below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bywire.report import style
from bywire.report.channel import channel
from bywire.report.decimation import phases

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from bywire.report.panels import Panel
    from bywire.report.value_scale import Color

FAULTS = "faults"
"""variable that counts the faults that are there: a bar along the lower edge shows them"""
_HEIGHT = 0.04  # of a bar, in heights of a panel


def mark_saturation(axes: Axes, panel: Panel, recording: xr.Dataset) -> None:
    """Draw a bar along the upper edge while a panel's quantity is saturated."""
    spans = _scaled(recording, panel.saturation) if panel.saturation is not None else []
    if spans:
        axes.broken_barh(
            spans,
            (1.0 - _HEIGHT, _HEIGHT),
            transform=axes.get_xaxis_transform(),
            facecolor=style.VERMILLION,
            edgecolor=style.VERMILLION,
            linewidth=0.8,
            zorder=2.0,
            label=panel.saturated,
        )


def mark_faults(axes: Axes, recording: xr.Dataset, *, named: bool) -> None:
    """Draw a bar along the lower edge while a fault is there; ``named``: with a label."""
    if spans := _scaled(recording, FAULTS):
        _draw_fault(axes, spans, 0.0, style.PURPLE, "fault" if named else None)


def mark_faults_of(
    axes: Axes, recordings: Sequence[xr.Dataset], colors: Sequence[str | Color], factor: float
) -> list[Artist]:
    """Draw the same of several recordings: once where their faults are there at the same times.

    Parameters
    ----------
    axes
        Panel over time.
    recordings, colors
        The recordings, and the color of each, in which its own bar is drawn where they differ.
    factor
        Of the time axis.

    Returns
    -------
    list
        The entry of a legend; none without a fault.
    """
    from matplotlib.patches import Patch

    each = [
        [(factor * start, factor * length) for start, length in _spans(recording, FAULTS)]
        for recording in recordings
    ]
    if not any(each):
        return []
    if all(spans == each[0] for spans in each):
        _draw_fault(axes, each[0], 0.0, style.PURPLE, None)
        return [Patch(color=style.PURPLE, label="fault")]
    drawn = [(spans, color) for spans, color in zip(each, colors, strict=True) if spans]
    for k, (spans, color) in enumerate(drawn):
        _draw_fault(axes, spans, k * _HEIGHT, color, None)
    return [Patch(color=style.GRAY, label="fault")]


def _draw_fault(
    axes: Axes, spans: list[tuple[float, float]], low: float, color: str | Color, label: str | None
) -> None:
    axes.broken_barh(
        spans,
        (low, _HEIGHT),
        transform=axes.get_xaxis_transform(),
        facecolor=color,
        edgecolor=color,
        linewidth=0.8,
        zorder=2.0,
        label=label,
    )


def _scaled(recording: xr.Dataset, variable: str) -> list[tuple[float, float]]:
    """Return the spans in which a mode variable is 1, on the time axis of its recording."""
    if variable not in recording.data_vars:
        return []
    scale, _ = style.time_scale(channel(recording, variable).time)
    return [(scale * start, scale * length) for start, length in _spans(recording, variable)]


def _spans(recording: xr.Dataset, variable: str) -> list[tuple[float, float]]:
    """Return starts and lengths [s] of the spans in which a mode variable is 1."""
    if variable not in recording.data_vars:
        return []
    mode = channel(recording, variable)
    return [(start, end - start) for start, end in phases(mode.time, mode.values > 0.5)]
