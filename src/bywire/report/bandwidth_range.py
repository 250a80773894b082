"""Figure: bandwidth over a range of one parameter, by amplitude."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from bywire.report import style
from bywire.report.wording import amount, in_display_unit

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
