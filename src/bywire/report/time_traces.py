"""Figures of recordings over time: panels, overlaid recordings, differences."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.core.errors import ParameterError
from bywire.core.units import convert, difference_unit
from bywire.report import style
from bywire.report.channel import Channel, axis_unit, channel, decimate, lasting_phases, phases
from bywire.report.panels import Panel, Role, Trace, declared_panels, panels_by_unit
from bywire.report.stated_levels import draw_stated
from bywire.report.step_response import StepLimits, draw_limits
from bywire.report.style import Color, inside, value_color, value_scale
from bywire.report.wording import amount

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from bywire.bench.stated import StatedLevel, StatedRange
    from bywire.report.panels import Panel
    from bywire.report.style import Color

FAULTS = "faults"
"""variable that counts the active faults: a bar along the lower edge shows them"""
_HEIGHT = 0.04  # height of a bar, relative to the panel


def _mark_saturation(axes: Axes, panel: Panel, recording: xr.Dataset) -> None:
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


def _mark_faults(axes: Axes, recording: xr.Dataset, *, named: bool) -> None:
    """Draw a bar along the lower edge while a fault is present; ``named``: with a label."""
    if spans := _scaled(recording, FAULTS):
        _draw_fault(axes, spans, 0.0, style.PURPLE, "fault" if named else None)


def _mark_faults_of(
    axes: Axes, recordings: Sequence[xr.Dataset], colors: Sequence[str | Color], factor: float
) -> list[Artist]:
    """Draw the fault bars of several recordings: a common bar if their times are equal.

    Parameters
    ----------
    axes
        Panel over time.
    recordings, colors
        The recordings, and the color of each, used for its own bar if the times differ.
    factor
        Factor of the time axis.

    Returns
    -------
    list
        Entry of the legend; empty without a fault.
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

_NEAR = 0.5
"""fraction of a limit above which its lines are drawn"""
_LASTING = 0.9  # fraction of a phase above which short breaks are ignored


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

    Phases in which all friction elements are stuck are shaded. Phases with repeated sticking, as
    with dither, are shaded lightly. Saturation is a bar along the upper edge.

    Parameters
    ----------
    recording
        Recording to draw.
    panels
        Panels to draw. Default: the panels that the recording's brake or rig declares (of several,
        those with the most variables of the recording), else its signals by unit. Panels without
        any variable are left out, as are panels that stay at zero, unless all do.
    limits
        Step that judges the first trace of the first panel: its band and limit are drawn.
    measured
        Recording for comparison, for example of a test rig, with the names and units of
        ``recording``; it may lack variables, and have other sample times. It is solid blue,
        with ``recording`` in dashed red on top. Then only the first trace and the set points of
        every panel are drawn.
    stuck
        Variable that is 1 while shafts and pistons stick.
    stated
        Levels and ranges stated by a source; each is drawn in the first panel with its signal.

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
            else "the recording has none of the variables that time traces show. Energies and "
            "modes have no panel"
        )
    left = list(stated)
    heights = [panel.height for panel, _ in present]
    figure, rows = style.new_figure(0.5 + 1.15 * sum(heights), heights)
    for axes, (panel, traces) in zip(rows, present, strict=True):
        first = _draw_traces(axes, panel, traces, recording, measured)
        if axes is rows[0] and limits is not None:
            draw_limits(axes, limits, first)
        _shade_stuck(axes, recording, stuck, named=axes is rows[0])
        _mark_saturation(axes, panel, recording)
        _mark_faults(axes, recording, named=axes is rows[0])
        _mark_limit(axes, panel, recording, first)
        here = [each for each in left if each.signal in {trace.variable for trace in traces}]
        draw_stated(axes, here, first)
        left = [each for each in left if each not in here]
        axes.margins(x=0.0)
        _set_ticks(axes, panel, first)
        if not panel.levels:  # a mode's ticks replace its legend
            style.legend_above(axes)
    _, unit = style.time_scale(first.time)
    rows[-1].set_xlabel(f"time [{unit}]")
    figure.align_ylabels(rows)
    return figure


