"""Figure: how the estimate of a probability came about, case by case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from bywire.report import style
from bywire.report.line_role import Role
from bywire.studies.statistics import Share


def convergence(
    shares: Mapping[str, Sequence[Share]], wanted: Mapping[str, float | None]
) -> Figure:
    """Draw the share of the first cases that meet a requirement, over their number.

    Parameters
    ----------
    shares
        Text of a requirement -> the share of ever more cases, with its interval.
    wanted
        Probability that it has to be met with; dotted where there is one.
    """
    figure, panels = style.new_figure(0.5 + 1.5 * len(shares), [1.0] * len(shares))
    look = style.STROKES[Role.LIMIT]
    for axes, (text, each) in zip(panels, shares.items(), strict=True):
        count = [share.cases for share in each]
        axes.fill_between(count, [100.0 * s.low for s in each], [100.0 * s.high for s in each],
                          color=style.SHADE, label="interval")  # fmt: skip
        axes.plot(count, [100.0 * s.value for s in each], color=style.BLUE, label="estimate")
        if (probability := wanted[text]) is not None:
            axes.axhline(100.0 * probability, color=look.color, linestyle=look.linestyle,
                         linewidth=look.linewidth, label="wanted")  # fmt: skip
        axes.set_xscale("log")
        style.few_ticks(axes, 4)
        axes.set_ylabel("probability [%]")
        axes.set_title(style.plain(text), fontsize=style.TEXT_SIZE, loc="left", y=1.12)
    style.legend_above(panels[0])
    panels[-1].set_xlabel("cases [-]")
    return figure
