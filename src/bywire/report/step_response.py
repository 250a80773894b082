"""Figures: a variable and its set point, with the criteria of a step response."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np

from bywire.bench.experiment import Experiment
from bywire.bench.kpis.samples import smoothed
from bywire.bench.requirements import Verdict
from bywire.core.errors import ParameterError
from bywire.core.units import convert
from bywire.report import style
from bywire.report.channel import Channel, axis_unit, channel, decimate
from bywire.report.panels import Role
from bywire.report.stated_levels import draw_stated
from bywire.report.wording import amount

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bywire.bench.stated import StatedLevel, StatedRange


@dataclass(frozen=True)
class StepLimits:
    """A step of the set point and its limits; levels in SI.

    Parameters
    ----------
    start
        Time of the step [s].
    before, after
        Set point before and after it.
    band
        Half width of the tolerance band, relative to the step.
    overshoot
        Maximum overshoot relative to the step; ``None`` for no limit.
    """

    start: float
    before: float
    after: float
    band: float = 0.02
    overshoot: float | None = None

    def __post_init__(self) -> None:
        if self.before == self.after:
            raise ParameterError(
                f"StepLimits: before and after are both {self.after:g}. They must differ",
                name="after",
                value=f"{self.after:g}",
            )

    def level(self, share: float) -> float:
        """Return the level at a fraction of the step: 0 before it, 1 after it."""
        return self.before + share * (self.after - self.before)


@dataclass(frozen=True)
class StepFacts:
    """Computed figures of a step response; ``None`` for figures that were not computed.

    Parameters
    ----------
    rise_time
        From ``rise_from`` to ``rise_to`` [s].
    settling_time
        From the step until the response stays in the band [s].
    overshoot
        Relative to the step.
    rise_from, rise_to
        Fractions of the step between which the rise is measured.
    """

    rise_time: float | None = None
    settling_time: float | None = None
    overshoot: float | None = None
    rise_from: float = 0.1
    rise_to: float = 0.9


def step_limits(
    definition: Experiment, options: Any, verdicts: Sequence[Verdict] = ()
) -> tuple[str, StepLimits] | None:
    """Return the signal of a step and its criteria; None for an experiment without a step.

    Parameters
    ----------
    definition, options
        The experiment and its options.
    verdicts
        Requirements. The figure shows a requirement on the overshoot.
    """
    setting = None if definition.step is None else definition.step(options)
    if setting is None or setting.start is None or setting.end is None:
        return None
    if setting.start == setting.end:
        return None
    limits = [v.required.bound for v in verdicts if v.kpi == "overshoot"]
    overshoot = limits[0] / 100.0 if limits else None
    return setting.signal, StepLimits(
        setting.t_step, setting.start, setting.end, overshoot=overshoot
    )


def draw_limits(axes: Axes, limits: StepLimits, shown: Channel) -> None:
    """Draw tolerance band and overshoot limit, from the step to the end of the recording.

    ``axes``: axes in the display unit of ``shown``; ``limits``: the step; ``shown``: the judged
    channel.
    """
    scale, _ = style.time_scale(shown.time)
    span = [scale * limits.start, scale * float(shown.time[-1])]
    low, high = (
        convert(limits.level(1.0 + side * limits.band), shown.symbol, shown.unit)
        for side in (-1.0, 1.0)
    )
    axes.fill_between(
        span,
        min(low, high),
        max(low, high),
        color=style.GREEN,
        alpha=0.25,
        linewidth=0,
        zorder=1.5,
        label=f"±{100 * limits.band:g} % band",
    )
    if limits.overshoot is not None:
        level = convert(limits.level(1.0 + limits.overshoot), shown.symbol, shown.unit)
        look = style.STROKES[Role.LIMIT]
        axes.plot(
            span,
            [level, level],
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            zorder=look.zorder,
            label=f"overshoot limit {100 * limits.overshoot:g} %",
        )


# --- The response to a step


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
        Judged variable and its set point (``None`` for no line).
    limits
        The step; without it neither limits nor facts are drawn.
    facts
        KPI values to mark. They are drawn and not computed here.
    measured
        Recording to compare with.
    smoothing
        Averaging time [s] of the judged curve. The judged curve is then thin, with the marks on it
        and the pale raw curve behind it. 0 if the raw curve was judged.
    stated
        Levels and ranges stated by a source; those of the variable are drawn.
    """
    others = () if measured is None else (measured,)
    unit = axis_unit((recording, *others), variable, *filter(None, (set_point,)))
    shown = channel(recording, variable, unit)
    figure, (axes,) = style.new_figure(3.3)
    for other in others:
        style.draw_channel(axes, channel(other, variable, unit), Role.MEASURED, ", measured")
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
            label=f"averaged over {amount(smoothing, 's', 3)}",
        )
    if set_point is not None:
        style.draw_channel(axes, channel(recording, set_point, unit), Role.SET_POINT)
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
    """Mark rise, overshoot and settling; the legend has their values, clear of the data."""
    scale, _ = style.time_scale(shown.time)
    if _given(facts.rise_time):
        shares = (facts.rise_from, facts.rise_to)
        levels = [convert(limits.level(share), shown.symbol, shown.unit) for share in shares]
        times = [scale * _first_crossing(shown, limits, level) for level in levels]
        label = (
            f"rise {100 * shares[0]:g} to {100 * shares[1]:g} %: {amount(facts.rise_time, 's', 3)}"
        )
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
            label=f"settling ({100 * limits.band:g} %): {amount(facts.settling_time, 's', 3)}",
        )


def _given(value: float | None) -> TypeGuard[float]:
    return value is not None and math.isfinite(value)


def _after_step(shown: Channel, limits: StepLimits) -> int:
    return int(np.searchsorted(shown.time, limits.start))


def _first_crossing(shown: Channel, limits: StepLimits, level: float) -> float:
    """Return when the response first reaches a level; NaN if it never does."""
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


# --- A variable that tracks a moving set point


def tracking(recording: xr.Dataset, variable: str, set_point: str) -> Figure:
    """Draw a variable with its set point, and the error between them below.

    ``recording``: recording to draw; ``variable``, ``set_point``: two variables of the same unit.

    Raises
    ------
    ParameterError
        When the units differ.
    """
    shown, wanted = channel(recording, variable), channel(recording, set_point)
    if shown.unit != wanted.unit:
        raise ParameterError(
            f"{variable} is in {shown.unit} but {set_point} in {wanted.unit}. Choose a set point "
            f"of {variable}",
            name=set_point,
            value=wanted.unit,
            valid=shown.unit,
        )
    unit = axis_unit([recording], variable, set_point)
    shown, wanted = (channel(recording, name, unit) for name in (variable, set_point))
    error = replace(shown, label="set point minus value", values=wanted.values - shown.values)
    figure, (upper, lower) = style.new_figure(4.6, (2.0, 1.0))
    style.draw_channel(upper, shown, Role.MAIN)
    style.draw_channel(upper, wanted, Role.SET_POINT)
    style.draw_channel(lower, error, Role.MAIN)
    lower.axhline(0.0, color=style.GRAY, linewidth=0.6, zorder=1)
    upper.margins(x=0.0)
    upper.set_ylabel(style.channel_label(shown))
    lower.set_ylabel(style.unit_label("error", unit))
    lower.set_xlabel(f"time [{style.time_scale(shown.time)[1]}]")
    style.legend_above(upper)
    style.legend_above(lower)
    figure.align_ylabels([upper, lower])
    return figure
