"""Figures of a loop: Bode plot, Nyquist plot, Nichols chart, sensitivities, and its design."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.ticker import MultipleLocator, NullFormatter

from bywire.analysis.margins import Family, LoopCurve, LoopMargins, disk
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.panels import Role
from bywire.report.style import legend_outside, value_color, value_scale
from bywire.report.wording import amount

_Points = Callable[[LoopCurve], tuple[Array, Array]]


def _draw_family(
    axes: Axes, family: Family, points: _Points, *, stable_only: bool = False, label: str = ""
) -> None:
    """Draw one line per curve: unstable loops dashed, the worst curve on top with its value.

    Parameters
    ----------
    axes
        Axes for the lines.
    family
        Curves.
    points
        Abscissa and ordinate of a curve.
    stable_only
        Whether to leave out unstable loops, for which some quantities have no meaning.
    label
        Legend of a single curve.
    """
    for k, curve in enumerate(family.curves):
        stable = curve.margins.stable
        if stable_only and not stable:
            continue
        top = k == family.worst
        color = (
            style.BLUE
            if not family.name
            else style.VERMILLION
            if top
            else value_color(family.values, k)
        )
        axes.plot(
            *points(curve),
            color=color,
            linestyle="-" if stable else "--",
            linewidth=1.8 if top else 0.9,
            zorder=3.5 if top else 3.0,
            label=_name(family, label) if top else "_",
        )


def _value_bar(figure: Figure, panels: list[Axes], family: Family) -> None:
    """Add the scale of the varied parameter next to the panels, except for a single curve."""
    if family.name and len(family.curves) >= 2:
        value_scale(figure, panels, family.name, family.unit, family.values)


def _name(family: Family, label: str) -> str:
    curve = family.curves[family.worst]
    state = "" if curve.margins.stable else "unstable"
    if not family.name:
        return style.plain(f"{label}, {state}" if state else label)
    value = amount(family.values[family.worst], family.unit, 3)
    return style.plain(f"worst: {family.name} = {value}" + (f", {state}" if state else ""))


# --- Bode plot with margins


def loop_gain(family: Family) -> Figure:
    """Draw magnitude and phase of the loop gain, with the worst curve's margins as bars."""
    figure, (upper, lower) = style.new_figure(5.0, (1.0, 1.0))
    _draw_family(upper, family, _magnitude, label="loop gain L")
    _draw_family(lower, family, _phase)
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
    _value_bar(figure, [upper, lower], family)
    style.legend_above(upper)
    figure.align_ylabels([upper, lower])
    return figure


def _spans(upper: Axes, lower: Axes, worst: LoopCurve) -> None:
    """Draw phase margin and gain margin as bars, with their frequencies."""
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
        if at > 0.0:  # the rest is beyond the axis
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


# --- Nyquist plot with the disk that the disk margin keeps free

_LEFT, _RIGHT, _HALF = -3.2, 1.6, 1.9  # visible part of the plane


def nyquist(family: Family) -> Figure:
    """Draw the loop gain in the complex plane near -1.

    The mirror image of negative frequencies is left out. The disk belongs to the worst curve. A
    loop gain that stays outside it tolerates simultaneous changes of gain and phase. Unstable loops
    have no disk.
    """
    figure, (axes,) = style.new_figure(5.2)
    worst = family.curves[family.worst]
    _disk(axes, worst)
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    axes.plot(
        np.cos(turn), np.sin(turn), color=style.GRAY, linewidth=0.7, linestyle=":", label="gain 1"
    )
    _draw_family(axes, family, _in_the_plane, label="loop gain L")
    _mark_on_the_circle(axes, worst)
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
    axes.set_xlim(_LEFT, _RIGHT, auto=True)  # matplotlib would warn about fixed limits
    axes.set_ylim(-_HALF, _HALF, auto=True)
    axes.set_aspect("equal", adjustable="datalim")  # more is visible where there is room
    axes.set_xlabel("real part of L [-]")
    axes.set_ylabel("imaginary part of L [-]")
    _value_bar(figure, [axes], family)
    legend_outside(figure, axes.get_legend_handles_labels()[0], columns=3)
    return figure


def _in_the_plane(curve: LoopCurve) -> tuple[Array, Array]:
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


_MARK: dict[str, Any] = {
    "color": style.BLACK,
    "markersize": 5,
    "zorder": 5,
    "linestyle": "none",
}
"""style of the points that determine the margins"""


