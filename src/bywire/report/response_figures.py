"""Figures: how a nonlinear response differs from the linear one; its bandwidth over a range."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.panels import Role
from bywire.report.wording import amount, in_display_unit

_DASHES: tuple[style.Dash, ...] = ("-", "--", ":")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")
_LEAST = 0.01  # of the tolerance: smaller differences are drawn at the lower edge


def differences(
    frequency: Array,
    sizes: Mapping[str, tuple[Array, Array]],
    tolerance: tuple[float, float],
) -> Figure:
    """Draw the size of differences of gain and phase over frequency, logarithmically.

    Parameters
    ----------
    frequency
        Frequencies [Hz], shape (n,).
    sizes
        Label -> differences of gain [dB] and phase [degree], shape (n,) each; NaN is left out.
    tolerance
        What counts as agreement, in dB and degree: drawn as limits.

    Raises
    ------
    ParameterError
        When there is nothing to draw.
    """
    if not sizes:
        raise ParameterError("differences: nothing given: give at least one cause")
    figure, panels = style.new_figure(5.2, (1.0, 1.0))
    look = style.STROKES[Role.LIMIT]
    for n, (axes, label) in enumerate(zip(panels, ("gain [dB]", "phase [°]"), strict=True)):
        floor = _LEAST * tolerance[n]
        for k, (name, values) in enumerate(sizes.items()):
            size = np.abs(values[n])
            axes.plot(
                frequency,
                np.where(np.isfinite(size), np.maximum(size, floor), np.nan),
                color=style.SEQUENCE[k % len(style.SEQUENCE)],
                linestyle=_DASHES[k // len(style.SEQUENCE) % len(_DASHES)],
                marker=_MARKERS[k % len(_MARKERS)],
                markersize=4.5,
                linewidth=1.2,
                label=style.plain(name),
            )
        axes.axhline(
            tolerance[n],
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            label="counts as agreement",
        )
        axes.set_yscale("log")
        axes.set_ylabel(f"difference of {label}")
    panels[1].set_xscale("log")
    panels[1].xaxis.set_major_formatter(lambda hertz, _: f"{hertz:g}")
    panels[1].xaxis.set_minor_formatter(NullFormatter())
    panels[1].set_xlabel(style.axis_label("frequency", "Hz"))
    style.legend_above(panels[0])
    figure.align_ylabels(panels)
    return figure


# --- Bandwidth over a range of one parameter, by amplitude

_COLORS = (style.BLUE, style.VERMILLION, style.GREEN, style.PURPLE, style.ORANGE, style.SKY)


def bandwidth_range(
    response: xr.Dataset, labels: Sequence[float], name: str, symbol: str
) -> Figure:
    """Draw the bandwidth of every amplitude; a ring marks the worst case.

    Parameters
    ----------
    response
        Dataset with ``bandwidth`` [Hz] over ``variant`` and ``amplitude``; where it lies beyond
        the measured frequencies, an arrow stands at the last one.
    labels
        What varies, SI, shape (variants,).
    name, symbol
        Its name and SI unit.
    """
    figure, (axes,) = style.new_figure(2.9)
    x, _ = in_display_unit(np.asarray(labels), symbol)
    lowest, highest = response["frequency"].values[[0, -1]]
    size_unit = str(response["amplitude"].attrs["units"])
    for (j, size), color in zip(enumerate(response["amplitude"].values), cycle(_COLORS)):
        y = response["bandwidth"].values[:, j]
        inside = np.clip(y, lowest, highest)
        label = f"amplitude {amount(float(size), size_unit, 3)}"
        axes.plot(x, inside, marker="o", markersize=4, color=color, label=style.plain(label))
        for beyond, mark in ((y > highest, "^"), (y < lowest, "v")):
            axes.plot(x[beyond], inside[beyond], mark, color=color, markersize=8)
        k = int(np.argmin(y))
        axes.plot(x[k], inside[k], "o", markersize=11, fillstyle="none", color=color)
    axes.set_xlabel(style.axis_label(name, symbol))
    axes.set_ylabel(style.axis_label("bandwidth (-3 dB)", "Hz"))
    axes.set_ylim(bottom=0.0)
    style.legend_above(axes)
    return figure
