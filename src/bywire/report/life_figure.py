"""Figure: slow states over the lifetime, and the remaining margins to their limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from bywire.core.typing import Array
from bywire.report import style
from bywire.report.channel import decimate
from bywire.report.panels import Role
from bywire.report.wording import in_display_unit

_HEIGHT = 1.15  # height of a panel [inch]


@dataclass(frozen=True)
class Course:
    """A quantity versus the number of stops.

    Parameters
    ----------
    label, unit
        Label of the axis, and the SI unit.
    values
        Shape (stops + 1,).
    is_left
        Whether it is a remaining margin, which ends at zero.
    """

    label: str
    unit: str
    values: Array
    is_left: bool = False


def life_figure(courses: Sequence[Course], marks: Sequence[int]) -> Figure:
    """Draw quantities versus the number of stops, one panel each; a dotted line at zero is the end.

    Parameters
    ----------
    courses
        Quantities, from the top.
    marks
        Numbers of the simulated stops, drawn as dots.
    """
    figure, rows = style.new_figure(0.5 + _HEIGHT * len(courses), [1.0] * len(courses))
    for axes, course in zip(rows, courses, strict=True):
        shown = in_display_unit(course.values, course.unit)[0]
        stops = np.arange(shown.size, dtype=float)
        axes.plot(*decimate(stops, shown), color=style.BLUE, linewidth=1.2)
        axes.plot(
            marks,
            shown[list(marks)],
            color=style.BLUE,
            marker="o",
            markersize=2.2,
            linestyle="none",
        )
        if course.is_left:
            look = style.STROKES[Role.LIMIT]
            axes.axhline(0.0, color=look.color, linestyle=look.linestyle, linewidth=look.linewidth)
        style.few_ticks(axes, 4)
        axes.set_ylabel(style.axis_label(course.label, course.unit, "\n"))
    rows[-1].set_xlabel("stops")
    return figure
