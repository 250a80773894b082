"""Figure: Nichols chart of a loop gain with contours of the closed loop's magnitude."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MultipleLocator

from bywire.analysis.loop_curves import Family, LoopCurve
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.curve_family import draw_family, value_bar

CONTOURS = (-20.0, -12.0, -6.0, -3.0, -1.0, 0.0, 1.0, 3.0, 6.0, 12.0)
"""magnitudes of T = L/(1 + L) that are drawn [dB]"""
_LOW, _HIGH = -40.0, 40.0  # gains that are shown, dB
_TURN = 90.0  # the chart ends at multiples of it, degree
_GRID = 361


def nichols(family: Family) -> Figure:
    """Draw the loop gain over its phase, with contours of constant magnitude of T.

    The area around -180° is what the disk margin of the worst curve keeps free: there
    ``|S - T|`` is larger than its largest value on the curve.
    """
    figure, (axes,) = style.new_figure(5.0)
    left, right = _phases(family)
    phase, gain = np.meshgrid(np.linspace(left, right, _GRID), np.linspace(_LOW, _HIGH, _GRID))
    L = 10.0 ** (gain / 20.0) * np.exp(1j * np.radians(phase))
    with np.errstate(divide="ignore", invalid="ignore"):
        T = 20.0 * np.log10(np.abs(L / (1.0 + L)))
        apart = np.abs((1.0 - L) / (1.0 + L))
    lines = axes.contour(
        phase, gain, T, levels=CONTOURS, colors=style.GRAY, linewidths=0.6, linestyles="-"
    )
    axes.clabel(lines, fmt="%g dB", fontsize=0.85 * style.TEXT_SIZE)
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=style.GRAY, linewidth=0.6, label="|T| constant")
    ]
    worst = family.curves[family.worst]
    if worst.margins.stable:
        limit = 2.0 / worst.margins.disk
        axes.contourf(phase, gain, apart, levels=[limit, np.inf], colors=[style.SHADE], zorder=0.9)
        axes.contour(
            phase,
            gain,
            apart,
            levels=[limit],
            colors=style.VERMILLION,
            linestyles=":",
            linewidths=1.0,
        )
        handles.append(
            Patch(
                facecolor=style.SHADE,
                edgecolor=style.VERMILLION,
                linestyle=":",
                label=f"disk margin {worst.margins.disk:.2f}",
            )
        )
    draw_family(axes, family, _points, label="loop gain L")
    _crossings(axes, worst)
    axes.set_xlim(left, right)
    axes.set_ylim(_LOW, _HIGH)
    axes.xaxis.set_major_locator(MultipleLocator(45.0 if right - left <= 540.0 else 180.0))
    axes.set_xlabel("phase of L [°]")
    axes.set_ylabel("magnitude of L [dB]")
    value_bar(figure, [axes], family)
    gain_lines = [h for h in axes.get_legend_handles_labels()[0] if isinstance(h, Line2D)]
    style.legend_above(axes, [*gain_lines, *handles])
    return figure


def _phases(family: Family) -> tuple[float, float]:
    """Return the ends of the abscissa: all phases of gains that are shown, and -180 degrees."""
    shown = [np.array([-225.0, -90.0])]
    for curve in family.curves:
        size = 20.0 * np.log10(np.abs(curve.L))
        shown.append(curve.phase[(size > _LOW) & (size < _HIGH)])
    every = np.concatenate(shown)
    return (
        _TURN * math.floor(float(every.min()) / _TURN),
        _TURN * math.ceil(float(every.max()) / _TURN),
    )


def _points(curve: LoopCurve) -> tuple[Array, Array]:
    return curve.phase, 20.0 * np.log10(np.abs(curve.L))


def _crossings(axes: Axes, worst: LoopCurve) -> None:
    """Mark -1 and where phase and gain margin are read."""
    margins = worst.margins
    axes.plot(
        -180.0,
        0.0,
        "+",
        color=style.BLACK,
        markersize=10,
        markeredgewidth=1.6,
        zorder=5,
        linestyle="none",
        label="-1",
    )
    if math.isfinite(margins.crossover):
        axes.plot(
            margins.phase - 180.0,
            0.0,
            "o",
            color=style.BLACK,
            markersize=5,
            zorder=5,
            linestyle="none",
            label=f"phase margin {margins.phase:.3g}°",
        )
    factors = (
        ("gain margin", "s", margins.gain, margins.gain_at),
        ("lower gain margin", "D", margins.lower_gain, margins.lower_gain_at),
    )
    for name, mark, factor, frequency in factors:
        if not 0.0 < factor < math.inf:
            continue
        phase = float(np.interp(frequency, worst.frequency, worst.phase))
        at = 360.0 * round((phase - 180.0) / 360.0) + 180.0  # the odd half turn next to it
        axes.plot(
            at,
            -20.0 * math.log10(factor),
            mark,
            color=style.BLACK,
            markersize=5,
            zorder=5,
            linestyle="none",
            label=f"{name} {factor:.3g}",
        )
