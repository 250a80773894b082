"""Figure: the response to a step of the set point, with what it is judged by."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeGuard

import numpy as np

from bywire.bench.kpis.smoothing import smoothed
from bywire.core.units import convert
from bywire.report import style
from bywire.report.channel import Channel, channel
from bywire.report.decimation import decimate
from bywire.report.line_role import Role
from bywire.report.stated_levels import draw_stated
from bywire.report.step_marks import StepFacts, StepLimits, draw_limits
from bywire.report.wording import duration

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bywire.bench.stated import StatedLevel, StatedRange


def step_response(
    recording: xr.Dataset,
    variable: str,
    set_point: str | None = None,
    *,
    limits: StepLimits | None = None,
    facts: StepFacts | None = None,
    measured: xr.Dataset | None = None,
    smoothing: float = 0.0,
    stated: Sequence[StatedLevel | StatedRange] = (),
) -> Figure:
    """Draw one variable with its set point, tolerance band, overshoot limit, rise and settling.

    Parameters
    ----------
    recording
        Recording to draw.
    variable, set_point
        What is judged, and by which set point (``None`` for no line).
    limits
        The step; without it neither limits nor facts are drawn.
    facts
        KPI values to mark. They are drawn, never computed here.
    measured
        Recording to compare with.
    smoothing
        Averaging time [s] of the curve that was judged; that curve is then drawn thin, the raw
        one pale behind it, and the marks sit on it. 0 where the curve itself was judged.
    stated
        Levels and ranges that a source states; those of the variable are drawn.
    """
    shown = channel(recording, variable)
    figure, (axes,) = style.new_figure(3.3)
    if measured is not None:
        style.draw_channel(axes, channel(measured, variable), Role.MEASURED, ", measured")
    compared = measured is not None
    role, suffix = (Role.SIMULATED, ", simulated") if compared else (Role.MAIN, "")
    opacity = style.PALE_OPACITY if smoothing > 0 else 1.0
    style.draw_channel(axes, shown, role, suffix, opacity)
    judged = shown
    if smoothing > 0:
        judged = replace(shown, values=smoothed(shown.time, shown.values, smoothing))
        scale, _ = style.time_scale(shown.time)
        axes.plot(
            *decimate(scale * judged.time, judged.values),
            linewidth=0.9,
            zorder=3.3,
            color=style.STROKES[role].color,
            label=f"averaged over {duration(smoothing)}",
        )
    if set_point is not None:
        style.draw_channel(axes, channel(recording, set_point), Role.SET_POINT)
    if limits is not None:
        draw_limits(axes, limits, shown)
    if limits is not None and facts is not None:
        _mark_facts(axes, judged, limits, facts)
    draw_stated(axes, [each for each in stated if each.signal == variable], shown)
    axes.margins(x=0.0)
    axes.set_xlabel(f"time [{style.time_scale(shown.time)[1]}]")
    axes.set_ylabel(style.channel_label(shown))
    style.legend_above(axes)
    return figure


def _mark_facts(axes: Axes, shown: Channel, limits: StepLimits, facts: StepFacts) -> None:
    """Mark rise, overshoot and settling; their values stand in the legend, clear of the data."""
    scale, _ = style.time_scale(shown.time)
    if _given(facts.rise_time):
        shares = (facts.rise_from, facts.rise_to)
        levels = [convert(limits.level(share), shown.symbol, shown.unit) for share in shares]
        times = [scale * _first_crossing(shown, limits, level) for level in levels]
        label = f"rise {100 * shares[0]:g} to {100 * shares[1]:g} %: {duration(facts.rise_time)}"
        axes.plot(times, levels, "o", color=style.BLACK, markersize=4.5, zorder=4, label=label)
    if _given(facts.overshoot):
        time, peak = _peak(shown, limits)
        label = f"overshoot: {100 * facts.overshoot:.3g} %"
        marker = "v" if limits.after > limits.before else "^"
        point = ([scale * time], [peak]) if facts.overshoot > 0 else ([], [])
        axes.plot(
            *point,
            marker,
            color=style.VERMILLION,
            markersize=5.5,
            zorder=4,
            linestyle="none",
            label=label,
        )
    if _given(facts.settling_time):
        settled = scale * (limits.start + facts.settling_time)
        axes.axvline(
            settled,
            color=style.GREEN,
            linestyle="-.",
            linewidth=1.2,
            zorder=2.4,
            label=f"settling ({100 * limits.band:g} %): {duration(facts.settling_time)}",
        )


def _given(value: float | None) -> TypeGuard[float]:
    return value is not None and math.isfinite(value)


def _after_step(shown: Channel, limits: StepLimits) -> int:
    return int(np.searchsorted(shown.time, limits.start))


def _first_crossing(shown: Channel, limits: StepLimits, level: float) -> float:
    """Return when the response first reaches a level; NaN where it never does."""
    begin = _after_step(shown, limits)
    rising = limits.after > limits.before
    values = shown.values[begin:]
    reached = np.flatnonzero(values >= level if rising else values <= level)
    if len(reached) == 0:
        return float("nan")
    k = begin + int(reached[0])
    if k == 0 or shown.values[k] == shown.values[k - 1]:
        return float(shown.time[k])
    before, step = shown.values[k - 1], shown.values[k] - shown.values[k - 1]
    share = min(max(float((level - before) / step), 0.0), 1.0)
    return float(shown.time[k - 1] + share * (shown.time[k] - shown.time[k - 1]))


def _peak(shown: Channel, limits: StepLimits) -> tuple[float, float]:
    begin = _after_step(shown, limits)
    values = shown.values[begin:]
    if len(values) == 0 or bool(np.all(np.isnan(values))):
        return float("nan"), float("nan")
    rising = limits.after > limits.before
    k = begin + int(np.nanargmax(values) if rising else np.nanargmin(values))
    return float(shown.time[k]), float(shown.values[k])
