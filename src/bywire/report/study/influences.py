"""Figures of key figures' drivers: correlations, indices, effect of each quantity alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bywire.core.typing import Array
from bywire.report import style
from bywire.report.channel import size_of
from bywire.report.readable_axis import (
    CHARACTER,
    Scale,
    beyond,
    difference_scale,
    few_labels,
    limit_text,
    name_beyond,
    scale_of,
)
from bywire.report.study.drawn_cases import BARS
from bywire.report.style import legend_outside
from bywire.studies.findings import ChoiceInfluence, Effect
from bywire.studies.sensitivity import ElementaryEffects, VarianceShares
from bywire.studies.statistics import Influence

_CORRELATION = 0.24  # height of a bar [inch]

Driving = Influence | ChoiceInfluence


def influence_bars(influences: Mapping[str, Sequence[Driving]]) -> Figure:
    """Draw the rank correlations of every key figure, by name, with the strongest on top.

    Insignificant correlations are pale. Choices show their correlation ratio in another color,
    without a sign or an interval.
    """
    shown = {name: list(each)[:BARS] for name, each in influences.items()}
    counts = [max(len(each), 1) for each in shown.values()]
    has_choices = any(isinstance(i, ChoiceInfluence) for each in shown.values() for i in each)
    height = 0.7 * len(counts) + _CORRELATION * sum(counts) + 0.3 * has_choices
    figure, panels = style.new_figure(height, counts)
    for axes, (name, each) in zip(panels, shown.items(), strict=True):
        _draw_correlations(axes, each)
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


def _draw_correlations(axes: Axes, each: Sequence[Driving]) -> None:
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


# --- Indices of sensitivity, with intervals

Drivers = Sequence[VarianceShares] | Sequence[ElementaryEffects]

_INDEX = 0.34  # height of a quantity [inch]
_THICK = 0.38  # height of one of its two bars, relative to the distance between quantities
_LABELS = {VarianceShares: ("total", "first order"), ElementaryEffects: ("mu*", "sigma")}


def sensitivity_bars(
    drivers: Mapping[str, Drivers], units: Mapping[str, str], sizes: Mapping[str, float]
) -> Figure:
    """Draw the indices of every key figure, with the strongest quantity on top.

    Parameters
    ----------
    drivers
        Key figure -> its indices, the strongest first; at least one.
    units
        SI unit of every key figure, or ``"%"``.
    sizes
        Maximum magnitude of every key figure, in that unit.
    """
    shown: dict[str, Drivers] = {name: each[:BARS] for name, each in drivers.items()}
    counts = [len(each) for each in shown.values()]
    # Each with its own abscissa: effects have the units of their figures.
    figure, panels = style.new_figure(
        0.4 + 0.75 * len(counts) + _INDEX * sum(counts), [c + 0.5 for c in counts], is_shared=False
    )
    for axes, (name, each) in zip(panels, shown.items(), strict=True):
        axes.set_title(style.plain(name.replace("_", " ")), fontsize=style.TEXT_SIZE, loc="left")
        is_share = isinstance(each[0], VarianceShares)
        scale = difference_scale(sizes[name], units[name])
        _draw_indices(axes, each, 1.0 if is_share else scale.factor)
        axes.set_xlabel(
            "fraction of the variance [-]" if is_share else scale.label("elementary effect")
        )
    labels = _LABELS[type(next(iter(shown.values()))[0])]
    colors = (style.BLUE, style.ORANGE)
    handles = [Patch(color=c, label=text) for c, text in zip(colors, labels, strict=True)]
    legend_outside(figure, handles, "right")
    return figure


def _draw_indices(axes: Axes, drivers: Drivers, factor: float) -> None:
    """Draw two bars per quantity: the ranking index above, the other index below."""
    places = np.arange(len(drivers))[::-1]
    upper = factor * np.array(
        [[e.strength.value, e.strength.low, e.strength.high] for e in drivers]
    )
    lower = factor * np.array(
        [
            [e.first.value, e.first.low, e.first.high]
            if isinstance(e, VarianceShares)
            else [e.sigma] * 3  # sigma has no interval
            for e in drivers
        ]
    )
    strong = [e.strength.low > 0.0 for e in drivers]
    first = [
        e.first.low > 0.0 if isinstance(e, VarianceShares) else e.strength.low > 0.0
        for e in drivers
    ]
    for values, shift, color, is_distinct in (
        (upper, 0.5, style.BLUE, strong),
        (lower, -0.5, style.ORANGE, first),
    ):
        axes.barh(
            places + shift * _THICK,
            values[:, 0],
            height=_THICK,
            xerr=_reach(values),
            color=[color if distinct else style.PALE for distinct in is_distinct],
            error_kw={"elinewidth": 0.9, "capsize": 2.0, "ecolor": style.BLACK},
        )
    axes.set_yticks(places, [style.plain(e.quantity, 40) for e in drivers])
    axes.axvline(0.0, color=style.GRAY, linewidth=0.8)


def _reach(values: Array) -> Array | None:
    """Return the lengths of intervals below and above, shape (2, quantities); None without any."""
    below, above = values[:, 0] - values[:, 1], values[:, 2] - values[:, 0]
    return np.array([below, above]) if np.any(above > 0.0) else None


# --- Each quantity alone, with the largest swing on top

_SWING = 0.28  # height of a quantity [inch]
_PANEL = style.WIDTH - 2.5  # approximate length of an abscissa [inch]
_PALE = 0.6  # opacity of the bar of a choice
_NAME_SIZE = 7.0  # size of the name of a choice [points]
_LONGEST = 24  # characters of the name that fit
_EDGE, _MARK = 0.99, 5.0  # position and size of marks of levels without the figure [points]


def tornado(
    effects: Mapping[str, Sequence[Effect]],
    units: Mapping[str, str],
    limits: Mapping[str, float],
) -> Figure:
    """Draw the swings of every key figure around its value in the bench itself.

    Choices have no direction, so their bars are gray, with the names of the farthest choices at the
    ends. A triangle at the edge marks quantities for which the figure is undefined at some level.

    Parameters
    ----------
    effects
        Key figure -> effect of each quantity, the largest swing first; at least one.
    units
        SI unit of every key figure, or ``"%"``.
    limits
        Limits of key figures, in their unit; only written if they are far away.
    """
    shown = {name: each[:BARS] for name, each in effects.items()}
    counts = [len(each) for each in shown.values()]
    figure, panels = style.new_figure(
        0.4 + 0.75 * len(counts) + _SWING * sum(counts), [c + 0.5 for c in counts], is_shared=False
    )
    has_limit = False
    for axes, (name, each) in zip(panels, shown.items(), strict=True):
        axes.set_title(style.plain(name.replace("_", " ")), fontsize=style.TEXT_SIZE, loc="left")
        figures = np.concatenate([[e.nominal, *e.figures] for e in each])
        figures = figures[np.isfinite(figures)]
        scale = scale_of(figures, units[name])
        _draw_swings(axes, each, scale)
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
            Patch(color=style.BLUE, label="quantity below the bench value"),
            Patch(color=style.ORANGE, label="above the bench value"),
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


def _draw_swings(axes: Axes, effects: Sequence[Effect], scale: Scale) -> None:
    """Draw the effects of the lower and the upper end of each quantity, from the bench's figure."""
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
        axes.plot(ends, [place, place], color=style.BLACK, linewidth=0.6)  # also between levels
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
    """Draw the farthest choices to either side, with their names."""
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
    """Leave space for the names of choices at both ends of an abscissa."""
    names = [_name(each, k) for each in effects if not each.unit for k in range(len(each.values))]
    if not names:
        return
    longest = (max(map(len, names)) + 1) * CHARACTER * _NAME_SIZE / style.TEXT_SIZE
    share = min(longest / _PANEL, 0.3)
    axes.margins(x=share / (1.0 - 2.0 * share))
