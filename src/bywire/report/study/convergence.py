"""Figure: how the estimate of a probability came about, case by case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.artist import Artist
from matplotlib.figure import Figure

from bywire.report import style
from bywire.report.legend import legend_outside
from bywire.report.line_role import Role
from bywire.report.readable_axis import few_labels, write_out
from bywire.studies.statistics import Share

_MARGIN = 8.0  # shown at most of an interval, in what the wanted probability leaves to failure
_LONG = 10.0  # ratio of numbers of cases from which they are drawn by decades


def convergence(
    shares: Mapping[str, Sequence[Share]], wanted: Mapping[str, float | None], first: int = 1
) -> Figure:
    """Draw the share of the first cases that meet a requirement, over their number.

    Ordinates reach from what decides, which is close to the wanted probability, to 100 %.

    Parameters
    ----------
    shares
        Text of a requirement -> the share of ever more cases, with its interval.
    wanted
        Probability that it has to be met with; dotted where there is one.
    first
        Cases from which on it is drawn: the interval of a few says nothing.
    """
    figure, panels = style.new_figure(0.5 + 1.4 * len(shares), [1.0] * len(shares))
    look = style.STROKES[Role.LIMIT]
    entries: dict[str, Artist] = {}
    for axes, (text, each) in zip(panels, shares.items(), strict=True):
        drawn = [s for s in each if s.cases >= min(first, each[-1].cases // 2)]
        count = [share.cases for share in drawn]
        (entries["estimate"],) = axes.plot(
            count, [100.0 * s.value for s in drawn], color=style.BLUE
        )
        entries["interval"] = axes.fill_between(
            count,
            [100.0 * s.low for s in drawn],
            [100.0 * s.high for s in drawn],
            color=style.SHADE,
        )
        if (probability := wanted[text]) is not None:
            entries["wanted"] = axes.axhline(
                100.0 * probability,
                color=look.color,
                linestyle=look.linestyle,
                linewidth=look.linewidth,
            )
        bottom = 100.0 * _lowest(drawn, probability)
        margin = 0.05 * (100.0 - bottom)
        axes.set_ylim(bottom - margin, 100.0 + margin)
        style.few_ticks(axes, 4)
        write_out(axes.yaxis)
        axes.set_ylabel("probability [%]")
        axes.set_title(style.plain(text), fontsize=style.TEXT_SIZE, loc="left")
        if count[-1] > count[0]:
            axes.set_xlim(count[0], count[-1])
    last = panels[-1]
    low, high = last.get_xlim()
    if high > _LONG * low > 0.0:
        last.set_xscale("log")
        style.log_ticks(last.xaxis)
    else:
        few_labels(last.xaxis, style.WIDTH - 1.0)
    last.set_xlabel("cases [-]")
    for text, artist in entries.items():
        artist.set_label(text)
    legend_outside(figure, list(entries.values()), columns=3)
    return figure


def _lowest(drawn: Sequence[Share], wanted: float | None) -> float:
    """Return the least probability that is shown."""
    reached = min(s.low for s in drawn)
    if wanted is not None:
        reached = max(min(reached, wanted), 1.0 - _MARGIN * (1.0 - wanted))
    return max(0.0, min(reached, drawn[-1].low, *(s.value for s in drawn)))
