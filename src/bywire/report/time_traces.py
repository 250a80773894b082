"""Figure: what a recording did over time, in panels one above the other."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bywire.core.errors import ParameterError
from bywire.core.units import convert
from bywire.report import style
from bywire.report.channel import Channel, channel
from bywire.report.decimation import lasting_phases, phases
from bywire.report.panels import Panel, Role, Trace, declared_panels, panels_by_unit
from bywire.report.stated_levels import draw_stated
from bywire.report.step_response import StepLimits, draw_limits

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bywire.bench.stated import StatedLevel, StatedRange
    from bywire.report.panels import Panel
    from bywire.report.style import Color

FAULTS = "faults"
"""variable that counts the faults that are there: a bar along the lower edge shows them"""
_HEIGHT = 0.04  # of a bar, in heights of a panel


def mark_saturation(axes: Axes, panel: Panel, recording: xr.Dataset) -> None:
    """Draw a bar along the upper edge while a panel's quantity is saturated."""
    spans = _scaled(recording, panel.saturation) if panel.saturation is not None else []
    if spans:
        axes.broken_barh(
            spans,
            (1.0 - _HEIGHT, _HEIGHT),
            transform=axes.get_xaxis_transform(),
            facecolor=style.VERMILLION,
            edgecolor=style.VERMILLION,
            linewidth=0.8,
            zorder=2.0,
            label=panel.saturated,
        )


def mark_faults(axes: Axes, recording: xr.Dataset, *, named: bool) -> None:
    """Draw a bar along the lower edge while a fault is there; ``named``: with a label."""
    if spans := _scaled(recording, FAULTS):
        _draw_fault(axes, spans, 0.0, style.PURPLE, "fault" if named else None)


def mark_faults_of(
    axes: Axes, recordings: Sequence[xr.Dataset], colors: Sequence[str | Color], factor: float
) -> list[Artist]:
    """Draw the same of several recordings: once where their faults are there at the same times.

    Parameters
    ----------
    axes
        Panel over time.
    recordings, colors
        The recordings, and the color of each, in which its own bar is drawn where they differ.
    factor
        Of the time axis.

    Returns
    -------
    list
        The entry of a legend; none without a fault.
    """
    from matplotlib.patches import Patch

    each = [
        [(factor * start, factor * length) for start, length in _spans(recording, FAULTS)]
        for recording in recordings
    ]
    if not any(each):
        return []
    if all(spans == each[0] for spans in each):
        _draw_fault(axes, each[0], 0.0, style.PURPLE, None)
        return [Patch(color=style.PURPLE, label="fault")]
    drawn = [(spans, color) for spans, color in zip(each, colors, strict=True) if spans]
    for k, (spans, color) in enumerate(drawn):
        _draw_fault(axes, spans, k * _HEIGHT, color, None)
    return [Patch(color=style.GRAY, label="fault")]


def _draw_fault(
    axes: Axes, spans: list[tuple[float, float]], low: float, color: str | Color, label: str | None
) -> None:
    axes.broken_barh(
        spans,
        (low, _HEIGHT),
        transform=axes.get_xaxis_transform(),
        facecolor=color,
        edgecolor=color,
        linewidth=0.8,
        zorder=2.0,
        label=label,
    )


def _scaled(recording: xr.Dataset, variable: str) -> list[tuple[float, float]]:
    """Return the spans in which a mode variable is 1, on the time axis of its recording."""
    if variable not in recording.data_vars:
        return []
    scale, _ = style.time_scale(channel(recording, variable).time)
    return [(scale * start, scale * length) for start, length in _spans(recording, variable)]


def _spans(recording: xr.Dataset, variable: str) -> list[tuple[float, float]]:
    """Return starts and lengths [s] of the spans in which a mode variable is 1."""
    if variable not in recording.data_vars:
        return []
    mode = channel(recording, variable)
    return [(start, end - start) for start, end in phases(mode.time, mode.values > 0.5)]


# --- Traces