def shown_panels(recording: xr.Dataset) -> list[tuple[Panel, list[Trace]]]:
    """Return the declared panels with most variables of the recording, or those by unit."""
    known = [drawable(recording, each.panels) for each in declared_panels(recording)]
    most = max(known, key=len, default=[])
    return most or drawable(recording, panels_by_unit(recording))


def drawable(recording: xr.Dataset, panels: Sequence[Panel]) -> list[tuple[Panel, list[Trace]]]:
    """Return the panels with visible traces."""
    present = [(panel, _present(panel, recording)) for panel in panels]
    present = [(panel, traces) for panel, traces in present if traces]
    moving = [
        (panel, traces)
        for panel, traces in present
        if any(_moves(recording[trace.variable]) for trace in traces)
    ]
    return moving or present


def _moves(variable: xr.DataArray) -> bool:
    """Return whether a signal is ever different from 0, or a temperature from its first value."""
    values = variable.values
    is_temperature = variable.attrs.get("units") == "K"
    return bool(np.any(values != (values[:1] if is_temperature else 0.0)))


def _present(panel: Panel, recording: xr.Dataset) -> list[Trace]:
    """Return the visible traces; a set point that is always 0 was never used."""
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
    names = [trace.variable for trace in traces]
    unit = axis_unit([recording] if measured is None else [recording, measured], *names)
    _require_one_unit(panel, recording, names)
    channels = [channel(recording, name, unit) for name in names]
    first = channels[0]
    for trace, shown in zip(traces, channels, strict=True):
        if measured is None or trace.role is Role.SET_POINT:
            style.draw_channel(axes, shown, trace.role)
        elif shown is first:
            if trace.variable in measured.data_vars:
                style.draw_channel(
                    axes, channel(measured, trace.variable, unit), Role.MEASURED, ", measured"
                )
            style.draw_channel(axes, shown, Role.SIMULATED, ", simulated")
    axes.set_ylabel(style.unit_label(panel.quantity, unit, "\n"))
    return first


def _require_one_unit(panel: Panel, recording: xr.Dataset, names: Sequence[str]) -> None:
    """Reject a panel whose variables have different units."""
    first, *others = [channel(recording, name) for name in names]
    for other in others:
        if other.unit != first.unit:
            raise ParameterError(
                f"panel {panel.quantity!r}: {other.name} is in {other.unit}, {first.name} in "
                f"{first.unit}. Put them in two panels",
                name=other.name,
                value=other.unit,
                valid=first.unit,
            )


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
            label += f" repeatedly, {100 * share:.2g} % of the shaded time"
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
    """Draw the limits of a panel's first trace if it comes near; distant limits are left out."""
    level = _limit_of(recording, panel)
    if level is None:
        return
    level = convert(level, first.symbol, first.unit)
    look = style.STROKES[Role.LIMIT]
    sides = [s for s in (1.0, -1.0) if float(np.nanmax(s * first.values)) >= _NEAR * level]
    for k, side in enumerate(sides):
        axes.axhline(
            side * level,
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            zorder=look.zorder,
            label="limit" if k == 0 else None,
        )


def _limit_of(recording: xr.Dataset, panel: Panel) -> float | None:
    """Return the limit [SI] of a panel's first trace; None if the recording has none."""
    if panel.limit is None:
        return None
    value = json.loads(str(recording.attrs.get("parameters", "{}")))
    for name in panel.limit.split("."):
        value = value.get(name) if isinstance(value, dict) else None
    return float(value) if isinstance(value, (int, float)) else None


def _set_ticks(axes: Axes, panel: Panel, first: Channel) -> None:
    """Set the ticks of an ordinate: few numbers, or the names of a mode."""
    if not panel.levels:
        style.few_ticks(axes, 5 if panel.height < 1.5 else 7)
        return
    axes.set_yticks(range(len(panel.levels)), panel.levels)
    axes.set_ylim(-0.3, len(panel.levels) - 0.7)
    axes.set_ylabel(panel.quantity)


# --- Several recordings on top of each other, and differences

_DOTS: style.Dash = (0, (1.2, 1.2))
"""style of the second line of a panel"""
_APART = 0.03  # fraction of the lines' range: a closer set point of the same color is hidden
_BRIEF = 0.01  # fraction of the time axis: shorter differences are not visible


