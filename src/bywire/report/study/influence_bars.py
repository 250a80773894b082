"""Figure: how key figures go with what varies, with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from bywire.report import style
from bywire.report.study.drawn_cases import BARS
from bywire.studies.statistics import Influence

_BAR = 0.24  # height [inch]


def influence_bars(influences: Mapping[str, Sequence[Influence]]) -> Figure:
    """Draw the rank correlations of every key figure, by name, the strongest on top.

    Quantities whose interval holds zero are pale: they cannot be told from none.
    """
    shown = {name: list(each)[:BARS] for name, each in influences.items()}
    counts = [max(len(each), 1) for each in shown.values()]
    figure, panels = style.new_figure(0.7 * len(counts) + _BAR * sum(counts), counts)
    for axes, (name, each) in zip(panels, shown.items(), strict=True):
        places = np.arange(len(each))[::-1]
        values = np.array([i.correlation for i in each])
        ends = np.array([[i.correlation - i.low, i.high - i.correlation] for i in each]).T
        colors = [style.BLUE if i.is_distinct else style.PALE for i in each]
        axes.barh(places, values, xerr=ends, color=colors, height=0.7,
                  error_kw={"elinewidth": 0.9, "capsize": 2.0, "ecolor": style.BLACK})  # fmt: skip
        axes.set_yticks(places, [style.plain(i.quantity, 40) for i in each])
        axes.axvline(0.0, color=style.GRAY, linewidth=0.8)
        axes.set_xlim(-1.05, 1.05)
        axes.set_title(style.plain(name.replace("_", " ")), fontsize=style.TEXT_SIZE, loc="left")
    panels[-1].set_xlabel("rank correlation [-]")
    return figure
