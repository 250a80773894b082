"""Figure: friction torque over speed, for several pressures."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bywire.core.errors import ParameterError
from bywire.report import style
from bywire.report.channel import FloatArray
from bywire.report.wording import amount


def stribeck_curve(
    speed: FloatArray,
    torques: Mapping[float, FloatArray],
    *,
    measured: Mapping[float, tuple[FloatArray, FloatArray]] | None = None,
) -> Figure:
    """Draw friction torque over shaft speed, one line per pressure.

    At rest the torque is set-valued: a vertical line joins the two breakaway torques.

    Parameters
    ----------
    speed
        Shaft speed [rad/s], ascending, shape ``(n,)``. A sample at 0 is not drawn.
    torques
        Friction torque [N m] at these speeds, by pressure [Pa].
    measured
        Measured speeds and torques, by pressure; drawn as points.

    Raises
    ------
    ParameterError
        When no curve is given, or one does not fit the speeds.
    """
    if not torques:
        raise ParameterError("stribeck_curve: no curve given: give at least one pressure")
    figure, (axes,) = style.new_figure(3.8)
    for k, (pressure, torque) in enumerate(torques.items()):
        if np.shape(torque) != np.shape(speed):
            raise ParameterError(
                f"stribeck_curve: {amount(pressure, 'Pa')} has {np.size(torque)} torques for "
                f"{np.size(speed)} speeds: give one per speed"
            )
        color = style.SEQUENCE[k % len(style.SEQUENCE)]
        _draw_curve(axes, speed, torque, color, amount(pressure, "Pa"))
        points = (measured or {}).get(pressure)
        if points is not None:
            axes.plot(
                *points, "o", color=color, markersize=3.5, markerfacecolor="white", zorder=4,
                label=f"{amount(pressure, 'Pa')}, measured",
            )
    axes.axhline(0.0, color=style.GRAY, linewidth=0.6, zorder=1)
    axes.margins(x=0.01)
    axes.set_xlabel(style.axis_label("motor speed", "rad/s"))
    axes.set_ylabel(style.axis_label("friction torque", "N*m"))
    style.legend_above(axes)
    return figure


def _draw_curve(
    axes: Axes, speed: FloatArray, torque: FloatArray, color: str, label: str
) -> None:
    """Draw both branches and, between them, the set of torques at rest."""
    back, forth = speed < 0, speed > 0
    axes.plot(speed[forth], torque[forth], color=color, linewidth=1.4, label=label)
    axes.plot(speed[back], torque[back], color=color, linewidth=1.4)
    if bool(np.any(back)) and bool(np.any(forth)):
        rest = [float(torque[back][-1]), float(torque[forth][0])]
        # Shorter sets lie above longer ones, so that all are seen.
        above = 2.0 + 0.9 / (1.0 + abs(rest[1] - rest[0]))
        axes.plot([0.0, 0.0], rest, color=color, linewidth=1.4, zorder=above)
