"""Figure: sensitivity and complementary sensitivity of a loop, with their usual limits."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from bywire.analysis.loop_curves import Family, LoopCurve
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.curve_family import draw_family, value_bar
from bywire.report.line_role import Role

MOST_S, MOST_T = 2.0, 1.25
"""usual limits of max |S| and max |T|: S. Skogestad, I. Postlethwaite, "Multivariable Feedback
Control", 2nd ed. 2005, section 2.4.3"""
_LOWEST = -60.0  # what is drawn, dB


def sensitivity(family: Family) -> Figure:
    """Draw the magnitudes of S and T over frequency; unstable loops have none."""
    figure, panels = style.new_figure(4.8, (1.0, 1.0))
    for axes, quantity, limit in ((panels[0], "S", MOST_S), (panels[1], "T", MOST_T)):
        _panel(axes, family, quantity, limit)
    panels[1].set_xlabel(style.axis_label("frequency", "Hz"))
    panels[1].set_xscale("log")
    panels[1].xaxis.set_major_formatter(lambda hertz, _: f"{hertz:g}")
    panels[1].xaxis.set_minor_formatter(NullFormatter())
    f = family.curves[0].frequency
    panels[1].set_xlim(f[0], f[-1])
    value_bar(figure, panels, family)
    for axes in panels:
        style.legend_above(axes)
    figure.align_ylabels(panels)
    return figure


def _panel(axes: Axes, family: Family, quantity: str, limit: float) -> None:
    def points(curve: LoopCurve) -> tuple[Array, Array]:
        return curve.frequency, 20.0 * np.log10(np.abs(getattr(curve, quantity)))

    look = style.STROKES[Role.LIMIT]
    axes.axhline(
        20.0 * math.log10(limit),
        color=look.color,
        linestyle=look.linestyle,
        linewidth=look.linewidth,
        label=f"usual limit {limit:g}",
    )
    axes.axhline(0.0, color=style.GRAY, linewidth=0.6, zorder=1)
    draw_family(axes, family, points, stable_only=True, label=f"|{quantity}|")
    worst = family.curves[family.worst]
    if worst.margins.stable:
        size = np.abs(getattr(worst, quantity))
        k = int(np.argmax(size))
        axes.plot(
            worst.frequency[k],
            20.0 * math.log10(size[k]),
            "o",
            color=style.BLACK,
            markersize=5,
            zorder=5,
            linestyle="none",
            label=f"max |{quantity}| {size[k]:.3g}",
        )
    lowest = min((float(points(c)[1].min()) for c in family.curves), default=0.0)
    highest = max(
        (float(points(c)[1].max()) for c in family.curves if c.margins.stable), default=0.0
    )
    axes.set_ylim(max(lowest, _LOWEST) - 2.0, max(highest, 20.0 * math.log10(limit)) + 3.0)
    axes.set_ylabel(f"|{quantity}| [dB]")
