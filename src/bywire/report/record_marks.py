"""Where one record ends and the next begins, on an axis along which records follow one another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from bywire.report import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_NAMED = 8  # records up to which there is room for their names
_ROOM = 0.06  # of the height of the first panel, for the names


def mark_records(panels: Sequence[Axes], at: xr.DataArray) -> None:
    """Draw a thin line between records, and their names at the top of the first panel.

    Parameters
    ----------
    panels
        Panels that share the abscissa.
    at
        The abscissa as it is drawn; its coordinate ``record`` names each sample's record. Without
        one nothing is drawn.
    """
    if "record" not in at.coords or at.coords["record"].dims != at.dims:
        return
    names, places = at.coords["record"].values, at.values
    starts = np.concatenate(([0], np.flatnonzero(names[1:] != names[:-1]) + 1))
    ends = [*starts[1:].tolist(), len(names)]
    if len(ends) <= _NAMED:
        low, high = panels[0].get_ylim()
        panels[0].set_ylim(low, high + _ROOM * (high - low))
    for start, end in zip(starts.tolist(), ends, strict=True):
        if start > 0:
            border = 0.5 * float(places[start - 1] + places[start])
            for axes in panels:
                axes.axvline(border, color=style.GRAY, linewidth=0.5, zorder=1.0)
        if len(ends) <= _NAMED:
            middle = 0.5 * float(places[start] + places[end - 1])
            panels[0].annotate(
                style.plain(names[start], 16),
                (middle, 1.0),
                xycoords=("data", "axes fraction"),
                ha="center",
                va="top",
                color=style.GRAY,
                fontsize=style.TEXT_SIZE - 1.5,
            )
