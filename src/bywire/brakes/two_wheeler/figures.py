"""Figures of vehicles' runs."""

from __future__ import annotations

from bywire.bench.result import Result
from bywire.brakes.two_wheeler.case import vehicle_of
from bywire.report.bench_figures import FigureKind, Shown
from bywire.vehicle.road_marks import road_marks


def _road_marks(result: Result) -> list[Shown]:
    """Return a figure for each run."""
    several = len(result.recordings) > 1
    return [
        Shown(
            f"road-marks-{label}" if several else "road-marks",
            road_marks(run, vehicle_of(run)),
            f"The road{f', {label}' if several else ''}, and where tyres slide on it.",
        )
        for label, run in result.recordings.items()
    ]


FIGURE = FigureKind("road-marks", _road_marks)
