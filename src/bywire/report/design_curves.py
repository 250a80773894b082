"""Figures: loop gain, sensitivity and step response of a loop before and after its design."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator, NullFormatter

from bywire.analysis.margins import LoopCurve
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.loop_curves import MOST_S, MOST_T
from bywire.report.panels import Role

_LOWEST = -60.0  # what is drawn, dB
_COLORS = (style.GRAY, style.BLUE, style.VERMILLION)
_LINES = ("--", "-", "-.")


@dataclass(frozen=True, eq=False)
class DesignCurve:
    """A set of gains on the nominal linear model.

    Parameters
    ----------
    label
        What the legend calls it.
    curve
        Its loop gain.
    time, step
        Response of the closed loop to a unit step [s, 1], shape (n,) each; it rests afterwards.
    span
        What of it is worth showing [s].
    """

    label: str
    curve: LoopCurve
    time: Array
    step: Array
    span: float


def loop_gains(curves: Sequence[DesignCurve], phase_margin: float | None) -> Figure:
    """Draw magnitude and phase of the loop gains; the phase margin read as a vertical span.

    ``curves``: at most three sets of gains, in their order; ``phase_margin``: the required one
    [degree], drawn as a limit of the phase at the crossovers.
    """
    figure, (upper, lower) = style.new_figure(5.0, (1.0, 1.0))
    for design, color, line in zip(curves, _COLORS, _LINES, strict=False):
        f = design.curve.frequency
        margins = design.curve.margins
        label = f"{design.label}: {margins.phase:.3g}° at {margins.phase_at:.3g} Hz"
        upper.plot(
            f,
            20.0 * np.log10(np.abs(design.curve.L)),
            line,
            color=color,
            linewidth=1.6,
            label=label if margins.stable else f"{design.label}: unstable",
        )
        lower.plot(f, design.curve.phase, line, color=color, linewidth=1.6)
        if math.isfinite(margins.phase_at):
            lower.plot(
                [margins.phase_at] * 2,
                [-180.0, margins.phase - 180.0],
                color=color,
                linewidth=3.0,
                alpha=0.6,
                zorder=4,
            )
    upper.axhline(0.0, color=style.GRAY, linewidth=0.8, zorder=1)
    lower.axhline(-180.0, color=style.GRAY, linewidth=0.8, zorder=1)
    if phase_margin is not None:
        look = style.STROKES[Role.LIMIT]
        lower.axhline(
            phase_margin - 180.0,
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
        )
        upper.plot(
            [],
            [],
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            label=f"required phase margin {phase_margin:.3g}°",
        )
    span = max(float(np.ptp(design.curve.phase)) for design in curves)
    lower.yaxis.set_major_locator(MultipleLocator(45.0 if span < 300.0 else 90.0))
    upper.set_ylabel("magnitude of L [dB]")
    lower.set_ylabel("phase of L [°]")
    _frequency_axis(curves, upper, lower)
    style.legend_above(upper)
    figure.align_ylabels([upper, lower])
    return figure


def sensitivities(curves: Sequence[DesignCurve]) -> Figure:
    """Draw |S| and |T| of the stable loops with the limits that are usually asked for."""
    figure, panels = style.new_figure(4.8, (1.0, 1.0))
    for axes, quantity, limit in ((panels[0], "S", MOST_S), (panels[1], "T", MOST_T)):
        look = style.STROKES[Role.LIMIT]
        axes.axhline(
            20.0 * math.log10(limit),
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            label=f"usual limit {limit:g}",
        )
        axes.axhline(0.0, color=style.GRAY, linewidth=0.6, zorder=1)
        highest, lowest = 20.0 * math.log10(limit), 0.0
        for design, color, line in zip(curves, _COLORS, _LINES, strict=False):
            if not design.curve.margins.stable:
                continue
            size = 20.0 * np.log10(np.abs(getattr(design.curve, quantity)))
            highest, lowest = max(highest, float(size.max())), min(lowest, float(size.min()))
            peak = 10.0 ** (float(size.max()) / 20.0)
            axes.plot(
                design.curve.frequency,
                size,
                line,
                color=color,
                linewidth=1.6,
                label=f"{design.label}: max |{quantity}| {peak:.3g}",
            )
        axes.set_ylim(max(lowest, _LOWEST) - 2.0, highest + 3.0)
        axes.set_ylabel(f"|{quantity}| [dB]")
        style.legend_above(axes)
    _frequency_axis(curves, *panels)
    figure.align_ylabels(panels)
    return figure


def steps(curves: Sequence[DesignCurve], overshoot: float | None) -> Figure:
    """Draw the linear responses to a unit step; the band of settling and the required overshoot.

    Parameters
    ----------
    curves
        See `loop_gains`; unstable loops are left out.
    overshoot
        The required one [%].
    """
    figure, (axes,) = style.new_figure(3.2)
    axes.axhspan(0.98, 1.02, color=style.SHADE, zorder=0.5, label="settled: within 2 %")
    stable = [design for design in curves if design.curve.margins.stable]
    end = max((design.span for design in stable), default=1.0)
    for design, color, line in zip(curves, _COLORS, _LINES, strict=False):
        if design.curve.margins.stable:
            time = np.append(design.time, max(end, design.time[-1]))
            axes.plot(
                time,
                np.append(design.step, design.step[-1]),
                line,
                color=color,
                linewidth=1.6,
                label=design.label,
            )
    if overshoot is not None:
        look = style.STROKES[Role.LIMIT]
        axes.axhline(
            1.0 + 0.01 * overshoot,
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            label=f"required overshoot {overshoot:.3g} %",
        )
    axes.set_xlim(0.0, end)
    axes.set_xlabel(style.axis_label("time", "s"))
    axes.set_ylabel("output over step [-]")
    style.legend_above(axes)
    return figure


def _frequency_axis(curves: Sequence[DesignCurve], upper: Axes, lower: Axes) -> None:
    upper.set_xscale("log")
    upper.set_xlim(curves[0].curve.frequency[0], curves[0].curve.frequency[-1])
    lower.xaxis.set_major_formatter(lambda hertz, _: f"{hertz:g}")
    lower.xaxis.set_minor_formatter(NullFormatter())
    lower.set_xlabel(style.axis_label("frequency", "Hz"))