def _mark_on_the_circle(axes: Axes, worst: LoopCurve) -> None:
    """Mark the points that determine the phase and gain margins."""
    margins = worst.margins
    if math.isfinite(margins.phase_at):
        angle = math.radians(margins.phase - 180.0)
        axes.plot(
            math.cos(angle),
            math.sin(angle),
            "o",
            **_MARK,
            label=f"phase margin {margins.phase:.3g}° at {margins.phase_at:.3g} Hz",
        )
    for name, mark, factor, at in _gain_margins(margins):
        label = f"{name} {factor:.3g} at {at:.3g} Hz"
        axes.plot(-1.0 / factor, 0.0, mark, label=label, **_MARK)


def _gain_margins(margins: LoopMargins) -> Iterator[tuple[str, str, float, float]]:
    """Yield name, mark, factor and frequency [Hz] of the existing gain margins."""
    both = (
        ("gain margin", "s", margins.gain, margins.gain_at),
        ("lower gain margin", "D", margins.lower_gain, margins.lower_gain_at),
    )
    yield from (each for each in both if 0.0 < each[2] < math.inf)


# --- Nichols chart with contours of the closed loop's magnitude

_CONTOURS = (-20.0, -12.0, -6.0, -3.0, -1.0, 0.0, 1.0, 3.0, 6.0, 12.0)
"""contours of the magnitude of T = L/(1 + L) [dB]"""
_LOW, _HIGH = -40.0, 40.0  # range of gains, dB
_TURN = 90.0  # the ends of the chart are multiples of it, degree
_GRID = 361


def nichols(family: Family) -> Figure:
    """Draw the loop gain versus its phase, with contours of constant magnitude of T.

    The disk margin of the worst curve keeps the area around -180° free: there ``|S - T|`` exceeds
    its maximum on the curve.
    """
    figure, (axes,) = style.new_figure(5.0)
    left, right = _phases(family)
    phase, gain = np.meshgrid(np.linspace(left, right, _GRID), np.linspace(_LOW, _HIGH, _GRID))
    L = 10.0 ** (gain / 20.0) * np.exp(1j * np.radians(phase))
    with np.errstate(divide="ignore", invalid="ignore"):
        T = 20.0 * np.log10(np.abs(L / (1.0 + L)))
        apart = np.abs((1.0 - L) / (1.0 + L))
    lines = axes.contour(
        phase, gain, T, levels=_CONTOURS, colors=style.GRAY, linewidths=0.6, linestyles="-"
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
    _draw_family(axes, family, _in_decibels, label="loop gain L")
    _mark_on_the_chart(axes, worst)
    axes.set_xlim(left, right)
    axes.set_ylim(_LOW, _HIGH)
    axes.xaxis.set_major_locator(MultipleLocator(45.0 if right - left <= 540.0 else 180.0))
    axes.set_xlabel("phase of L [°]")
    axes.set_ylabel("magnitude of L [dB]")
    _value_bar(figure, [axes], family)
    gain_lines = [h for h in axes.get_legend_handles_labels()[0] if isinstance(h, Line2D)]
    style.legend_above(axes, [*gain_lines, *handles])
    return figure


def _phases(family: Family) -> tuple[float, float]:
    """Return the ends of the abscissa, which contain all visible phases, and -180 degrees."""
    shown = [np.array([-225.0, -90.0])]
    for curve in family.curves:
        size = 20.0 * np.log10(np.abs(curve.L))
        shown.append(curve.phase[(size > _LOW) & (size < _HIGH)])
    every = np.concatenate(shown)
    return (
        _TURN * math.floor(float(every.min()) / _TURN),
        _TURN * math.ceil(float(every.max()) / _TURN),
    )


def _in_decibels(curve: LoopCurve) -> tuple[Array, Array]:
    return curve.phase, 20.0 * np.log10(np.abs(curve.L))


def _mark_on_the_chart(axes: Axes, worst: LoopCurve) -> None:
    """Mark -1 and the points that determine the phase and gain margins."""
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
            **_MARK,
            label=f"phase margin {margins.phase:.3g}°",
        )
    for name, mark, factor, frequency in _gain_margins(margins):
        phase = float(np.interp(frequency, worst.frequency, worst.phase))
        at = 360.0 * round((phase - 180.0) / 360.0) + 180.0  # the odd half turn next to it
        axes.plot(
            at,
            -20.0 * math.log10(factor),
            mark,
            **_MARK,
            label=f"{name} {factor:.3g}",
        )


