"""Figure: Bode plot of a loop gain with its margins marked."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator, NullFormatter

from bywire.analysis.loop_curves import Family, LoopCurve
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.curve_family import draw_family, value_bar


def loop_gain(family: Family) -> Figure:
    """Draw magnitude and phase of the loop gain; margins of the worst curve as vertical spans."""
    figure, (upper, lower) = style.new_figure(5.0, (1.0, 1.0))
    draw_family(upper, family, _magnitude, label="loop gain L")
    draw_family(lower, family, _phase)
    upper.axhline(0.0, color=style.GRAY, linewidth=0.8, zorder=1)
    lower.axhline(-180.0, color=style.GRAY, linewidth=0.8, zorder=1)
    _spans(upper, lower, family.curves[family.worst])
    upper.set_xscale("log")
    upper.margins(x=0.0)
    lower.xaxis.set_major_formatter(lambda hertz, _: f"{hertz:g}")
    lower.xaxis.set_minor_formatter(NullFormatter())
    span = max(float(np.ptp(curve.phase)) for curve in family.curves)
    lower.yaxis.set_major_locator(MultipleLocator(45.0 if span < 300.0 else 90.0))
    upper.set_ylabel("magnitude of L [dB]")
    lower.set_ylabel("phase of L [°]")
    lower.set_xlabel(style.axis_label("frequency", "Hz"))
    value_bar(figure, [upper, lower], family)
    style.legend_above(upper)
    figure.align_ylabels([upper, lower])
    return figure


def _spans(upper: Axes, lower: Axes, worst: LoopCurve) -> None:
    """Draw phase margin and gain margin as the spans that they are, with their frequencies."""
    margins = worst.margins
    if math.isfinite(margins.phase_at):
        text = f"phase margin {margins.phase:.3g}° at {margins.phase_at:.3g} Hz"
        lower.plot(
            [margins.phase_at] * 2,
            [-180.0, margins.phase - 180.0],
            color=style.GREEN,
            linewidth=2.2,
            zorder=4,
        )
        _line(upper, lower, margins.phase_at, style.GREEN, text)
    factors = (
        ("gain margin", margins.gain, margins.gain_at, style.PURPLE),
        ("lower gain margin", margins.lower_gain, margins.lower_gain_at, style.SKY),
    )
    for name, factor, at, color in factors:
        if not 0.0 < factor < math.inf:
            continue
        text = f"{name} {factor:.3g} at {at:.3g} Hz"
        if at > 0.0:  # rest lies beyond the axis
            upper.plot(
                [at] * 2, [-20.0 * math.log10(factor), 0.0], color=color, linewidth=2.2, zorder=4
            )
            _line(upper, lower, at, color, text)
        else:
            upper.plot([], [], color=color, linestyle="--", label=text)


def _line(upper: Axes, lower: Axes, frequency: float, color: str, text: str) -> None:
    for axes in (upper, lower):
        axes.axvline(
            frequency,
            color=color,
            linewidth=0.9,
            linestyle="--",
            zorder=1.6,
            label=text if axes is upper else "_",
        )


def _magnitude(curve: LoopCurve) -> tuple[Array, Array]:
    return curve.frequency, 20.0 * np.log10(np.abs(curve.L))


def _phase(curve: LoopCurve) -> tuple[Array, Array]:
    return curve.frequency, curve.phase
