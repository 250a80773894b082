"""Figure: how probable it is that a key figure comes worse than a value, down to rare ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from bywire.core.typing import Array
from bywire.report import style
from bywire.report.line_role import Role
from bywire.report.readable_axis import few_labels, scale_of


@dataclass(frozen=True)
class Curve:
    """A key figure and the probability that it comes worse.

    Parameters
    ----------
    name, unit
        The figure, in SI or ``"%"``.
    limit, admitted
        What it has to keep, and the probability with which it may not.
    values
        Shape (points,).
    probability, low, high
        Estimate and interval at each value; NaN where there is none.
    """

    name: str
    unit: str
    limit: float
    admitted: float
    values: Array
    probability: Array
    low: Array
    high: Array


def exceedance(curves: Sequence[Curve]) -> Figure:
    """Draw every curve over a logarithmic probability, a panel with an abscissa of its own each."""
    figure, panels = style.new_figure(0.5 + 2.0 * len(curves), [1.0] * len(curves), is_shared=False)
    look = style.STROKES[Role.LIMIT]
    for axes, each in zip(panels, curves, strict=True):
        known = each.probability > 0.0
        scale = scale_of(np.append(each.values[known], each.limit), each.unit)
        values, limit = scale(each.values[known]), scale(each.limit)
        axes.fill_between(
            values, each.low[known], each.high[known], color=style.SHADE, label="interval"
        )
        axes.plot(values, each.probability[known], color=style.BLUE, label="estimate")
        axes.axvline(
            limit,
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            label="limit, admitted",
        )
        axes.axhline(
            each.admitted, color=look.color, linestyle=look.linestyle, linewidth=look.linewidth
        )
        axes.set_yscale("log")
        axes.set_ylabel("probability [-]")
        axes.set_ylim(top=2.0, bottom=0.3 * float(np.min(each.probability[known], initial=0.1)))
        few_labels(axes.xaxis, style.WIDTH - 1.0)
        axes.set_xlabel(scale.label(each.name.replace("_", " ")))
    style.legend_above(panels[0])
    return figure
