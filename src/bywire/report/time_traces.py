"""Figure: what a recording did over time, in panels one above the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bywire.core.errors import ParameterError
from bywire.report import style
from bywire.report.channel import Channel, channel
from bywire.report.decimation import phases
from bywire.report.step_marks import StepLimits, draw_limits
from bywire.report.style import Role

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Trace:
    """A variable and what its line means."""

    variable: str
    role: Role = Role.MAIN


@dataclass(frozen=True)
class Panel:
    """One panel of stacked time traces.

    Parameters
    ----------
    quantity
        What the ordinate says, without its unit; short, for low panels.
    traces
        Lines of one unit, the judged one first; variables a recording lacks are left out.
    saturation
        Variable that is 1 while the quantity is saturated.
    height
        Relative height.
    """

    quantity: str
    traces: tuple[Trace, ...]
    saturation: str | None = None
    height: float = 1.0


BRAKE_PANELS = (
    Panel(
        "pressure",
        (Trace("p_mc"), Trace("p_pd", Role.SECOND), Trace("p_ref", Role.SET_POINT)),
        height=1.8,
    ),
    Panel("current", (Trace("i"), Trace("i_ref", Role.SET_POINT)), saturation="sat_current"),
    Panel("speed", (Trace("omega"),)),
    Panel("duty cycle", (Trace("duty"),), saturation="sat_duty"),
    Panel("power", (Trace("P_el"),)),
)
"""panels of the motorcycle brake"""


def time_traces(
    recording: xr.Dataset,
    *,
    panels: Sequence[Panel] = BRAKE_PANELS,
    limits: StepLimits | None = None,
    measured: xr.Dataset | None = None,
    stuck: str = "stuck",
) -> Figure:
    """Draw panels of variables over a shared time axis.

    Phases in which the shaft sticks are shaded; saturation is a bar along the upper edge.

    Parameters
    ----------
    recording
        Recording to draw.
    panels
        What to draw; panels without any variable in the recording are left out.
    limits
        Step by which the first trace of the first panel is judged: its band and limit are drawn.
    measured
        Recording to compare with: solid blue, ``recording`` dashed red on top. Of every panel
        then only the first trace and the set points are drawn.
    stuck
        Variable that is 1 while the shaft sticks.

    Raises
    ------
    ParameterError
        When the recording has none of the variables, or a panel mixes units.
    """
    present = [(panel, _present(panel, recording)) for panel in panels]
    present = [(panel, traces) for panel, traces in present if traces]
    if not present:
        wanted = ", ".join(trace.variable for panel in panels for trace in panel.traces)
        raise ParameterError(f"the recording has none of the variables {wanted}")
    heights = [panel.height for panel, _ in present]
    figure, rows = style.new_figure(0.5 + 1.15 * sum(heights), heights)
    for axes, (panel, traces) in zip(rows, present, strict=True):
        first = _draw_traces(axes, panel, traces, recording, measured)
        if axes is rows[0] and limits is not None:
            draw_limits(axes, limits, first)
        _shade_stuck(axes, recording, stuck, named=axes is rows[0])
        _mark_saturation(axes, panel, recording)
        axes.margins(x=0.0)
        style.few_ticks(axes, 5 if panel.height < 1.5 else 7)
        style.legend_above(axes)
    _, unit = style.time_scale(first.time)
    rows[-1].set_xlabel(f"time [{unit}]")
    figure.align_ylabels(rows)
    return figure


def _present(panel: Panel, recording: xr.Dataset) -> list[Trace]:
    """Return the traces worth drawing; a set point that is always 0 was never used."""
    found = [trace for trace in panel.traces if trace.variable in recording.data_vars]
    return [
        trace
        for trace in found
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
    spans = _spans(recording, variable)
    if spans:
        axes.broken_barh(
            spans, (0.0, 1.0), transform=axes.get_xaxis_transform(), facecolor=style.SHADE,
            alpha=0.7, linewidth=0, zorder=0.4, label="shaft stuck" if named else None,
        )


def _mark_saturation(axes: Axes, panel: Panel, recording: xr.Dataset) -> None:
    spans = _spans(recording, panel.saturation) if panel.saturation is not None else []
    if spans:
        axes.broken_barh(
            spans, (0.96, 0.04), transform=axes.get_xaxis_transform(),
            facecolor=style.VERMILLION, edgecolor=style.VERMILLION, linewidth=0.8, zorder=2.0,
            label="saturated",
        )


def _spans(recording: xr.Dataset, variable: str) -> list[tuple[float, float]]:
    """Return starts and lengths of the spans in which a mode variable is 1, on the time axis."""
    if variable not in recording.data_vars:
        return []
    mode = channel(recording, variable)
    scale, _ = style.time_scale(mode.time)
    return [
        (scale * start, scale * (end - start))
        for start, end in phases(mode.time, mode.values > 0.5)
    ]
