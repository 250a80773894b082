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
from bywire.report.legend import legend_outside
from bywire.report.readable_axis import (
    CHARACTER,
    Scale,
    beyond,
    few_labels,
    limit_text,
    name_beyond,
    scale_of,
    size_of,
)
from bywire.report.study.drawn_cases import BARS
from bywire.studies.findings import Effect

_BAR = 0.28  # height of a quantity [inch]
_PANEL = style.WIDTH - 2.5  # about how long an abscissa is [inch]
_PALE = 0.6  # opacity of the bar of a choice
_NAME_SIZE = 7.0  # of the name of a choice [points]
_LONGEST = 24  # characters of it that have room
_EDGE, _MARK = 0.99, 5.0  # where levels without the figure are marked, and how large [points]


def tornado(
    effects: Mapping[str, Sequence[Effect]],
    units: Mapping[str, str],
    limits: Mapping[str, float],
) -> Figure:
    """Draw the swings of every key figure around what the bench itself gives.

    Choices are neither below nor above: their bars are gray, with the names of the farthest ones at
    the ends. A triangle at the edge marks quantities that have a level without the figure.

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
        _give_room(axes, each)
        few_labels(axes.xaxis, _PANEL)
        axes.set_xlabel(scale.label(name.replace("_", " ")))
    units_shown = [effect.unit for each in shown.values() for effect in each]
    handles: list[Artist] = []
    if any(units_shown):
        handles += [
            Patch(color=style.BLUE, label="quantity below the bench's"),
            Patch(color=style.ORANGE, label="above"),
        ]
    if not all(units_shown):
        handles.append(Patch(color=style.GRAY, alpha=_PALE, label="choice"))
    if any(effect.lacking for each in shown.values() for effect in each):
        handles.append(
            Line2D(
                [],
                [],
                color=style.ORANGE,
                marker=">",
                linestyle="",
                markersize=_MARK,
                label="not defined at a level",
            )
        )
    if has_limit:
        handles.append(
            Line2D([], [], color=style.BLACK, linewidth=1.0, linestyle=":", label="limit")
        )
    legend_outside(figure, handles, "right")
    return figure


def _draw(axes: Axes, effects: Sequence[Effect], scale: Scale) -> None:
    """Draw of each quantity what its lower and its upper end make, from the bench's own figure."""
    middle = scale(effects[0].nominal)
    for place, effect in zip(range(len(effects))[::-1], effects, strict=True):
        if effect.unit:
            for end, color in ((0, style.BLUE), (-1, style.ORANGE)):
                at = scale(float(effect.figures[end]))
                if np.isfinite(at):
                    axes.barh(place, at - middle, left=middle, height=0.7, color=color)
        else:
            _draw_choice(axes, place, effect, scale)
        known = scale(effect.figures[np.isfinite(effect.figures)])
        axes.plot(known, np.full(known.size, place), "|", color=style.BLACK, markersize=6.0)
        ends = scale(np.array([effect.least, effect.largest]))
        axes.plot(ends, [place, place], color=style.BLACK, linewidth=0.6)  # between levels, too
        if effect.lacking:
            axes.plot(
                _EDGE,
                place,
                ">",
                color=style.ORANGE,
                markersize=_MARK,
                clip_on=False,
                transform=axes.get_yaxis_transform(),
            )
    axes.set_yticks(range(len(effects))[::-1], [style.plain(each.quantity, 40) for each in effects])
    axes.axvline(middle, color=style.GRAY, linewidth=0.8)


def _draw_choice(axes: Axes, place: int, effect: Effect, scale: Scale) -> None:
    """Draw how far the farthest choices go to either side, with their names."""
    middle = scale(effect.nominal)
    if not np.isfinite(effect.figures).any():
        return
    for end, side in (
        (np.nanargmin(effect.figures), "right"),
        (np.nanargmax(effect.figures), "left"),
    ):
        at = scale(float(effect.figures[end]))
        axes.barh(place, at - middle, left=middle, height=0.7, color=style.GRAY, alpha=_PALE)
        if effect.swing:
            axes.annotate(
                _name(effect, int(end)),
                (at, place),
                (-4.0 if side == "right" else 4.0, 0.0),
                textcoords="offset points",
                ha=side,
                va="center",
                fontsize=_NAME_SIZE,
            )


def _name(effect: Effect, level: int) -> str:
    return style.plain(effect.values[level], _LONGEST)


def _give_room(axes: Axes, effects: Sequence[Effect]) -> None:
    """Leave room for the names of choices at both ends of an abscissa."""
    names = [_name(each, k) for each in effects if not each.unit for k in range(len(each.values))]
    if not names:
        return
    longest = (max(map(len, names)) + 1) * CHARACTER * _NAME_SIZE / style.TEXT_SIZE
    share = min(longest / _PANEL, 0.3)
    axes.margins(x=share / (1.0 - 2.0 * share))
