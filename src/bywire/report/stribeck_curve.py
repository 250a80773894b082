"""Figure: friction torque over speed, for several pressures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from bywire.core.errors import ParameterError, unknown_name
from bywire.report import style
from bywire.report.channel import FloatArray
from bywire.report.wording import amount

if TYPE_CHECKING:
    import xarray as xr


def stribeck_curve(
    curve: xr.Dataset,
    *,
    torque: str = "T_fr",
    measured: Mapping[float, tuple[FloatArray, FloatArray]] | None = None,
) -> Figure:
    """Draw friction torque over shaft speed, one line per pressure.

    At rest the torque is set-valued: between the two breakaway torques the line is vertical.

    Parameters
    ----------
    curve
        Dataset with the torque [N m] over two dimensions: pressure [Pa] and ascending speed
        [rad/s], which contains 0 twice, once for each end of the interval at rest.
    torque
        Name of the torque in it.
    measured
        Measured speeds [rad/s] and torques [N m], by pressure [Pa]; drawn as points.

    Raises
    ------
    UnknownNameError
        When the dataset has no such torque.
    ParameterError
        When it does not depend on pressure and speed.
    """
    if torque not in curve.data_vars:
        raise unknown_name("variable", torque, map(str, curve.data_vars))
    array = curve[torque]
    if array.ndim != 2 or array.size == 0:
        raise ParameterError(
            f"{torque} has the shape {array.shape}: a Stribeck curve needs pressure and speed"
        )
    pressure, speed = (array[name] for name in array.dims)
    figure, (axes,) = style.new_figure(3.8)
    for k, p in enumerate(pressure.values.astype(float)):
        color = style.SEQUENCE[k % len(style.SEQUENCE)]
        values = np.asarray(array.values[k], dtype=float)
        # Short intervals at rest lie above long ones, so that all are seen.
        above = 2.0 + 0.9 / (1.0 + float(np.ptp(values)))
        label = amount(p, "Pa")
        axes.plot(speed.values, values, color=color, linewidth=1.4, zorder=above, label=label)
        if measured is not None and p in measured:
            axes.plot(
                *measured[p], "o", color=color, markersize=3.5, markerfacecolor="white", zorder=4,
                label=f"{label}, measured",
            )
    axes.axhline(0.0, color=style.GRAY, linewidth=0.6, zorder=1)
    axes.margins(x=0.01)
    axes.set_xlabel(style.axis_label(str(speed.attrs.get("long_name", "speed")), "rad/s"))
    axes.set_ylabel(style.axis_label(str(array.attrs.get("long_name", torque)), "N*m"))
    style.legend_above(axes)
    return figure
