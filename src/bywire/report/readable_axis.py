"""Axes of figures: readable units, labels without overlaps, limits far from the data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, overload

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import FixedLocator, MaxNLocator, ScalarFormatter

from bywire.core.quantities import readable_unit
from bywire.core.typing import Array
from bywire.core.units import convert, difference_unit
from bywire.report import style
from bywire.report.channel import size_of
from bywire.report.wording import amount, unit_text

CHARACTER = 0.62 * style.TEXT_SIZE / 72.0
"""width of a digit [inch], rounded"""
_GAP = 2  # minimum number of characters between two labels
_PLAIN = (1e-2, 1e5)  # range of maximum magnitudes that are written without a power of ten


@dataclass(frozen=True)
class Scale:
    """Scale of an axis: times ``factor``, plus ``offset``, in ``unit``."""

    factor: float
    unit: str
    offset: float = 0.0

    @overload
    def __call__(self, values: float) -> float: ...
    @overload
    def __call__(self, values: Array) -> Array: ...
    def __call__(self, values: float | Array) -> float | Array:
        """Return values in this scale."""
        return self.factor * values + self.offset

    def label(self, name: str, gap: str = " ") -> str:
        """Return the label of the axis; ``gap`` separates name and unit."""
        return f"{style.plain(name, 40)}{gap}[{style.plain(self.unit, 20) or '-'}]"


def scale_of(values: Array, symbol: str) -> Scale:
    """Return the scale in which values are easiest to read.

    It uses the unit of tables (see `bywire.report.wording.readable_unit`), with a power of ten if
    numbers would be too small or too large.

    Parameters
    ----------
    values
        In ``symbol``; NaN where there is none.
    symbol
        SI unit, or ``"%"``.

    Examples
    --------
    >>> scale_of(np.array([0.06]), "s"), scale_of(np.array([1.1e6]), "N/m")
    (Scale(factor=1000.0, unit='ms', offset=0.0), Scale(factor=1e-06, unit='10⁶ N/m', offset=0.0))
    """
    known = values[np.isfinite(values)]
    unit = readable_unit(size_of(values), symbol)
    offset = float(convert(0.0, symbol, unit))
    plain = Scale(_factor(symbol, unit), unit_text(unit), offset)
    largest = float(np.max(np.abs(plain(known)), initial=0.0))
    if largest == 0.0 or offset or _PLAIN[0] <= largest < _PLAIN[1]:
        return plain
    power = 3 * math.floor(math.log10(largest) / 3.0)
    return Scale(plain.factor * 10.0**-power, f"{unit_text(f'10**{power}')} {plain.unit}".strip())


def difference_scale(size: float, symbol: str) -> Scale:
    """Return the scale of differences of a figure: in its unit, for temperatures in K.

    ``size``: maximum magnitude of the figure, in ``symbol``.
    """
    of = difference_unit(symbol)
    unit = readable_unit(size, of)
    return Scale(_factor(of, unit), unit_text(unit))


def _factor(symbol: str, unit: str) -> float:
    """Return the factor from one unit to another."""
    return float(convert(1.0, symbol, unit)) - float(convert(0.0, symbol, unit))


def write_out(axis: Axis) -> None:
    """Write the values of an axis without a common offset or factor."""
    formatter = ScalarFormatter(useOffset=False)
    formatter.set_scientific(False)
    axis.set_major_formatter(formatter)


def few_labels(axis: Axis, room: float, most: int = 5) -> None:
    """Label an abscissa with as many values as fit, after its data are drawn.

    Parameters
    ----------
    axis
        The abscissa.
    room
        Approximate length of the axis [inch].
    most
        Maximum number of values.
    """
    write_out(axis)
    formatter = axis.get_major_formatter()
    low, high = sorted(axis.get_view_interval())

    def fits(places: Sequence[float]) -> bool:
        longest = max(map(len, formatter.format_ticks(list(places))), default=0)
        step = np.min(np.diff(places), initial=high - low)
        is_apart = room * step >= (high - low) * (longest + _GAP) * CHARACTER
        return len(places) <= most and bool(is_apart)

    rows = []
    for count in range(most + 1, 0, -1):  # about this number of intervals
        locator = MaxNLocator(nbins=count, steps=[1, 2, 2.5, 5, 10], min_n_ticks=1)
        rows.append([at for at in locator.tick_values(low, high) if low <= at <= high])
    # A single value shows no scale, so the ends of a finer row are labeled if the row does not fit.
    ends = [[row[0], row[-1]] for row in rows if len(row) > 1]
    several = [row for row in rows if len(row) > 1]
    for places in (*several, *ends, *rows):
        axis.set_major_locator(FixedLocator(places))
        if fits(places):
            return


def beyond(limit: float, values: Array) -> int:
    """Return the side of a limit that is too far away to show with the values; 0: neither side."""
    if not values.size:
        return 0
    low, high = float(values.min()), float(values.max())
    reach = (high - low) or max(abs(high), 1e-12)
    return int(limit > high + reach) - int(limit < low - reach)


def limit_text(limit: float, symbol: str, size: float) -> str:
    """Return the note at the edge of an axis that does not reach a limit.

    ``size``: maximum magnitude on the axis, in ``symbol``; it determines the unit.
    """
    return f"limit {amount(limit, symbol, like=size)}"


def name_beyond(
    axes: Axes, text: str, far: int, color: str, place: Literal["left", "right"] | None = None
) -> None:
    """Write a limit beyond the abscissa above the axes, where nothing is drawn.

    Parameters
    ----------
    axes
        Axes without a title there.
    text
        Text of `limit_text`.
    far
        Side of the limit (see `beyond`).
    color
        Color of the text.
    place
        Position of the text. Default: that side.
    """
    axes.set_title(
        f"{text} →" if far > 0 else f"← {text}",
        loc=place or ("right" if far > 0 else "left"),
        fontsize=style.TEXT_SIZE,
        color=color,
    )
