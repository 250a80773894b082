"""Figures of a procedure: temperatures during its stops, and the utilization of each limit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from bywire.core.typing import Array
from bywire.report import style
from bywire.report.channel import decimate
from bywire.report.panels import Role
from bywire.report.wording import in_display_unit

_ROW = 0.24  # height of a bar [inch]


@dataclass(frozen=True)
class HeatedStop:
    """Disc temperatures of one stop.

    Parameters
    ----------
    begin
        Time at which it begins [s].
    time
        Times from then on [s].
    discs
        Temperatures [K] by label.
    pause_time, pause
        Times [s] and temperatures [K] of the interval before the stop; may be empty.
    """

    begin: float
    time: Array
    discs: dict[str, Array]
    pause_time: Array
    pause: dict[str, Array]


@dataclass(frozen=True)
class UsedLimit:
    """Utilization of a limit by a stop.

    ``label``: stop and key figure; ``share``: ratio of the value to an upper limit, or of a lower
    limit to the value, in percent; ``outcome``: the verdict.
    """

    label: str
    share: float
    outcome: str


def temperature_figure(groups: Sequence[Sequence[HeatedStop]]) -> Figure:
    """Draw disc temperatures versus time, one panel per group of stops that follow each other."""
    figure, rows = style.new_figure(0.6 + 1.7 * len(groups), [1.0] * len(groups))
    for axes, stops in zip(rows, groups, strict=True):
        for k, label in enumerate(stops[0].discs):
            color = style.SEQUENCE[k % len(style.SEQUENCE)]
            for each in stops:
                T, _ = in_display_unit(each.discs[label], "K")
                shown = style.plain(label) if each is stops[0] else None
                t = each.begin + each.time
                axes.plot(*decimate(t, T), color=color, linewidth=1.6, label=shown)
                if each.pause_time.size:
                    T, _ = in_display_unit(each.pause[label], "K")
                    axes.plot(each.pause_time, T, color=color, linewidth=0.8, linestyle=":")
        style.few_ticks(axes, 4)
        axes.set_ylabel(style.axis_label("disc temperature", "K", "\n"))
        if len(stops[0].discs) > 1:
            style.legend_above(axes)
    rows[-1].set_xlabel("time [s]")
    return figure


def limit_figure(limits: Sequence[UsedLimit]) -> Figure:
    """Draw the utilization of each limit. Bars that extend past the dotted line miss it."""
    figure, (axes,) = style.new_figure(0.8 + _ROW * len(limits), [1.0])
    colors = {"met": style.GREEN, "missed": style.VERMILLION}
    for k, each in enumerate(limits):
        axes.barh(k, each.share, height=0.6, color=colors.get(each.outcome, style.GRAY))
    axes.set_yticks(range(len(limits)), [style.plain(each.label) for each in limits])
    axes.invert_yaxis()
    look = style.STROKES[Role.LIMIT]
    axes.axvline(100.0, color=look.color, linestyle=look.linestyle, linewidth=look.linewidth)
    axes.set_xlabel("utilization of the limit [%]")
    return figure
