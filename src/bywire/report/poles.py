"""Figures: poles in the complex plane, and root loci."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from bywire.analysis.linear.linear_model import STILL
from bywire.analysis.locus import Border, Locus
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.style import legend_outside
from bywire.report.wording import amount, in_display_unit

_RATIOS = (0.1, 0.2, 0.4, 0.6, 0.8)
"""damping ratios that are drawn"""
_BEYOND = 0.35  # visible part of the unstable half plane, relative to the radius


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


def _draw_plane(axes: Axes, radius: float, period: float, growth: float = 0.0) -> None:
    """Draw rays, circles and limits of the upper half plane up to a radius.

    Parameters
    ----------
    axes
        Axes for the lines.
    radius
        Maximum magnitude of a visible rate [1/s].
    period
        Sample time [s], 0 for none. Poles cannot be distinguished above half its frequency, f_s/2.
    growth
        Maximum real part that must be visible [1/s]; at least a fraction of the radius is visible.
    """
    right = max(_BEYOND * radius, 1.05 * growth)
    axes.axvspan(0.0, 10.0 * radius, color="#F7E3DA", zorder=0.5, linewidth=0.0)
    axes.axvline(0.0, color=style.BLACK, linewidth=0.9, zorder=1.5)
    axes.axhline(0.0, color=style.GRAY, linewidth=0.6, zorder=1.0)
    for ratio in _RATIOS:
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


def _shown_radius(sizes: list[float], period: float) -> float:
    """Return the radius that shows rates of these magnitudes [1/s], within the sampling limit."""
    largest = max((s for s in sizes if math.isfinite(s) and s > 0.0), default=1.0)
    return min(1.1 * largest, 1.02 * np.pi / period) if period else 1.1 * largest


# --- Poles of a closed loop

_SLOW = 4.0
"""the second plane shows rates up to this multiple of the bandwidth"""


def pole_map(rates: NDArray[np.complex128], period: float, bandwidth: float) -> Figure:
    """Draw poles in two planes: all poles up to the sampling limit, and the slow, dominant poles.

    Of each pair, the pole with positive frequency is drawn. The unstable half is shaded.

    Parameters
    ----------
    rates
        Poles as rates [1/s], shape (n,).
    period
        Sample time [s].
    bandwidth
        Bandwidth of the loop [Hz]; NaN if there is none.
    """
    sizes = np.abs(rates)
    moving = rates[(sizes > STILL) & (rates.imag >= -STILL)]
    whole = _shown_radius([float(s) for s in np.abs(moving)], period)
    radius = _slow_radius([float(s) for s in np.abs(moving)], bandwidth, whole)
    figure, panels = planes(("poles", "slow poles"))
    for axes, size in zip(panels, (whole, radius), strict=True):
        _draw_plane(axes, size, period)
        for unstable in (False, True):
            part = moving[(moving.real > 0) == unstable]
            if not part.size:
                continue
            axes.plot(
                part.real,
                part.imag,
                "x",
                markersize=7,
                markeredgewidth=1.6,
                zorder=4,
                color=style.VERMILLION if unstable else style.BLUE,
            )
    beyond = int(
        np.sum((moving.real < panels[0].get_xlim()[0]) | (moving.imag > panels[0].get_ylim()[1]))
    )
    if beyond:
        panels[0].set_title(
            f"poles ({beyond} faster, not shown)", fontsize=style.TEXT_SIZE, loc="left"
        )
    return figure


def _slow_radius(sizes: list[float], bandwidth: float, whole: float) -> float:
    """Return the radius of the plane of slow poles [1/s].

    Parameters
    ----------
    sizes
        Magnitudes of all rates [1/s].
    bandwidth
        Bandwidth [Hz]; NaN: the median of the magnitudes is used instead.
    whole
        Radius of the plane of all poles [1/s].
    """
    middle = 2.0 * np.pi * bandwidth
    if not math.isfinite(middle):
        middle = float(np.median(sizes)) if sizes else whole
    return min(_SLOW * middle, whole)


# --- Root locus: poles of a loop or a plant versus a parameter

_COLORS = "viridis"
_ROOM = 1.3  # margin around the visible poles


def root_locus(locus: Locus, bandwidth: float) -> Figure:
    """Draw the root locus in two planes: all poles up to the sampling limit, and the slow poles.

    Parameters
    ----------
    locus
        The poles.
    bandwidth
        Maximum bandwidth of the loop over the range [Hz]; NaN if there is none. In that case, the
        poles that become unstable determine the second plane.
    """
    rates = locus.rates
    sizes = [float(s) for s in np.abs(rates[np.isfinite(rates)]) if s > STILL]
    whole = _shown_radius(sizes, locus.period)
    slow = min(max([_slow_radius(sizes, bandwidth, whole), *_borders(locus)]), whole)
    crossing = _crossing(locus)
    if not math.isfinite(bandwidth) and crossing > 0.0:
        slow = min(crossing, whole)
    figure, panels = planes(("poles", "slow poles"), 4.6)
    values, _ = in_display_unit(np.asarray(locus.values), locus.unit)
    norm = Normalize(values[0], values[-1])
    for axes, radius in zip(panels, (whole, slow), strict=True):
        inside = rates[np.isfinite(rates) & (np.abs(rates) <= radius)]
        _draw_plane(axes, radius, locus.period, float(np.max(inside.real, initial=0.0)))
        _ways(axes, locus, norm, values)
    bar = figure.colorbar(
        ScalarMappable(norm, _COLORS), ax=panels, aspect=40, pad=0.02, format="%g"
    )
    bar.ax.tick_params(labelsize=style.TEXT_SIZE)
    bar.set_label(style.axis_label(locus.name, locus.unit), fontsize=style.TEXT_SIZE)
    handles, _ = panels[0].get_legend_handles_labels()
    legend_outside(figure, handles, columns=1)
    return figure


def _borders(locus: Locus) -> list[float]:
    return [_ROOM * abs(border.rate) for border in locus.borders]


def _crossing(locus: Locus) -> float:
    """Return the radius that shows the complete loci of poles that become unstable; 0 for none."""
    rates = np.where(np.isfinite(locus.rates), locus.rates, 0.0)
    turning = (rates.real > STILL).any(axis=0) & (rates.real < -STILL).any(axis=0)
    return _ROOM * float(np.max(np.abs(rates[:, turning]), initial=0.0))


def border_text(border: Border, name: str, unit: str) -> str:
    """Return a stability limit of a loop in words."""
    side = "below" if border.above else "above"
    swing = border.rate.imag / (2.0 * np.pi)
    how = f"oscillates at {swing:.3g} Hz" if swing > 1e-3 else "drifts away"
    return f"unstable {side} {name} = {amount(border.value, unit)}: the loop {how}"


def _ways(axes: Axes, locus: Locus, norm: Normalize, values: Array) -> None:
    rates = locus.rates
    for column in rates.T:
        moves = np.isfinite(column) & (np.abs(column) > STILL)
        upper = moves & (column.imag >= -STILL)
        if not upper.any():
            continue
        line = np.where(upper, column, np.nan)
        axes.plot(line.real, line.imag, color=style.GRAY, linewidth=0.6, zorder=2.0)
        axes.scatter(
            line.real,
            line.imag,
            c=values,
            cmap=_COLORS,
            norm=norm,
            s=7,
            zorder=3,
            linewidths=0.0,
        )
    for k, marker, text in ((0, "x", "first"), (-1, "o", "last")):
        ends = rates[k]
        shown = ends[np.isfinite(ends) & (np.abs(ends) > STILL) & (ends.imag >= -STILL)]
        axes.plot(
            shown.real,
            shown.imag,
            marker,
            color=style.BLACK,
            markersize=5,
            zorder=4,
            markerfacecolor="none",
            linestyle="none",
            label=style.plain(f"{text}: {locus.name} = {amount(locus.values[k], locus.unit)}"),
        )
    for border in locus.borders:
        axes.plot(
            border.rate.real,
            border.rate.imag,
            "*",
            color=style.VERMILLION,
            markersize=11,
            markeredgecolor="white",
            zorder=5,
            linestyle="none",
            label=style.plain(border_text(border, locus.name, locus.unit)),
        )
