"""Figure: how well a variable follows its moving set point."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from bywire.core.errors import ParameterError
from bywire.report import style
from bywire.report.channel import channel
from bywire.report.line_role import Role

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def tracking(recording: xr.Dataset, variable: str, set_point: str) -> Figure:
    """Draw a variable with its set point, and below it the error between them.

    ``recording``: recording to draw; ``variable``, ``set_point``: two variables of the same unit.

    Raises
    ------
    ParameterError
        When the units differ.
    """
    shown, wanted = channel(recording, variable), channel(recording, set_point)
    if shown.unit != wanted.unit:
        raise ParameterError(
            f"{variable} is in {shown.unit} and {set_point} in {wanted.unit}: name a set point "
            f"of {variable}"
        )
    error = replace(shown, label="set point less value", values=wanted.values - shown.values)
    figure, (upper, lower) = style.new_figure(4.6, (2.0, 1.0))
    style.draw_channel(upper, shown, Role.MAIN)
    style.draw_channel(upper, wanted, Role.SET_POINT)
    style.draw_channel(lower, error, Role.MAIN)
    lower.axhline(0.0, color=style.GRAY, linewidth=0.6, zorder=1)
    upper.margins(x=0.0)
    upper.set_ylabel(style.channel_label(shown))
    lower.set_ylabel(style.axis_label("error", shown.symbol))
    lower.set_xlabel(f"time [{style.time_scale(shown.time)[1]}]")
    style.legend_above(upper)
    style.legend_above(lower)
    figure.align_ylabels([upper, lower])
    return figure
