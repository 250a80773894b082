"""Figures of a fault campaign: times until danger and detection, and the cost of alarms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from bywire.core.typing import Array
from bywire.report import style

_ROW = 0.2  # height of a fault [inch]
_MOST = 60  # maximum number of faults in a figure
_LEAST = 0.5e-3  # s: immediate detection is drawn at the lower end of the logarithmic axis


class FaultTimes(NamedTuple):
    """Times of a fault from its onset [s], NaN for never; shape (cases,) each."""

    name: str
    violated: Array
    seen: Array


def fault_times(faults: Sequence[FaultTimes]) -> Figure:
    """Draw when each fault violates criteria and when it is detected, with the fastest on top.

    ``faults``: at least one; those without a violation come last.
    """
    ordered = sorted(faults, key=lambda f: (np.nanmin([*f.violated, np.inf]), f.name))[:_MOST]
    figure, (axes,) = style.new_figure(0.9 + _ROW * len(ordered))
    places = np.arange(len(ordered))[::-1]
    for label, color, marker, column in (
        ("criterion violated", style.VERMILLION, "s", 0),
        ("detected", style.BLUE, "o", 1),
    ):
        for place, fault in zip(places, ordered, strict=True):
            times = fault[1:][column]
            there = np.maximum(times[~np.isnan(times)], _LEAST) * 1e3
            shift = 0.14 * (1 - 2 * column)
            if there.size > 1:
                axes.plot(
                    [there.min(), there.max()],
                    [place + shift] * 2,
                    color=color,
                    linewidth=1.0,
                    zorder=2,
                )
            axes.plot(
                there,
                np.full(there.size, place + shift),
                marker,
                color=color,
                markersize=3.5,
                linestyle="none",
                zorder=3,
                label=label if place == places[0] else None,
            )
    axes.set_xscale("log")
    style.log_ticks(axes.xaxis)
    axes.set_yticks(places, [style.plain(fault.name) for fault in ordered])
    axes.set_ylim(-0.7, len(ordered) - 0.3)
    axes.set_xlabel("time from the onset [ms]")
    style.legend_above(axes)
    return figure


Curve = Sequence[tuple[float, int, float, int]]


def alarm_curves(curves: Mapping[str, Curve], healthy: int) -> Figure:
    """Draw each residual's detection delay of dangerous faults versus alarms in fault-free runs.

    Parameters
    ----------
    curves
        Residual -> factor of the threshold, alarms, median delay [s], number of detected runs.
    healthy
        Number of judged fault-free runs.
    """
    figure, (axes,) = style.new_figure(3.2)
    markers = "osD^vPX*<>"
    for k, (name, rows) in enumerate(curves.items()):
        shown = [row for row in rows if np.isfinite(row[2])]
        if not shown:
            continue
        color = style.SEQUENCE[k % len(style.SEQUENCE)]
        x, y = ([row[n] for row in shown] for n in (1, 2))
        axes.plot(
            np.array(x) / healthy * 100,
            np.array(y) * 1e3,
            color=color,
            linewidth=1.0,
            marker=markers[k % len(markers)],
            markersize=4,
            label=style.plain(name),
        )
        for factor, alarms, delay, _ in shown:
            if factor == 1.0:
                axes.plot(
                    alarms / healthy * 100,
                    delay * 1e3,
                    "o",
                    markersize=9,
                    fillstyle="none",
                    color=color,
                )
    axes.set_xscale("symlog", linthresh=100.0 / healthy)
    axes.set_yscale("log")
    style.log_ticks(axes.yaxis)
    axes.set_xlabel("fault-free runs with an alarm [%]")
    axes.set_ylabel("median delay [ms]")
    style.legend_above(axes)
    return figure