@dataclass(frozen=True)
class Look:
    """Style of a recording: its label, color and dashes."""

    label: str
    color: str | Color
    dash: style.Dash


def _draw_line(axes: Axes, shown: Channel, look: Look, factor: float, *, second: bool) -> float:
    """Draw a line, or the average of a ripple that fills an area; return its averaging time [s]."""
    average = inside(shown)
    shown, width = (shown, 0.0) if average is None else average
    axes.plot(
        *decimate(factor * shown.time, shown.values),
        color=look.color,
        linestyle=_DOTS if second else look.dash,
        linewidth=0.9 if second else 1.2,
        zorder=2.8 if second else 3.0,
        label="_",
    )
    return width


def _draw_target(
    axes: Axes,
    name: str,
    lines: Sequence[str],
    recordings: Sequence[xr.Dataset],
    looks: Sequence[Look],
    factor: float,
    unit: str,
) -> list[Line2D]:
    """Draw a set point: once, in black, if it is equal in all recordings.

    Different set points are drawn in their recordings' colors, without those hidden by their lines.
    ``lines``: names of the lines, starting with the line that follows the set point.
    """
    stroke = style.STROKES[Role.SET_POINT]
    shown = [channel(recording, name, unit) for recording in recordings]
    same = all(
        np.array_equal(each.time, shown[0].time) and np.array_equal(each.values, shown[0].values)
        for each in shown[1:]
    )
    followed = [channel(recording, lines[0], unit) for recording in recordings]
    if not (same or _are_seen(shown, followed)):
        return []
    colors = [stroke.color] if same else [look.color for look in looks]
    for each, color in zip(shown, colors, strict=False):
        average = inside(each)
        each = each if average is None else average[0]
        axes.plot(
            *decimate(factor * each.time, each.values),
            color=color,
            linestyle=stroke.linestyle,
            linewidth=0.9,
            zorder=3.2 if same else 2.9,
            label="_",
        )
    return [entry(shown[0].label, stroke.color if same else style.GRAY, stroke.linestyle)]


def _are_seen(targets: Sequence[Channel], followed: Sequence[Channel]) -> bool:
    """Return whether a set point of any recording is visible next to the line that follows it."""
    ends = [each for line in followed for each in (np.nanmin(line.values), np.nanmax(line.values))]
    close = _APART * (max(ends) - min(ends))
    brief = _BRIEF * max(float(line.time[-1] - line.time[0]) for line in followed)
    return any(
        float(np.sum(np.diff(line.time)[np.abs(target.values - line.values)[1:] > close])) > brief
        for target, line in zip(targets, followed, strict=True)
    )


def _draw_limits_of(
    axes: Axes,
    panel: Panel,
    recordings: Sequence[xr.Dataset],
    looks: Sequence[Look],
    first: Channel,
) -> list[Line2D]:
    """Draw the limits of a panel's first trace if it comes near; each limit once."""
    stroke = style.STROKES[Role.LIMIT]
    levels = [_limit_of(recording, panel) for recording in recordings]
    is_one = len(set(levels)) == 1
    drawn = set()
    for recording, look, level in zip(recordings, looks, levels, strict=True):
        if level is None:
            continue
        values = channel(recording, first.name, first.unit).values
        level = convert(level, first.symbol, first.unit)
        for side in (1.0, -1.0):
            at = side * level
            if float(np.nanmax(side * values)) < _NEAR * level or at in drawn:
                continue
            drawn.add(at)
            axes.axhline(
                at,
                color=stroke.color if is_one else look.color,
                linestyle=stroke.linestyle,
                linewidth=stroke.linewidth,
                zorder=stroke.zorder,
                label="_",
            )
    color = stroke.color if is_one else style.GRAY
    return [entry("limit", color, stroke.linestyle)] if drawn else []


def entry(label: str, color: str | Color, dash: Any) -> Line2D:
    """Return an entry of a legend."""
    from matplotlib.lines import Line2D

    text = style.plain(label, 110)
    return Line2D([], [], color=color, linestyle=dash, linewidth=1.4, label=text)