# --- Sensitivity and complementary sensitivity, with their usual limits

MOST_S, MOST_T = 2.0, 1.25
"""usual limits of max |S| and max |T|: S. Skogestad, I. Postlethwaite, "Multivariable Feedback
Control", 2nd ed. 2005, section 2.4.3"""
_LOWEST = -60.0  # visible range, dB


def sensitivity(family: Family) -> Figure:
    """Draw the magnitudes of S and T versus frequency, without unstable loops."""
    figure, panels = style.new_figure(4.8, (1.0, 1.0))
    for axes, quantity, limit in ((panels[0], "S", MOST_S), (panels[1], "T", MOST_T)):
        _panel(axes, family, quantity, limit)
    panels[1].set_xlabel(style.axis_label("frequency", "Hz"))
    panels[1].set_xscale("log")
    panels[1].xaxis.set_major_formatter(lambda hertz, _: f"{hertz:g}")
    panels[1].xaxis.set_minor_formatter(NullFormatter())
    f = family.curves[0].frequency
    panels[1].set_xlim(f[0], f[-1])
    _value_bar(figure, panels, family)
    for axes in panels:
        style.legend_above(axes)
    figure.align_ylabels(panels)
    return figure


def _panel(axes: Axes, family: Family, quantity: str, limit: float) -> None:
    def points(curve: LoopCurve) -> tuple[Array, Array]:
        return curve.frequency, 20.0 * np.log10(np.abs(getattr(curve, quantity)))

    look = style.STROKES[Role.LIMIT]
    axes.axhline(
        20.0 * math.log10(limit),
        color=look.color,
        linestyle=look.linestyle,
        linewidth=look.linewidth,
        label=f"usual limit {limit:g}",
    )
    axes.axhline(0.0, color=style.GRAY, linewidth=0.6, zorder=1)
    _draw_family(axes, family, points, stable_only=True, label=f"|{quantity}|")
    worst = family.curves[family.worst]
    if worst.margins.stable:
        size = np.abs(getattr(worst, quantity))
        k = int(np.argmax(size))
        axes.plot(
            worst.frequency[k],
            20.0 * math.log10(size[k]),
            "o",
            **_MARK,
            label=f"max |{quantity}| {size[k]:.3g}",
        )
    lowest = min((float(points(c)[1].min()) for c in family.curves), default=0.0)
    highest = max(
        (float(points(c)[1].max()) for c in family.curves if c.margins.stable), default=0.0
    )
    axes.set_ylim(max(lowest, _LOWEST) - 2.0, max(highest, 20.0 * math.log10(limit)) + 3.0)
    axes.set_ylabel(f"|{quantity}| [dB]")


# --- A loop before and after its design

_COLORS = (style.GRAY, style.BLUE, style.VERMILLION)
_LINES = ("--", "-", "-.")


@dataclass(frozen=True, eq=False)
class DesignCurve:
    """A set of gains on the nominal linear model.

    Parameters
    ----------
    label
        Label in the legend.
    curve
        Its loop gain.
    time, step
        Response of the closed loop to a unit step [s, 1], shape (n,) each; constant afterwards.
    span
        Displayed duration [s].
    """

    label: str
    curve: LoopCurve
    time: Array
    step: Array
    span: float


def loop_gains(curves: Sequence[DesignCurve], phase_margin: float | None) -> Figure:
    """Draw magnitude and phase of the loop gains, with the phase margin as a vertical bar.

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
    """Draw |S| and |T| of the stable loops with the usual limits."""
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
    """Draw the linear responses to a unit step, the settling band and the required overshoot.

    Parameters
    ----------
    curves
        See `loop_gains`; unstable loops are left out.
    overshoot
        The required value [%].
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
    axes.set_ylabel("output relative to step [-]")
    style.legend_above(axes)
    return figure


def _frequency_axis(curves: Sequence[DesignCurve], upper: Axes, lower: Axes) -> None:
    upper.set_xscale("log")
    upper.set_xlim(curves[0].curve.frequency[0], curves[0].curve.frequency[-1])
    lower.xaxis.set_major_formatter(lambda hertz, _: f"{hertz:g}")
    lower.xaxis.set_minor_formatter(NullFormatter())
    lower.set_xlabel(style.axis_label("frequency", "Hz"))
