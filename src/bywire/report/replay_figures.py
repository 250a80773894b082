"""Figures of a replay: measured and modeled signals, and drifting parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bywire.core.units import display_factor
from bywire.identification.replay_fit import SegmentFit
from bywire.identification.tracking import Track
from bywire.report import style
from bywire.report.channel import channel
from bywire.report.decimation import decimate
from bywire.report.panels import Role
from bywire.report.wording import in_display_unit

_NAMED = 8  # segments up to which there is room for their names


def replay_figure(
    name: str, pair: xr.Dataset, inputs: xr.Dataset, fits: Sequence[SegmentFit]
) -> Figure:
    """Draw demand, measured (solid blue) and simulated (dashed red), and simulated less measured.

    Segments are bounded by thin lines; one that misses a tolerance is shaded.

    Parameters
    ----------
    name
        The signal.
    pair
        ``measured`` and ``modeled`` over ``time`` [s].
    inputs
        What drove the model.
    fits
        Its segments.
    """
    figure, (top, middle, bottom) = style.new_figure(5.6, (0.8, 2.2, 1.0))
    scale, unit = style.time_scale(pair["time"].values)
    for k, stimulus in enumerate(map(str, inputs.data_vars)):
        shown = channel(inputs, stimulus)
        color = style.SEQUENCE[k % len(style.SEQUENCE)] if len(inputs.data_vars) > 1 else None
        look = style.STROKES[Role.SET_POINT]
        top.plot(
            *decimate(scale * shown.time, shown.values),
            color=color or look.color,
            linewidth=look.linewidth,
            label=style.plain(shown.label),
        )
        top.set_ylabel(style.axis_label("demand", shown.symbol, "\n"))
    symbol = str(pair["measured"].attrs.get("units", "1"))
    for values, role, word in (
        (pair["measured"].values, Role.MEASURED, "measured"),
        (pair["modeled"].values, Role.SIMULATED, "simulated"),
    ):
        look = style.STROKES[role]
        middle.plot(
            *decimate(scale * pair["time"].values, in_display_unit(values, symbol)[0]),
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            zorder=look.zorder,
            label=word,
        )
    error = display_factor(symbol) * (pair["modeled"].values - pair["measured"].values)
    bottom.plot(*decimate(scale * pair["time"].values, error), color=style.PURPLE, linewidth=0.9)
    bottom.axhline(0.0, color=style.GRAY, linewidth=0.6)
    label = str(pair["measured"].attrs.get("long_name", name))
    middle.set_ylabel(style.axis_label(label, symbol))
    bottom.set_ylabel(style.axis_label("difference", symbol, "\n"))
    bottom.set_xlabel(f"time [{unit}]")
    _segments((middle, bottom), fits, scale)
    for axes in (top, middle, bottom):
        axes.margins(x=0.0)
    for axes in (top, bottom):
        style.few_ticks(axes, 4)
    style.legend_above(top)
    style.legend_above(middle)
    figure.align_ylabels([top, middle, bottom])
    return figure


def _segments(panels: Sequence[Axes], fits: Sequence[SegmentFit], scale: float) -> None:
    if len(fits) < 2 and all(v.met for fit in fits for v in fit.verdicts):
        return
    label: str | None = "tolerance missed"
    for fit in fits:
        missed = any(not v.met for v in fit.verdicts)
        for axes in panels:
            axes.axvline(scale * fit.segment.start, color=style.GRAY, linewidth=0.5, zorder=1.0)
            if missed:
                axes.axvspan(
                    scale * fit.segment.start,
                    scale * fit.segment.stop,
                    color=style.ORANGE,
                    alpha=0.15,
                    linewidth=0.0,
                    zorder=0.5,
                    label=label,
                )
                label = None
        if len(fits) <= _NAMED:
            middle = scale * float(np.mean([fit.segment.start, fit.segment.stop]))
            panels[0].annotate(
                style.plain(fit.segment.name, 16),
                (middle, 1.0),
                xycoords=("data", "axes fraction"),
                ha="center",
                va="top",
                color=style.GRAY,
                fontsize=style.TEXT_SIZE - 1.5,
            )


# --- A drifting parameter, tracked, with its confidence band


def track_figure(track: Track, known: float | None = None) -> Figure:
    """Draw the tracked parameter over time with its 95 % band.

    Parameters
    ----------
    track
        What was tracked; its first parameter is drawn.
    known
        Value of the parameter set, drawn as a dashed line.
    """
    figure, (axes,) = style.new_figure(3.6)
    data, name = track.data.isel(parameter=0), track.relation.parameter
    symbol = track.relation.units[0]
    scale, unit = style.time_scale(data["time"].values)
    t, used = scale * data["time"].values, data["used"].values > 0
    begun = np.cumsum(used) > 0
    low, high, value = (
        in_display_unit(data[n].values, symbol)[0] for n in ("low", "high", "value")
    )
    axes.fill_between(
        t[begun],
        low[begun],
        high[begun],
        color=style.SKY,
        alpha=0.45,
        linewidth=0.0,
        label="95 % band",
    )
    axes.plot(t[begun], value[begun], color=style.BLUE, linewidth=1.2, label="tracked")
    axes.plot(
        t[used],
        value[used],
        "o",
        color=style.BLUE,
        markersize=2.5,
        label="where the relation holds",
    )
    if known is not None:
        known = in_display_unit(known, symbol)[0]
        look = style.STROKES[Role.SET_POINT]
        axes.axhline(
            known,
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            label="parameter set",
        )
    if begun.any():
        center = np.concatenate((value[used], [] if known is None else [known]))
        reach = float(np.median((high - low)[used]))
        axes.set_ylim(float(center.min()) - 2.0 * reach, float(center.max()) + 2.0 * reach)
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.margins(x=0.0)
    axes.set_ylabel(style.axis_label(name, symbol))
    axes.set_xlabel(f"time [{unit}]")
    style.legend_above(axes)
    return figure