# --- Panels
# Every recording has a color: of the palette for any color vision or, over a range of values, of a
# scale. Dashes distinguish the lines of a recording.

_FEW = 3
"""number of recordings up to which the second trace of a panel is also drawn"""
_DASHES: tuple[style.Dash, ...] = ("-", (0, (4, 2)), (0, (6, 1.5, 1.5, 1.5)))


@dataclass(frozen=True)
class Scale:
    """Varied quantity of recordings: name, SI unit and a value for each."""

    name: str
    unit: str
    values: tuple[float, ...]


Chosen = list[tuple[Panel, list[Trace]]]


def overlaid_panels(
    recordings: Mapping[str, xr.Dataset],
    *,
    step: tuple[str, StepLimits] | None = None,
    scale: Scale | None = None,
    skipped: int = 0,
) -> Figure:
    """Draw the common signals of all recordings, in the panels of the first one's brake.

    Panels that stay at zero in all recordings are left out. Equal set points are drawn once. For
    more than `_FEW` recordings, each panel shows its first trace and set points.

    Parameters
    ----------
    recordings
        Recordings by their label in the legend.
    step
        Signal, and the step that judges it: its band and limit are drawn.
    scale
        The range of the recordings: a color scale then replaces the legend.
    skipped
        Colors of the recordings in an earlier figure, which are skipped.

    Raises
    ------
    ParameterError
        When the recordings have no common signal to draw.
    """
    whole = list(recordings.values())
    data = _shared(whole)
    present = _chosen(data)
    if not present:
        raise ParameterError(
            f"the {len(recordings)} recordings have no common time signal that changes, so "
            "bywire cannot overlay them"
        )
    looks = _looks(list(recordings), scale, skipped)
    heights = [panel.height for panel, _ in present]
    figure, rows = style.new_figure(0.6 + 1.2 * sum(heights), heights)
    factor, unit = _factor(data)
    for axes, (panel, traces) in zip(rows, present, strict=True):
        entries: list[Artist] = [*_draw_panel(axes, panel, traces, data, looks, factor)]
        if step is not None and traces[0].variable == step[0]:
            unit_there = axis_unit(data, *(trace.variable for trace in traces))
            draw_limits(axes, step[1], channel(_longest(data), step[0], unit_there))
            entries += axes.get_legend_handles_labels()[0]
        heads = (
            []
            if scale is not None or axes is not rows[0]
            else [entry(each.label, each.color, each.dash) for each in looks]
        )
        faults = _mark_faults_of(axes, whole, [each.color for each in looks], factor)
        entries += faults if axes is rows[0] else []
        style.legend_above(axes, [*heads, *entries])
        axes.margins(x=0.0)
    rows[-1].set_xlabel(f"time [{unit}]")
    figure.align_ylabels(rows)
    if scale is not None:
        value_scale(figure, rows, scale.name, scale.unit, scale.values)
    return figure


def can_overlay(recordings: Sequence[xr.Dataset]) -> bool:
    """Return whether recordings have a common signal for `overlaid_panels`."""
    return bool(_chosen(_shared(recordings)))


def _shared(recordings: Sequence[xr.Dataset]) -> list[xr.Dataset]:
    """Return recordings with their common signals over time, in one unit."""
    signals = [
        {
            str(name): variable.attrs.get("units")
            for name, variable in each.variables.items()  # arrays of all variables would take 20 ms
            if name not in each.coords and variable.dims == ("time",) and variable.size > 0
        }
        for each in recordings
    ]
    names = [
        name
        for name, unit in signals[0].items()
        if all(name in each and each[name] == unit for each in signals[1:])
    ]
    return [each[names] for each in recordings]


def _chosen(recordings: Sequence[xr.Dataset]) -> Chosen:
    """Return the declared panels with most variables of the recordings, or those by unit."""
    first = recordings[0]
    declared = [_present_in_any(recordings, each.panels) for each in declared_panels(first)]
    most = max(declared, key=len, default=[])
    return most or _present_in_any(recordings, panels_by_unit(first))


