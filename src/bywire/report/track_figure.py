"""Figure: a drifting parameter, tracked, with its confidence band."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from bywire.identification.replaying.tracking import Track
from bywire.report import style
from bywire.report.line_role import Role
from bywire.report.wording import in_display_unit


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
