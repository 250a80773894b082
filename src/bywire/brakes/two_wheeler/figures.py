"""Figure of the speeds along the road, with its surfaces and tire marks."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bywire.bench.running import Result
from bywire.brakes.two_wheeler.case import vehicle_of
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.bench_figures import FigureKind, Shown
from bywire.report.channel import channel, decimate, phases
from bywire.vehicle.ideal_stop import ideal_distance
from bywire.vehicle.stop_scene import TINTS
from bywire.vehicle.surfaces import surface_name
from bywire.vehicle.two_wheeler import VehicleParameters

if TYPE_CHECKING:
    import xarray as xr

_STROKES: dict[str, tuple[str, style.Dash]] = {
    "v": (style.BLUE, "-"),
    "v_f": (style.ORANGE, (0, (1.5, 1.5))),
    "v_r": (style.GREEN, (0, (4, 2))),
}
_TINT, _LANE = 0.3, 0.5  # opacity of a surface, width of a lane's mark
_LOADED = 1.0  # N; an unloaded wheel leaves no mark


def road_marks(run: xr.Dataset, par: VehicleParameters) -> Figure:
    """Draw the speeds of a two-wheeler and its treads along the road, and the tire marks.

    Surfaces are bands with their names. A sliding tire leaves a mark where it touches the road,
    black for a locked wheel. The x axis is the front wheel's position, which is zero at t = 0. On a
    single surface, the figure also shows the end of the ideal stop.

    Parameters
    ----------
    run
        Recording of a vehicle with the signals of `TwoWheeler`.
    par
        Vehicle parameters.
    """
    figure, (upper, lower) = style.new_figure(3.6, (1.6, 1.0))
    front = np.maximum.accumulate(run["x"].values)
    lanes = {"front": (front, "f"), "rear": (front - par.body.L, "r")}
    for name, (color, dash) in _STROKES.items():
        shown = channel(run, name)
        upper.plot(
            *decimate(front, shown.values),
            color=color,
            linestyle=dash,
            linewidth=1.3,
            label=style.plain(shown.label),
        )
    upper.set_ylabel(style.axis_label("speed", "m/s"))
    span = (float(front[0]) - par.body.L, float(front[-1]))
    _draw_surfaces(lower, par, span)
    for row, (place, wheel) in enumerate(lanes.values()):
        _draw_marks(lower, run, place, wheel, row)
    ideal = ideal_distance(float(np.interp(0.0, run["time"], run["v"])), par)
    if span[0] < ideal < min(span[1], par.road.x_change):  # the ideal stop is on one surface
        for axes in (upper, lower):
            axes.axvline(
                ideal,
                color=style.BLACK,
                linestyle="--",
                linewidth=1.0,
                zorder=2.5,
                label="ideal stop" if axes is upper else None,
            )
    lower.set_yticks(range(len(lanes)), list(lanes))
    lower.set_ylim(-0.6, len(lanes) - 0.4)
    lower.set_ylabel("wheel")
    lower.set_xlabel("position along the road [m]")
    lower.set_xlim(*span)
    style.legend_above(upper)
    style.legend_above(lower)
    figure.align_ylabels([upper, lower])
    return figure


def _draw_surfaces(axes: Axes, par: VehicleParameters, span: tuple[float, float]) -> None:
    """Fill the visible surfaces of the road, with their names."""
    ways = par.road
    edges = (span[0], ways.x_change, ways.x_back, span[1])
    drawn: set[str] = set()
    for begin, end in pairwise(edges):
        left, right = max(begin, span[0]), min(end, span[1])
        if not left < right:
            continue
        name = surface_name(0.5 * (left + right), ways)
        axes.axvspan(
            left,
            right,
            color=TINTS[name],
            alpha=_TINT,
            linewidth=0,
            zorder=0.5,
            label=None if name in drawn else name.replace("-", " "),
        )
        drawn.add(name)


def _draw_marks(axes: Axes, run: xr.Dataset, place: Array, wheel: str, row: int) -> None:
    """Mark where a tire slides, and where its wheel is locked."""
    slides = (run[f"sliding_{wheel}"].values > 0.5) & (run[f"N_{wheel}"].values > _LOADED)
    stands = slides & (run[f"omega_{wheel}"].values == 0)
    marks = (
        ("tire slides", slides, style.VERMILLION, _LANE, 2.0),
        ("wheel locked", stands, style.BLACK, 0.5 * _LANE, 2.1),
    )
    for label, flags, color, width, order in marks:
        spans = [(begin, end - begin) for begin, end in phases(place, flags)]
        axes.broken_barh(
            spans,
            (row - 0.5 * width, width),
            facecolor=color,
            linewidth=0,
            zorder=order,
            label=label if row == 0 else None,
        )


def _of_runs(result: Result) -> list[Shown]:
    """Return a figure for each run."""
    several = len(result.recordings) > 1
    return [
        Shown(
            f"road-marks-{label}" if several else "road-marks",
            road_marks(run, vehicle_of(run)),
            f"Speeds along the road{f', {label}' if several else ''}, and where the tires slide.",
        )
        for label, run in result.recordings.items()
    ]


FIGURE = FigureKind("road-marks", _of_runs)