NEAR = 0.5
"""share of a limit from which its lines are drawn"""
_LASTING = 0.9  # share of a phase above which its short breaks do not count


def time_traces(
    recording: xr.Dataset,
    *,
    panels: Sequence[Panel] | None = None,
    limits: StepLimits | None = None,
    measured: xr.Dataset | None = None,
    stuck: str = "stuck",
    stated: Sequence[StatedLevel | StatedRange] = (),
) -> Figure:
    """Draw panels of variables over a shared time axis.

    Phases in which all that has dry friction sticks are shaded, more faintly those in which it does
    so again and again, as under dither; saturation is a bar along the
    upper edge.

    Parameters
    ----------
    recording
        Recording to draw.
    panels
        What to draw; by default those that the recording's brake or rig declares (of several, the
        ones that the recording shows most of), else its signals by their units. Those without any
        variable in the recording are left out, and those that stay at zero unless all do.
    limits
        Step by which the first trace of the first panel is judged: its band and limit are drawn.
    measured
        Recording to compare with, for instance of a test rig, with the names and units of
        ``recording``; it may lack variables, and may have samples of its own. It is solid blue,
        ``recording`` dashed red on top. Of every panel then only the first trace and the set
        points are drawn.
    stuck
        Variable that is 1 while shafts and pistons stick.
    stated
        Levels and ranges that a source states; each is drawn in the first panel that shows its
        signal.

    Raises
    ------
    ParameterError
        When the recording has none of the variables, or a panel mixes units.
    """
    present = shown_panels(recording) if panels is None else drawable(recording, panels)
    if not present:
        wanted = ", ".join(trace.variable for panel in panels or () for trace in panel.traces)
        raise ParameterError(
            f"the recording has none of the variables {wanted}"
            if wanted
            else "the recording has none of the variables that time traces show: energies and "
            "modes alone have no panel"
        )
    left = list(stated)
    heights = [panel.height for panel, _ in present]
    figure, rows = style.new_figure(0.5 + 1.15 * sum(heights), heights)
    for axes, (panel, traces) in zip(rows, present, strict=True):
        first = _draw_traces(axes, panel, traces, recording, measured)
        if axes is rows[0] and limits is not None:
            draw_limits(axes, limits, first)
        _shade_stuck(axes, recording, stuck, named=axes is rows[0])
        mark_saturation(axes, panel, recording)
        mark_faults(axes, recording, named=axes is rows[0])
        _mark_limit(axes, panel, recording, first)
        here = [each for each in left if each.signal in {trace.variable for trace in traces}]
        draw_stated(axes, here, first)
        left = [each for each in left if each not in here]
        axes.margins(x=0.0)
        set_ticks(axes, panel, first)
        if not panel.levels:  # a mode's ticks say all that its legend would
            style.legend_above(axes)
    _, unit = style.time_scale(first.time)
    rows[-1].set_xlabel(f"time [{unit}]")
    figure.align_ylabels(rows)
    return figure


def shown_panels(recording: xr.Dataset) -> list[tuple[Panel, list[Trace]]]:
    """Return the declared panels of which the recording shows most, or those by unit."""
    known = [drawable(recording, each.panels) for each in declared_panels(recording)]
    most = max(known, key=len, default=[])
    return most or drawable(recording, panels_by_unit(recording))


def drawable(recording: xr.Dataset, panels: Sequence[Panel]) -> list[tuple[Panel, list[Trace]]]:
    """Return the panels that show something, with their traces."""
    present = [(panel, _present(panel, recording)) for panel in panels]
    present = [(panel, traces) for panel, traces in present if traces]
    moving = [
        (panel, traces)
        for panel, traces in present
        if any(_moves(recording[trace.variable]) for trace in traces)
    ]
    return moving or present


def _moves(variable: xr.DataArray) -> bool:
    """Return whether a signal is ever anything but 0, or a temperature but its first."""
    values = variable.values
    is_temperature = variable.attrs.get("units") == "K"
    return bool(np.any(values != (values[:1] if is_temperature else 0.0)))