def _present_in_any(recordings: Sequence[xr.Dataset], panels: Sequence[Panel]) -> Chosen:
    """Return the panels with visible traces, and the traces that change in any recording."""
    each = [{id(panel): traces for panel, traces in drawable(r, panels)} for r in recordings]
    chosen: Chosen = []
    for panel in panels:
        moved = {trace.variable for drawn in each for trace in drawn.get(id(panel), ())}
        traces = [trace for trace in panel.traces if trace.variable in moved]
        if traces:
            chosen.append((panel, traces))
    return chosen


def _looks(labels: Sequence[str], scale: Scale | None, skipped: int) -> list[Look]:
    if scale is not None:
        return [Look(n, value_color(scale.values, k), "-") for k, n in enumerate(labels)]
    palette = style.SEQUENCE
    return [
        Look(n, palette[k % len(palette)], _DASHES[k // len(palette) % len(_DASHES)])
        for k, n in enumerate(labels, skipped)
    ]


def _draw_panel(
    axes: Axes,
    panel: Panel,
    traces: Sequence[Trace],
    recordings: Sequence[xr.Dataset],
    looks: Sequence[Look],
    factor: float,
) -> list[Line2D]:
    """Draw a panel and label its ordinate; return the entries of its legend."""
    unit = axis_unit(recordings, *(trace.variable for trace in traces))
    first = channel(recordings[0], traces[0].variable, unit)
    targets = [trace for trace in traces if trace.role is Role.SET_POINT]
    lines = [trace for trace in traces if trace not in targets] or targets[:1]
    entries: list[Line2D] = []
    for k, trace in enumerate(lines[: 2 if len(recordings) <= _FEW else 1]):
        averages = [
            _draw_line(axes, channel(recording, trace.variable, unit), look, factor, second=k > 0)
            for recording, look in zip(recordings, looks, strict=True)
        ]
        width = max(averages)
        if len(lines) > 1 or width:  # the label of an ordinate is what its lines have in common
            dash = _DOTS if k > 0 else "-"
            label = channel(recordings[0], trace.variable).label
            label += f", {amount(width, 's', 3)} average" if width else ""
            entries.append(entry(label, style.GRAY, dash))
    for target in [t for t in targets if t not in lines]:
        entries += _draw_target(
            axes, target.variable, [t.variable for t in lines], recordings, looks, factor, unit
        )
    entries += _draw_limits_of(axes, panel, recordings, looks, first)
    axes.set_ylabel(style.unit_label(panel.quantity, unit, "\n"))
    _set_ticks(axes, panel, first)
    return entries


def _longest(recordings: Sequence[xr.Dataset]) -> xr.Dataset:
    times = [each["time"].values for each in recordings]
    return recordings[max(range(len(times)), key=lambda k: float(times[k][-1] - times[k][0]))]


def _factor(recordings: Sequence[xr.Dataset]) -> tuple[float, str]:
    """Return factor and unit of the time axis, for the longest recording."""
    return style.time_scale(np.asarray(_longest(recordings)["time"].values, dtype=np.float64))


# --- Differences: each recording minus the first, at the first recording's times

_LEAST = 1e-9
"""fraction of a signal's maximum magnitude below which a difference is treated as rounding"""


def difference_figure(recordings: Mapping[str, xr.Dataset]) -> Figure | None:
    """Draw the differences of each recording from the first; None without differences.

    ``recordings``: by their label in the legend.
    """
    apart = differences_from_first(recordings)
    if not apart or not can_overlay(list(apart.values())):
        return None
    return overlaid_panels(apart, skipped=1)  # in the colors of the recordings


def differences_from_first(recordings: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """Return the common signals of all recordings, minus those of the first.

    Signals are interpolated linearly between samples. Differences end with the shorter run. Modes,
    which are whole numbers, have no difference.

    Parameters
    ----------
    recordings
        Recordings over time by label, two or more.

    Returns
    -------
    dict
        A dataset for each recording but the first, by ``"label minus first label"``; empty if the
        recordings have no common times, or do not differ.
    """
    (base_label, base), *others = recordings.items()
    low = max(float(each["time"].values[0]) for each in recordings.values())
    high = min(float(each["time"].values[-1]) for each in recordings.values())
    base = base.isel(time=(base["time"].values >= low) & (base["time"].values <= high))
    if base.sizes["time"] < 2:
        return {}
    names = [
        str(name)
        for name in base.data_vars
        if all(_is_comparable(base[name], each, str(name)) for _, each in others)
    ]
    apart = {f"{k} minus {base_label}": _less(each, base, names) for k, each in others}
    differ = any(bool(np.any(each[name].values)) for each in apart.values() for name in names)
    return apart if differ else {}


def _is_comparable(first: xr.DataArray, other: xr.Dataset, name: str) -> bool:
    if name not in other.data_vars or first.dims != ("time",) or other[name].dims != ("time",):
        return False
    is_mode = first.attrs.get("units", "1") == "1" and not np.any(np.mod(first.values, 1.0))
    return not is_mode and first.attrs.get("units") == other[name].attrs.get("units")


def _less(other: xr.Dataset, base: xr.Dataset, names: list[str]) -> xr.Dataset:
    time = base["time"].values
    is_same = np.array_equal(other["time"].values, time)
    signals = {}
    for name in names:
        first, second = base[name], other[name].values
        values = second if is_same else np.interp(time, other["time"].values, second)
        apart = values - first.values
        size = float(np.nanmax(np.abs(first.values), initial=0.0))
        apart = np.where(np.abs(apart) <= _LEAST * size, 0.0, apart)
        unit = difference_unit(str(first.attrs.get("units", "1")))
        signals[name] = ("time", apart, {**first.attrs, "units": unit})
    kept = {key: base.attrs[key] for key in ("model",) if key in base.attrs}
    import xarray as xr  # slow to load

    return xr.Dataset(signals, coords={"time": base["time"]}, attrs=kept)


# --- The same variables from several recordings, one color each

_ROOM = "  "  # extra space for short labels of wide letters
_DASHES_OF_A_VARIABLE: tuple[style.Dash, ...] = ("-", (0, (4, 2)), (0, (1.5, 1.5)))


def overlaid_traces(recordings: Mapping[str, xr.Dataset], variables: Mapping[str, str]) -> Figure:
    """Draw variables over time, one panel each, with a line for every recording.

    Parameters
    ----------
    recordings
        Recordings by their label in the legend.
    variables
        Variables, with their names at the ordinates; missing ones, and those that are zero in all
        recordings, are left out.

    Raises
    ------
    ParameterError
        When nothing is left to draw.
    """
    shown = [name for name in variables if any(_moves_in_any(r, name) for r in recordings.values())]
    if not shown:
        raise ParameterError(
            f"overlaid_traces: the {len(recordings)} recordings have none of the variables "
            f"{', '.join(variables)}. Choose others"
        )
    figure, rows = style.new_figure(0.5 + 1.7 * len(shown), [1.0] * len(shown))
    for axes, name in zip(rows, shown, strict=True):
        unit = _draw(axes, recordings, name)
        axes.set_ylabel(style.unit_label(variables[name], unit, "\n"))
        style.few_ticks(axes, 6)
        axes.margins(x=0.0)
    style.legend_above(rows[0])
    _, scale = style.time_scale(next(iter(recordings.values()))["time"].values)
    rows[-1].set_xlabel(f"time [{scale}]")
    figure.align_ylabels(rows)
    return figure


def _moves_in_any(recording: xr.Dataset, name: str) -> bool:
    return name in recording.data_vars and bool(np.any(recording[name].values))


def _draw(axes: Axes, recordings: Mapping[str, xr.Dataset], name: str) -> str:
    """Draw one variable of all recordings that contain it; return its unit."""
    scale, _ = style.time_scale(next(iter(recordings.values()))["time"].values)
    unit = axis_unit(recordings.values(), name)
    for k, (label, recording) in enumerate(recordings.items()):
        if name not in recording.data_vars:
            continue
        line, turn = channel(recording, name, unit), k // len(style.SEQUENCE)
        axes.plot(
            *decimate(scale * line.time, line.values),
            linewidth=1.1,
            color=style.SEQUENCE[k % len(style.SEQUENCE)],
            linestyle=_DASHES_OF_A_VARIABLE[turn % len(_DASHES_OF_A_VARIABLE)],
            label=style.plain(label) + _ROOM,
        )
    return unit
