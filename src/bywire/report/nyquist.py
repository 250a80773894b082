"""Figure: Nyquist plot of a loop gain with the disk that its disk margin keeps free."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from bywire.analysis.loop_curves import Family, LoopCurve, disk
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.curve_family import draw_family, value_bar
from bywire.report.legend import legend_outside

_LEFT, _RIGHT, _HALF = -3.2, 1.6, 1.9  # what of the plane is shown


def nyquist(family: Family) -> Figure:
    """Draw the loop gain in the complex plane near -1.

    The mirror image of negative frequencies is left out. The disk belongs to the worst curve; a
    loop gain outside it tolerates changes of gain and phase at once. Unstable loops have none.
    """
    figure, (axes,) = style.new_figure(5.2)
    worst = family.curves[family.worst]
    _disk(axes, worst)
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    axes.plot(
        np.cos(turn), np.sin(turn), color=style.GRAY, linewidth=0.7, linestyle=":", label="gain 1"
    )
    draw_family(axes, family, _points, label="loop gain L")
    _crossings(axes, worst)
    axes.plot(
        -1.0,
        0.0,
        "+",
        color=style.BLACK,
        markersize=10,
        markeredgewidth=1.6,
        zorder=5,
        label="-1",
        linestyle="none",
    )
    axes.axhline(0.0, color=style.GRAY, linewidth=0.6, zorder=1)
    axes.axvline(0.0, color=style.GRAY, linewidth=0.6, zorder=1)
    axes.set_xlim(_LEFT, _RIGHT, auto=True)  # fixed ones matplotlib would complain about
    axes.set_ylim(-_HALF, _HALF, auto=True)
    axes.set_aspect("equal", adjustable="datalim")  # more is shown where there is room
    axes.set_xlabel("real part of L [-]")
    axes.set_ylabel("imaginary part of L [-]")
    value_bar(figure, [axes], family)
    legend_outside(figure, axes.get_legend_handles_labels()[0], columns=3)
    return figure


def _points(curve: LoopCurve) -> tuple[Array, Array]:
    return curve.L.real, curve.L.imag


def _disk(axes: Axes, worst: LoopCurve) -> None:
    if not worst.margins.stable:
        return
    free = disk(min(worst.margins.disk, 2.0))
    look: dict[str, Any] = {
        "facecolor": style.SHADE,
        "edgecolor": style.VERMILLION,
        "linestyle": ":",
        "label": f"disk margin {worst.margins.disk:.2f}",
        "zorder": 1.2,
    }
    if math.isinf(free.radius):
        axes.axvspan(10.0 * _LEFT, 0.0, **look)
    else:
        axes.add_patch(Circle((free.middle, 0.0), free.radius, **look))


def _crossings(axes: Axes, worst: LoopCurve) -> None:
    """Mark where phase and gain margin are read."""
    margins = worst.margins
    if math.isfinite(margins.phase_at):
        angle = math.radians(margins.phase - 180.0)
        axes.plot(
            math.cos(angle),
            math.sin(angle),
            "o",
            color=style.BLACK,
            markersize=5,
            zorder=5,
            linestyle="none",
            label=f"phase margin {margins.phase:.3g}° at {margins.phase_at:.3g} Hz",
        )
    factors = (
        ("gain margin", "s", margins.gain, margins.gain_at),
        ("lower gain margin", "D", margins.lower_gain, margins.lower_gain_at),
    )
    for name, mark, factor, at in factors:
        if 0.0 < factor < math.inf:
            axes.plot(
                -1.0 / factor,
                0.0,
                mark,
                color=style.BLACK,
                markersize=5,
                zorder=5,
                linestyle="none",
                label=f"{name} {factor:.3g} at {at:.3g} Hz",
            )
