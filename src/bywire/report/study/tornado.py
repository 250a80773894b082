"""Figure: how far each quantity alone moves the key figures, the farthest on top."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bywire.report import style
from bywire.report.study.drawn_cases import BARS
from bywire.report.study.legend import legend_outside
from bywire.report.study.readable_axis import (
    Scale,
    beyond,
    few_labels,
    limit_text,
    name_beyond,
    scale_of,
    size_of,
)
from bywire.studies.effects import Effect

_BAR = 0.28  # height of a quantity [inch]


def tornado(
    effects: Mapping[str, Sequence[Effect]], units: Mapping[str, str],
    limits: Mapping[str, float],
) -> Figure:  # fmt: skip
    """Draw the swings of every key figure around what the bench itself gives.

    Parameters
    ----------
    effects
        Key figure -> what each quantity does to it, the largest swing first; at least one.
    units
        SI unit of every key figure, or ``"%"``.
    limits
        Limits of the key figures that have one, in their unit; only named where they lie far off.
    """
    shown = {name: each[:BARS] for name, each in effects.items()}
    counts = [len(each) for each in shown.values()]
    figure, panels = style.new_figure(
        0.4 + 0.75 * len(counts) + _BAR * sum(counts), [c + 0.5 for c in counts], is_shared=False
    )
    has_limit = False
    for axes, (name, each) in zip(panels, shown.items(), strict=True):
        axes.set_title(style.plain(name.replace("_", " ")), fontsize=style.TEXT_SIZE, loc="left")
        figures = np.concatenate([[e.nominal, *e.figures] for e in each])
        figures = figures[np.isfinite(figures)]
        scale = scale_of(figures, units[name])
        _draw(axes, each, scale)
        if (limit := limits.get(name)) is not None:
            if far := beyond(limit, figures):
                text = limit_text(limit, units[name], size_of(figures))
                name_beyond(axes, text, far, style.BLACK, "right")
            else:
                has_limit = True
                axes.axvline(scale(limit), color=style.BLACK, linewidth=1.0, linestyle=":")
        few_labels(axes.xaxis, style.WIDTH - 2.5)
        axes.set_xlabel(scale.label(name.replace("_", " ")))
    handles: list[Artist] = [
        Patch(color=style.BLUE, label="quantity below the bench's"),
        Patch(color=style.ORANGE, label="above"),
    ]
    if has_limit:
        handles.append(Line2D([], [], color=style.BLACK, linewidth=1.0, linestyle=":",
                              label="limit"))  # fmt: skip
    legend_outside(figure, handles, "right")
    return figure


def _draw(axes: Axes, effects: Sequence[Effect], scale: Scale) -> None:
    """Draw of each quantity what its lower and its upper end make, from the bench's own figure."""
    middle = scale(effects[0].nominal)
    for place, effect in zip(range(len(effects))[::-1], effects, strict=True):
        for end, color in ((0, style.BLUE), (-1, style.ORANGE)):
            at = scale(float(effect.figures[end]))
            if np.isfinite(at):
                axes.barh(place, at - middle, left=middle, height=0.7, color=color)
        known = scale(effect.figures[np.isfinite(effect.figures)])
        axes.plot(known, np.full(known.size, place), "|", color=style.BLACK, markersize=6.0)
    axes.set_yticks(
        range(len(effects))[::-1], [style.plain(each.quantity, 40) for each in effects]
    )
    axes.axvline(middle, color=style.GRAY, linewidth=0.8)
