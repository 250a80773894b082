"""The plane of poles as rates: rays of equal damping ratio, circles of equal frequency."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from bywire.report import style

RATIOS = (0.1, 0.2, 0.4, 0.6, 0.8)
"""damping ratios that are drawn"""
_BEYOND = 0.35  # of the radius: what is shown of the unstable half plane


def planes(titles: tuple[str, ...], height: float = 4.2) -> tuple[Figure, list[Axes]]:
    """Return a figure with planes side by side.

    ``titles``: one per plane; ``height``: of the figure [inch].
    """
    figure = Figure(figsize=(style.WIDTH, height), layout="constrained", facecolor="white")
    panels = list(figure.subplots(1, len(titles), squeeze=False)[0])
    for axes, title in zip(panels, titles, strict=True):
        style.dress(axes)
        axes.set_title(title, fontsize=style.TEXT_SIZE, loc="left")
    return figure, panels


def draw_plane(axes: Axes, radius: float, period: float, growth: float = 0.0) -> None:
    """Draw rays, circles and borders of the upper half plane up to a radius.

    Parameters
    ----------
    axes
        Where to draw.
    radius
        Largest size of a rate that is shown [1/s].
    period
        Sample time [s], 0 for none: no pole can be told above half its frequency, f_s/2.
    growth
        Largest real part that must be seen [1/s]; at least a part of the radius is.
    """
    right = max(_BEYOND * radius, 1.05 * growth)
    axes.axvspan(0.0, 10.0 * radius, color="#F7E3DA", zorder=0.5, linewidth=0.0)
    axes.axvline(0.0, color=style.BLACK, linewidth=0.9, zorder=1.5)
    axes.axhline(0.0, color=style.GRAY, linewidth=0.6, zorder=1.0)
    for ratio in RATIOS:
        x, y = -ratio * radius, math.sqrt(1.0 - ratio**2) * radius
        axes.plot([0.0, x], [0.0, y], color=style.GRAY, linewidth=0.5, linestyle="--", zorder=1.0)
        axes.text(
            x,
            y,
            f"{ratio:g}",
            fontsize=0.8 * style.TEXT_SIZE,
            color=style.GRAY,
            ha="right",
            va="bottom",
        )
    turn = np.linspace(0.5 * np.pi, np.pi, 60)
    for hertz in MaxNLocator(4).tick_values(0.0, radius / (2.0 * np.pi)):
        size = 2.0 * np.pi * hertz
        if 0.0 < size <= 1.001 * radius:
            axes.plot(
                size * np.cos(turn),
                size * np.sin(turn),
                color=style.GRAY,
                linewidth=0.5,
                linestyle=":",
                zorder=1.0,
            )
            axes.text(
                0.02 * radius,
                size,
                f"{hertz:g} Hz",
                fontsize=0.8 * style.TEXT_SIZE,
                color=style.GRAY,
                ha="left",
                va="center",
            )
    if period and np.pi / period < 1.15 * radius:
        axes.axhline(np.pi / period, color=style.VERMILLION, linestyle=":", linewidth=1.0)
        axes.text(
            right,
            np.pi / period,
            r"$f_\mathrm{s}/2$ ",
            va="bottom",
            ha="right",
            fontsize=0.8 * style.TEXT_SIZE,
            color=style.VERMILLION,
        )
    axes.set_xlim(-1.05 * radius, right)
    axes.set_ylim(-0.05 * radius, 1.15 * radius)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.set_xlabel("real part [1/s]")
    axes.set_ylabel("imaginary part [rad/s]")


def shown_radius(sizes: list[float], period: float) -> float:
    """Return the radius that shows rates of some sizes [1/s], at most half the sampling's."""
    largest = max((s for s in sizes if math.isfinite(s) and s > 0.0), default=1.0)
    return min(1.1 * largest, 1.02 * np.pi / period) if period else 1.1 * largest
