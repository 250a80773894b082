"""Figure: how key figures go with what varies, with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from bywire.report import style
from bywire.report.legend import legend_outside
from bywire.report.study.drawn_cases import BARS
from bywire.studies.findings import ChoiceInfluence
from bywire.studies.statistics import Influence

_BAR = 0.24  # height [inch]

Driving = Influence | ChoiceInfluence


def influence_bars(influences: Mapping[str, Sequence[Driving]]) -> Figure:
    """Draw the rank correlations of every key figure, by name, the strongest on top.

    Those that cannot be told from none are pale. Choices have their correlation ratio in another
    color, without a sign or an interval.
    """
    shown = {name: list(each)[:BARS] for name, each in influences.items()}
    counts = [max(len(each), 1) for each in shown.values()]
    has_choices = any(isinstance(i, ChoiceInfluence) for each in shown.values() for i in each)
    height = 0.7 * len(counts) + _BAR * sum(counts) + 0.3 * has_choices
    figure, panels = style.new_figure(height, counts)
    for axes, (name, each) in zip(panels, shown.items(), strict=True):
        _draw(axes, each)
        axes.set_title(style.plain(name.replace("_", " ")), fontsize=style.TEXT_SIZE, loc="left")
    panels[-1].set_xlabel(f"rank correlation{', or correlation ratio' * has_choices} [-]")
    if has_choices:
        legend_outside(
            figure,
            [
                Patch(color=style.BLUE, label="rank correlation"),
                Patch(color=style.ORANGE, label="correlation ratio of a choice"),
            ],
            "right",
        )
    return figure


def _draw(axes: Axes, each: Sequence[Driving]) -> None:
    places = range(len(each))[::-1]
    for place, i in zip(places, each, strict=True):
        if isinstance(i, ChoiceInfluence):
            value, ends, color = i.correlation_ratio, None, style.ORANGE
        else:
            value, color = i.correlation, style.BLUE
            ends = np.array([[value - i.low], [i.high - value]])
        axes.barh(
            place,
            value,
            xerr=ends,
            color=color if i.is_distinct else style.PALE,
            height=0.7,
            error_kw={"elinewidth": 0.9, "capsize": 2.0, "ecolor": style.BLACK},
        )
    names = [
        style.plain(i.quantity, 40) + " (choice)" * isinstance(i, ChoiceInfluence) for i in each
    ]
    axes.set_yticks(places, names)
    axes.axvline(0.0, color=style.GRAY, linewidth=0.8)
    axes.set_xlim(-1.05, 1.05)
