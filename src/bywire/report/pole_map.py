"""Figure: poles of a closed loop in the plane of rates."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bywire.analysis.linear.linear_model import STILL
from bywire.report import style
from bywire.report.s_plane import draw_plane, planes, shown_radius

SLOW = 4.0
"""the second plane shows rates up to this multiple of the bandwidth"""


def pole_map(rates: NDArray[np.complex128], period: float, bandwidth: float) -> Figure:
    """Draw poles in two planes: all that the sampling can tell, and those that set the bandwidth.

    Pairs are shown by the one with positive frequency. The unstable half is shaded.

    Parameters
    ----------
    rates
        Poles as rates [1/s], shape (n,).
    period
        Sample time [s].
    bandwidth
        Bandwidth of the loop [Hz]; NaN where there is none.
    """
    sizes = np.abs(rates)
    moving = rates[(sizes > STILL) & (rates.imag >= -STILL)]
    whole = shown_radius([float(s) for s in np.abs(moving)], period)
    radius = slow_radius([float(s) for s in np.abs(moving)], bandwidth, whole)
    figure, panels = planes(("poles", "the slow ones"))
    for axes, size in zip(panels, (whole, radius), strict=True):
        draw_plane(axes, size, period)
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


def slow_radius(sizes: list[float], bandwidth: float, whole: float) -> float:
    """Return the radius of the plane of slow poles [1/s].

    Parameters
    ----------
    sizes
        Sizes of all rates [1/s].
    bandwidth
        Bandwidth [Hz]; NaN: the median of the sizes counts instead.
    whole
        Radius of the plane of all [1/s].
    """
    middle = 2.0 * np.pi * bandwidth
    if not math.isfinite(middle):
        middle = float(np.median(sizes)) if sizes else whole
    return min(SLOW * middle, whole)