def _present(panel: Panel, recording: xr.Dataset) -> list[Trace]:
    """Return the traces worth drawing; a set point that is always 0 was never used."""
    traces = [trace for trace in panel.traces if trace.variable in recording.data_vars]
    return [
        trace
        for trace in traces
        if trace.role is not Role.SET_POINT or bool(np.any(recording[trace.variable].values))
    ]


def _draw_traces(
    axes: Axes,
    panel: Panel,
    traces: Sequence[Trace],
    recording: xr.Dataset,
    measured: xr.Dataset | None,
) -> Channel:
    """Draw the lines of a panel and label its ordinate; return the first channel."""
    channels = [channel(recording, trace.variable) for trace in traces]
    first = channels[0]
    for trace, shown in zip(traces, channels, strict=True):
        if shown.unit != first.unit:
            raise ParameterError(
                f"panel {panel.quantity!r}: {shown.name} is in {shown.unit}, {first.name} in "
                f"{first.unit}; put them into two panels"
            )
        if measured is None or trace.role is Role.SET_POINT:
            style.draw_channel(axes, shown, trace.role)
        elif shown is first:
            if trace.variable in measured.data_vars:
                style.draw_channel(
                    axes, channel(measured, trace.variable), Role.MEASURED, ", measured"
                )
            style.draw_channel(axes, shown, Role.SIMULATED, ", simulated")
    axes.set_ylabel(style.axis_label(panel.quantity, first.symbol, "\n"))
    return first


def _shade_stuck(axes: Axes, recording: xr.Dataset, variable: str, *, named: bool) -> None:
    if variable not in recording.data_vars:
        return
    mode = channel(recording, variable)
    scale, _ = style.time_scale(mode.time)
    for is_lasting in (True, False):
        found = [
            each
            for each in lasting_phases(mode.time, mode.values > 0.5)
            if (each.share > _LASTING) == is_lasting
        ]
        if not found:
            continue
        label = style.plain(mode.label)
        if not is_lasting:
            lasting = sum(each.share * (each.end - each.start) for each in found)
            share = lasting / sum(each.end - each.start for each in found)
            label += f" again and again, {100 * share:.2g} % of the shade"
        axes.broken_barh(
            [(scale * each.start, scale * (each.end - each.start)) for each in found],
            (0.0, 1.0),
            transform=axes.get_xaxis_transform(),
            zorder=0.4,
            linewidth=0,
            facecolor=style.SHADE if is_lasting else style.SHADE_AGAIN,
            alpha=0.7,
            label=label if named else None,
        )


def _mark_limit(axes: Axes, panel: Panel, recording: xr.Dataset, first: Channel) -> None:
    """Draw the limits of a panel's first trace where it comes near; far away they say nothing."""
    level = limit_of(recording, panel)
    if level is None:
        return
    level = convert(level, first.symbol, first.unit)
    look = style.STROKES[Role.LIMIT]
    sides = [s for s in (1.0, -1.0) if float(np.nanmax(s * first.values)) >= NEAR * level]
    for k, side in enumerate(sides):
        axes.axhline(
            side * level,
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            zorder=look.zorder,
            label="limit" if k == 0 else None,
        )


def limit_of(recording: xr.Dataset, panel: Panel) -> float | None:
    """Return the limit [SI] of a panel's first trace; None where the recording says none."""
    if panel.limit is None:
        return None
    value = json.loads(str(recording.attrs.get("parameters", "{}")))
    for name in panel.limit.split("."):
        value = value.get(name) if isinstance(value, dict) else None
    return float(value) if isinstance(value, (int, float)) else None


def set_ticks(axes: Axes, panel: Panel, first: Channel) -> None:
    """Set the ticks of an ordinate: few numbers, or the names of a mode."""
    if not panel.levels:
        style.few_ticks(axes, 5 if panel.height < 1.5 else 7)
        return
    axes.set_yticks(range(len(panel.levels)), panel.levels)
    axes.set_ylim(-0.3, len(panel.levels) - 0.7)
    axes.set_ylabel(panel.quantity)
