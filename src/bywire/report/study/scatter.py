"""Figure: a key figure over the quantities that drive it, each case a point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bywire.core.typing import Array
from bywire.report import style
from bywire.report.line_role import Role
from bywire.report.wording import in_display_unit

_MOST = 4000  # points drawn of those that meet the limit


@dataclass(frozen=True)
class Axis:
    """What an axis shows: name, SI unit, and the value of each case, shape (cases,)."""

    name: str
    unit: str
    values: Array

    @property
    def label(self) -> str:
        """What the axis says: names of parameters, which have dots, as they are."""
        return self.name if "." in self.name else self.name.replace("_", " ")

    @property
    def shown(self) -> Array:
        """The values in the unit that the axis says."""
        return in_display_unit(1.0, self.unit)[0] * self.values


def scatter(
    figure_of: Axis, drivers: Sequence[Axis], limit: float, met: NDArray[np.bool_]
) -> Figure:
    """Draw a key figure over its drivers.

    Parameters
    ----------
    figure_of, drivers
        The key figure, and what it is drawn over.
    limit
        What is required [the figure's unit].
    met
        Whether each case meets it; the others are crosses.
    """
    figure = Figure(figsize=(style.WIDTH, 2.6), layout="constrained", facecolor="white")
    panels = figure.subplots(1, len(drivers), sharey=True, squeeze=False)[0]
    look = style.STROKES[Role.LIMIT]
    good = np.flatnonzero(met)
    good = good[:: max(1, good.size // _MOST)]
    for axes, driver in zip(panels, drivers, strict=True):
        style.dress(axes)
        axes.plot(driver.shown[good], figure_of.shown[good], color=style.BLUE, marker=".",
                  markersize=2.5, linestyle="none", alpha=0.6, rasterized=True)  # fmt: skip
        axes.plot(driver.shown[~met], figure_of.shown[~met], color=look.color, marker="x",
                  markersize=4.5, linestyle="none")  # fmt: skip
        axes.axhline(in_display_unit(limit, figure_of.unit)[0], color=look.color,
                     linestyle=look.linestyle, linewidth=look.linewidth)  # fmt: skip
        axes.set_xlabel(style.axis_label(driver.name, driver.unit))
    panels[0].set_ylabel(style.axis_label(figure_of.label, figure_of.unit))
    return figure


def parallel_coordinates(axes_of: Sequence[Axis], met: NDArray[np.bool_]) -> Figure:
    """Draw every case as a line over all axes, those that miss a requirement in front.

    Parameters
    ----------
    axes_of
        What varies, then key figures; each axis goes from its least to its largest value.
    met
        Whether each case meets all requirements.
    """
    figure, (axes,) = style.new_figure(3.4)
    ends = [(float(np.nanmin(a.shown)), float(np.nanmax(a.shown))) for a in axes_of]
    scaled = np.array([
        (a.shown - low) / (high - low or 1.0) for a, (low, high) in zip(axes_of, ends, strict=True)
    ])  # fmt: skip
    places = np.arange(len(axes_of))
    good = np.flatnonzero(met)[:: max(1, int(met.sum()) // 300)]
    bad = np.flatnonzero(~met)[:: max(1, int((~met).sum()) // 300)]
    for rows, color, opacity in ((good, style.BLUE, 0.25), (bad, style.VERMILLION, 0.7)):
        axes.plot(places, scaled[:, rows], color=color, alpha=opacity, linewidth=0.6)
    for place, (low, high) in enumerate(ends):
        axes.axvline(place, color=style.GRAY, linewidth=0.8)
        for text, height, side in ((high, 1.02, "bottom"), (low, -0.02, "top")):
            axes.text(place, height, f"{text:.3g}", ha="center", va=side, fontsize=7.0)
    labels = [style.axis_label(a.label, a.unit, "\n") for a in axes_of]
    axes.set_xticks(places, labels, rotation=35, ha="right")
    axes.tick_params(axis="x", pad=12.0)
    axes.set_yticks([])
    axes.set_ylim(-0.1, 1.1)
    return figure
