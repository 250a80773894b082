"""What a legend says of a confidence band, which the line that it is around may hide."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from bywire.core.typing import Array
from bywire.report.wording import amount, in_display_unit

LINE = 1.3
"""width of the line in the middle of a band [pt]"""


def band_label(axes: Axes, half: Array, symbol: str) -> str:
    """Return the entry of a 95 % band: how wide it is, and whether the line hides it.

    Parameters
    ----------
    axes
        Axes that hold the line, their limits set by what is drawn.
    half
        Half widths of the band in ``symbol``, any shape; NaN where there is none.
    symbol
        SI unit.
    """
    if not np.isfinite(half).any():
        return "95 % band"
    most = float(np.nanmax(half))
    low, high = axes.get_ylim()
    figure = axes.get_figure()
    points = 0.0 if figure is None else 72.0 * axes.bbox.height / figure.dpi
    drawn = 2.0 * in_display_unit(most, symbol)[0] / max(abs(high - low), 1e-300) * points
    hidden = ", within the line" if drawn < LINE else ""
    return f"95 % band (± {amount(most, symbol, 2)} at most{hidden})"
