"""Figure: indices of sensitivity of key figures, with intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from bywire.core.typing import Array
from bywire.report import style
from bywire.report.legend import legend_outside
from bywire.report.readable_axis import difference_scale
from bywire.report.study.drawn_cases import BARS
from bywire.studies.sensitivity import ElementaryEffects, VarianceShares

Drivers = Sequence[VarianceShares] | Sequence[ElementaryEffects]

_BAR = 0.34  # height of a quantity [inch]
_THICK = 0.38  # of one of its two bars, in the distance of quantities
_LABELS = {VarianceShares: ("total", "first order"), ElementaryEffects: ("mu*", "sigma")}


def sensitivity_bars(
    drivers: Mapping[str, Drivers], units: Mapping[str, str], sizes: Mapping[str, float]
) -> Figure:
    """Draw the indices of every key figure, the strongest quantity on top.

    Parameters
    ----------
    drivers
        Key figure -> its indices, the strongest first; at least one.
    units
        SI unit of every key figure, or ``"%"``.
    sizes
        Largest magnitude of every key figure, in that unit.
    """
    shown: dict[str, Drivers] = {name: each[:BARS] for name, each in drivers.items()}
    counts = [len(each) for each in shown.values()]
    # Each with an abscissa of its own: effects have the units of their figures.
    figure, panels = style.new_figure(
        0.4 + 0.75 * len(counts) + _BAR * sum(counts), [c + 0.5 for c in counts], is_shared=False
    )
    for axes, (name, each) in zip(panels, shown.items(), strict=True):
        axes.set_title(style.plain(name.replace("_", " ")), fontsize=style.TEXT_SIZE, loc="left")
        is_share = isinstance(each[0], VarianceShares)
        scale = difference_scale(sizes[name], units[name])
        _draw(axes, each, 1.0 if is_share else scale.factor)
        axes.set_xlabel(
            "share of the variance [-]" if is_share else scale.label("elementary effect")
        )
    labels = _LABELS[type(next(iter(shown.values()))[0])]
    colors = (style.BLUE, style.ORANGE)
    handles = [Patch(color=c, label=text) for c, text in zip(colors, labels, strict=True)]
    legend_outside(figure, handles, "right")
    return figure


def _draw(axes: Axes, drivers: Drivers, factor: float) -> None:
    """Draw two bars a quantity: what it is ranked by above, the other index below."""
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
    """Return how far intervals reach below and above, shape (2, quantities); None without any."""
    below, above = values[:, 0] - values[:, 1], values[:, 2] - values[:, 0]
    return np.array([below, above]) if np.any(above > 0.0) else None
