"""Figure: residuals of an estimate in their order, their distribution, their autocorrelation."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from bywire.core.typing import Array
from bywire.identification.confidence import autocorrelation
from bywire.identification.estimate import Estimate
from bywire.report import style
from bywire.report.decimation import decimate

_LAGS = 60
_SURE = 1.96  # standard deviations within which white residuals' correlations lie in 95 of 100


def residual_figure(estimate: Estimate) -> Figure:
    """Draw what a model leaves unexplained.

    Weighted residuals over their order, their histogram beside the normal distribution of the
    same variance, and their autocorrelation with the band in which white ones stay.
    """
    r = estimate.residuals
    figure = Figure(figsize=(style.WIDTH, 4.6), layout="constrained", facecolor="white")
    grid = figure.add_gridspec(2, 2)
    whole = figure.add_subplot(grid[0, :])
    spread, together = figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1])
    for axes in (whole, spread, together):
        style.dress(axes)
    order = np.arange(1, r.size + 1, dtype=float)
    few = r.size <= style.FEW
    look = {"linestyle": "none", "marker": "o", "markersize": 3.5} if few else {"linewidth": 0.8}
    whole.plot(*decimate(order, r), color=style.BLUE, **look)
    whole.axhline(0.0, color=style.GRAY, linewidth=0.6)
    whole.margins(x=0.02 if few else 0.0)
    whole.set_xlabel("number of the measured value")
    whole.set_ylabel("weighted residual [-]")
    _histogram(spread, r)
    lags = min(_LAGS, max(r.size // 2, 1))
    rho = autocorrelation(r, lags)
    together.vlines(np.arange(1, lags + 1), 0.0, rho[1:], color=style.BLUE, linewidth=1.2)
    for end in (-_SURE, _SURE):
        limit = end / np.sqrt(r.size)
        label = "95 % band of white residuals" if end > 0 else None
        together.axhline(limit, color=style.VERMILLION, linestyle=":", linewidth=1.2, label=label)
    lowest = min(-0.2, float(rho.min()), -_SURE / np.sqrt(r.size))
    together.set_ylim(lowest - 0.05, 1.0)
    for axes in (whole, together):
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    together.set_xlabel("lag [samples]")
    together.set_ylabel("autocorrelation [-]")
    style.legend_above(together)
    return figure


def _histogram(axes: Axes, r: Array) -> None:
    size = float(r.std()) or 1.0
    axes.hist(r, bins=min(max(r.size // 20, 8), 60), density=True, color=style.SKY)
    at = np.linspace(float(r.min()), float(r.max()), 200)
    normal = np.exp(-0.5 * ((at - r.mean()) / size) ** 2) / (size * np.sqrt(2.0 * np.pi))
    axes.plot(at, normal, color=style.VERMILLION, linestyle="--", label="normal, same variance")
    axes.set_xlabel("weighted residual [-]")
    axes.set_ylabel("density [-]")
    style.legend_above(axes)
