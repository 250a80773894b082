"""Figure of clamp force versus chamber pressure, in both directions."""

from __future__ import annotations

import numpy as np

from bywire.authoring import FigureKind, Result, ShownFigure, style


def _draw(result: Result) -> list[ShownFigure]:
    run = result.recordings["run"]
    figure, axes = style.new_figure(3.4, (1.0,))
    t, p, F = (run[name].values for name in ("time", "p", "F_cl"))
    top = t[np.argmax(F)]
    for label, color, rows in (
        ("apply", style.BLUE, t <= top),
        ("release", style.VERMILLION, t >= top),
    ):
        axes[0].plot(1e-5 * p[rows], 1e-3 * F[rows], color=color, label=label)
    axes[0].set_xlabel(style.axis_label("chamber pressure", "bar"))
    axes[0].set_ylabel(style.axis_label("clamp force", "kN"))
    style.legend_above(axes[0])
    caption = "Clamp force versus chamber pressure. The distance of the branches is hysteresis."
    return [ShownFigure("clamp-over-pressure", figure, caption)]


FIGURE = FigureKind("clamp-over-pressure", _draw)
