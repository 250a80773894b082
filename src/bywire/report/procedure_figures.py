"""Figures of a procedure: temperatures over its stops, and values relative to their limits."""

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
_COLORS = (style.BLUE, style.ORANGE, style.GREEN, style.GRAY)


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
    """

    begin: float
    time: Array
    discs: dict[str, Array]


@dataclass(frozen=True)
class UsedLimit:
    """Value of a limited figure relative to its limit.

    ``label``: stop and figure; ``share``: value over limit, in percent; ``outcome``: the verdict.
    """

    label: str
    share: float
    outcome: str


def temperature_figure(groups: Sequence[Sequence[HeatedStop]]) -> Figure:
    """Draw disc temperatures versus time, one panel per group of stops that follow each other."""
    figure, rows = style.new_figure(0.5 + 1.7 * len(groups), [1.0] * len(groups))
    for axes, stops in zip(rows, groups, strict=True):
        for k, label in enumerate(stops[0].discs):
            for each in stops:
                T, _ = in_display_unit(each.discs[label], "K")
                first = each is stops[0]
                axes.plot(
                    *decimate(each.begin + each.time, T),
                    color=_COLORS[k % len(_COLORS)],
                    linewidth=1.4,
                    label=label if first else None,
                )
            ends = [
                (e.begin + e.time[i], in_display_unit(e.discs[label], "K")[0][i])
                for e in stops
                for i in (0, -1)
            ]
            axes.plot(
                *zip(*ends, strict=True),
                color=_COLORS[k % len(_COLORS)],
                linewidth=0.6,
                linestyle=":",
            )
        style.few_ticks(axes, 4)
        axes.set_ylabel(style.axis_label("disc temperature", "K", "\n"))
        axes.legend(loc="best")
    rows[-1].set_xlabel("time [s]")
    return figure


def limit_figure(limits: Sequence[UsedLimit]) -> Figure:
    """Draw each value as a percentage of its limit; the dashed line is the limit."""
    figure, (axes,) = style.new_figure(0.8 + _ROW * len(limits), [1.0])
    colors = {"met": style.GREEN, "missed": style.ORANGE}
    for k, each in enumerate(limits):
        axes.barh(k, each.share, height=0.6, color=colors.get(each.outcome, style.GRAY))
    axes.set_yticks(range(len(limits)), [each.label for each in limits])
    axes.invert_yaxis()
    look = style.STROKES[Role.LIMIT]
    axes.axvline(100.0, color=look.color, linestyle=look.linestyle, linewidth=look.linewidth)
    axes.set_xlabel("value / limit [%]")
    return figure
