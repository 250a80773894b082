"""Colors of lines that belong to values of a varied quantity, and the scale beside the panels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bywire.report import style
from bywire.report.wording import in_display_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Color = tuple[float, float, float, float]

_COLORS = "cividis"  # made for any kind of color vision
_BRIGHTEST = 0.9  # of the color map: what is brighter cannot be seen on white


def value_color(values: Sequence[float], k: int) -> Color:
    """Return the color of one of some values."""
    low, high = min(values), max(values)
    share = (values[k] - low) / (high - low) if high > low else 0.0
    import matplotlib as mpl

    return mpl.colormaps[_COLORS](_BRIGHTEST * share)


def value_scale(
    figure: Figure, panels: list[Axes], name: str, unit: str, values: Sequence[float]
) -> None:
    """Put the scale of a varied quantity beside the panels.

    Parameters
    ----------
    name, unit, values
        Quantity, its SI unit and its values.
    """
    import matplotlib as mpl
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    low, high = in_display_unit(np.array([min(values), max(values)]), unit)[0]
    colors = mpl.colormaps[_COLORS].resampled(256)
    shown = ListedColormap(colors(np.linspace(0.0, _BRIGHTEST, 256)))
    norm = Normalize(low, high)
    bar = figure.colorbar(ScalarMappable(norm, shown), ax=panels, aspect=40, pad=0.02)
    bar.ax.tick_params(labelsize=style.TEXT_SIZE)
    bar.set_label(style.axis_label(name, unit), fontsize=style.TEXT_SIZE)
