"""Figure: by how much each cause moves a frequency response away from the linear one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.line_role import Role

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
