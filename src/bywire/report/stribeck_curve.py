"""Figure: dry friction over speed, for several levels of what it depends on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from bywire.core.errors import ParameterError, unknown_name
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.wording import amount

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def stribeck_curve(
    curve: xr.Dataset,
    *,
    friction: str = "",
    measured: Mapping[float, tuple[Array, Array]] | None = None,
) -> Figure:
    """Draw dry friction over speed, one line per level.

    At rest friction is set-valued: between its two breakaway values the line is vertical.

    Parameters
    ----------
    curve
        Dataset with the friction over two dimensions: what it depends on, for instance a
        pressure, and ascending speed, which contains 0 twice, once for each end of the interval
        at rest. All say their units.
    friction
        Name of the friction in it; its first variable where empty.
    measured
        Measured speeds and frictions, SI, by level; drawn as points.

    Raises
    ------
    UnknownNameError
        When the dataset has no such variable.
    ParameterError
        When it does not depend on a level and a speed.
    """
    friction = friction or next(map(str, curve.data_vars), "")
    if friction not in curve.data_vars:
        raise unknown_name("variable", friction, map(str, curve.data_vars))
    array = curve[friction]
    if array.ndim != 2 or array.size == 0:
        raise ParameterError(
            f"{friction} has the shape {array.shape}: a Stribeck curve needs a level and a speed"
        )
    level, speed = (array[name] for name in array.dims)
    unit = str(level.attrs.get("units", "1"))
    figure, (axes,) = style.new_figure(3.8)
    for k, p in enumerate(level.values.astype(float)):
        color = style.SEQUENCE[k % len(style.SEQUENCE)]
        values = np.asarray(array.values[k], dtype=float)
        # Short intervals at rest lie above long ones, so that all are seen.
        above = 2.0 + 0.9 / (1.0 + float(np.ptp(values)))
        label = amount(p, unit)
        axes.plot(speed.values, values, color=color, linewidth=1.4, zorder=above, label=label)
        if measured is not None and p in measured:
            axes.plot(
                *measured[p],
                "o",
                color=color,
                markersize=3.5,
                markerfacecolor="white",
                zorder=4,
                label=f"{label}, measured",
            )
    axes.axhline(0.0, color=style.GRAY, linewidth=0.6, zorder=1)
    axes.margins(x=0.01)
    axes.set_xlabel(_title(speed, "speed"))
    axes.set_ylabel(_title(array, friction))
    style.legend_above(axes)
    return figure


def _title(shown: xr.DataArray, name: str) -> str:
    unit = str(shown.attrs.get("units", "1"))
    return style.axis_label(str(shown.attrs.get("long_name", name)), unit)
