"""Figure: several recordings on top of each other, in the panels of their brake.

Every recording has a color, of the palette that any color vision tells apart or, over a range of
values, of a scale; what a line is, its dashes say.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bywire.core.errors import ParameterError
from bywire.report import style
from bywire.report.channel import channel
from bywire.report.line_role import Role
from bywire.report.mode_marks import mark_faults_of
from bywire.report.overlaid_lines import DOTS, Look, draw_limits_of, draw_line, draw_target, entry
from bywire.report.panels import Panel, Trace, declared_panels, panels_by_unit
from bywire.report.step_marks import StepLimits, draw_limits
from bywire.report.time_traces import drawable, set_ticks
from bywire.report.value_scale import value_color, value_scale
from bywire.report.wording import duration

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

FEW = 3
"""recordings up to which the second trace of a panel is drawn as well"""
_DASHES: tuple[style.Dash, ...] = ("-", (0, (4, 2)), (0, (6, 1.5, 1.5, 1.5)))


@dataclass(frozen=True)
class Scale:
    """What recordings were varied over: name, SI unit and a value for each."""

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
    """Draw the signals that all recordings share, in the panels of the first one's brake.

    Panels that stay at zero in all recordings are left out. Set points that are the same are
    drawn once. Of more than `FEW` recordings, each panel shows its first trace and set points.

    Parameters
    ----------
    recordings
        Recordings by the label that the legend shows.
    step
        Signal, and the step by which it is judged: its band and limit are drawn.
    scale
        The range that they belong to: a scale then stands in the legend's place.
    skipped
        Colors left to other recordings, those of an earlier figure.

    Raises
    ------
    ParameterError
        When the recordings share no signal that could be drawn.
    """
    whole = list(recordings.values())
    data = _shared(whole)
    present = _chosen(data)
    if not present:
        raise ParameterError(
            f"the {len(recordings)} recordings share no signal over time that moves: there is "
            "nothing to lay on top of each other"
        )
    looks = _looks(list(recordings), scale, skipped)
    heights = [panel.height for panel, _ in present]
    figure, rows = style.new_figure(0.6 + 1.2 * sum(heights), heights)
    factor, unit = _factor(data)
    for axes, (panel, traces) in zip(rows, present, strict=True):
        entries: list[Artist] = [*_draw_panel(axes, panel, traces, data, looks, factor)]
        if step is not None and traces[0].variable == step[0]:
            draw_limits(axes, step[1], channel(_longest(data), step[0]))
            entries += axes.get_legend_handles_labels()[0]
        heads = (
            []
            if scale is not None or axes is not rows[0]
            else [entry(each.label, each.color, each.dash) for each in looks]
        )
        faults = mark_faults_of(axes, whole, [each.color for each in looks], factor)
        entries += faults if axes is rows[0] else []
        style.legend_above(axes, [*heads, *entries])
        axes.margins(x=0.0)
    rows[-1].set_xlabel(f"time [{unit}]")
    figure.align_ylabels(rows)
    if scale is not None:
        value_scale(figure, rows, scale.name, scale.unit, scale.values)
    return figure


def can_overlay(recordings: Sequence[xr.Dataset]) -> bool:
    """Return whether recordings share a signal that `overlaid_panels` would draw."""
    return bool(_chosen(_shared(recordings)))


def _shared(recordings: Sequence[xr.Dataset]) -> list[xr.Dataset]:
    """Return recordings with the signals over time that all of them have, in one unit."""
    signals = [
        {
            str(name): variable.attrs.get("units")
            for name, variable in each.variables.items()  # arrays of all of them take 20 ms
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
    """Return the declared panels of which the recordings show most, or those by unit."""
    first = recordings[0]
    declared = [_present(recordings, each.panels) for each in declared_panels(first)]
    most = max(declared, key=len, default=[])
    return most or _present(recordings, panels_by_unit(first))


def _present(recordings: Sequence[xr.Dataset], panels: Sequence[Panel]) -> Chosen:
    """Return the panels that some recording shows, with the traces that some recording moves."""
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
    first = channel(recordings[0], traces[0].variable)
    targets = [trace for trace in traces if trace.role is Role.SET_POINT]
    lines = [trace for trace in traces if trace not in targets] or targets[:1]
    entries: list[Line2D] = []
    for k, trace in enumerate(lines[: 2 if len(recordings) <= FEW else 1]):
        averages = [
            draw_line(axes, channel(recording, trace.variable), look, factor, second=k > 0)
            for recording, look in zip(recordings, looks, strict=True)
        ]
        width = max(averages)
        if len(lines) > 1 or width:  # an ordinate names what its lines have in common
            dash = DOTS if k > 0 else "-"
            label = channel(recordings[0], trace.variable).label
            label += f", {duration(width)} average" if width else ""
            entries.append(entry(label, style.GRAY, dash))
    for target in [t for t in targets if t not in lines]:
        entries += draw_target(
            axes, target.variable, [t.variable for t in lines], recordings, looks, factor
        )
    entries += draw_limits_of(axes, panel, recordings, looks, first)
    axes.set_ylabel(style.axis_label(panel.quantity, first.symbol, "\n"))
    set_ticks(axes, panel, first)
    return entries


def _longest(recordings: Sequence[xr.Dataset]) -> xr.Dataset:
    times = [each["time"].values for each in recordings]
    return recordings[max(range(len(times)), key=lambda k: float(times[k][-1] - times[k][0]))]


def _factor(recordings: Sequence[xr.Dataset]) -> tuple[float, str]:
    """Return factor and unit of the time axis, as of the longest recording."""
    return style.time_scale(np.asarray(_longest(recordings)["time"].values, dtype=np.float64))
