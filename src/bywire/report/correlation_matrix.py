"""Figure: correlations of estimates, which unknowns the data tells apart badly."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from bywire.identification.estimate import Estimate
from bywire.report import style

_NUMBERED = 14  # unknowns up to which there is room for numbers


def correlation_matrix(estimate: Estimate) -> Figure:
    """Draw the correlation matrix with its numbers; blue is negative, red positive."""
    names, c = estimate.names, estimate.correlation
    size = len(names)
    height = min(max(1.6 + 0.36 * size, 2.4), 6.5)
    figure = Figure(figsize=(style.WIDTH, height), layout="constrained", facecolor="white")
    axes = figure.subplots()
    image = axes.imshow(c, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    axes.set_xticks(range(size), [style.plain(n, 24) for n in names], rotation=40, ha="right")
    axes.set_yticks(range(size), [style.plain(n, 24) for n in names])
    axes.tick_params(labelsize=style.TEXT_SIZE, length=0.0)
    axes.spines[:].set_visible(False)
    if size <= _NUMBERED:
        for (row, column), value in np.ndenumerate(c):
            axes.text(
                column,
                row,
                f"{value:.2f}",
                ha="center",
                va="center",
                fontsize=style.TEXT_SIZE - 1.5,
                color="white" if abs(value) > 0.6 else style.BLACK,
            )
    bar = figure.colorbar(image, ax=axes, shrink=0.9)
    bar.set_label("correlation [-]", fontsize=style.TEXT_SIZE)
    bar.ax.tick_params(labelsize=style.TEXT_SIZE)
    return figure
