"""Axes of figures of studies: readable units, labels that never touch, limits that lie far off."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axis import Axis
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from bywire.core.quantities import display_unit
from bywire.core.typing import Array
from bywire.core.units import display_factor
from bywire.report import style
from bywire.report.wording import measured_amount, unit_text

_CHARACTER = 0.62 * style.TEXT_SIZE / 72.0  # width of a digit [inch], rounded off
_GAP = 2  # characters between two labels, at least
_PLAIN = (1e-2, 1e5)  # the largest magnitude that is written without a power of ten


@dataclass(frozen=True)
class Scale:
    """How an axis writes values: times ``factor``, in ``unit``."""

    factor: float
    unit: str

    def label(self, name: str, gap: str = " ") -> str:
        """Return the label of the axis; ``gap`` stands between name and unit."""
        return f"{style.plain(name, 40)}{gap}[{style.plain(self.unit, 20) or '-'}]"


def scale_of(values: Array, symbol: str) -> Scale:
    """Return the scale in which values read best.

    That is the display unit, ms for times below 1 s, with a power of ten where figures are too
    small or too large to be written out.

    Parameters
    ----------
    values
        In ``symbol``; NaN where there is none.
    symbol
        SI unit, or ``"%"``.

    Examples
    --------
    >>> scale_of(np.array([0.06]), "s"), scale_of(np.array([1.1e6]), "N/m")
    (Scale(factor=1000.0, unit='ms'), Scale(factor=1e-06, unit='10⁶ N/m'))
    """
    factor, unit = display_factor(symbol), display_unit(symbol)
    if unit == "degC":  # an axis has a factor and no offset
        unit = "K"
    largest = float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
    if symbol == "s" and 0.0 < largest < 1.0:
        factor, unit = 1e3, "ms"
    text, largest = unit_text(unit), factor * largest
    if largest == 0.0 or _PLAIN[0] <= largest < _PLAIN[1]:
        return Scale(factor, text)
    power = 3 * math.floor(math.log10(largest) / 3.0)
    return Scale(factor * 10.0**-power, f"{unit_text(f'10**{power}')} {text}".strip())


def write_out(axis: Axis) -> None:
    """Write the values of an axis out: no offset and no factor beside it."""
    formatter = ScalarFormatter(useOffset=False)
    formatter.set_scientific(False)
    axis.set_major_formatter(formatter)


def few_labels(axis: Axis, room: float, most: int = 5) -> None:
    """Label an abscissa, once its data are drawn, with as many values as have room.

    Parameters
    ----------
    axis
        The abscissa.
    room
        About how long it is [inch].
    most
        Values at most.
    """
    write_out(axis)
    formatter = axis.get_major_formatter()
    low, high = sorted(axis.get_view_interval())
    for count in range(most, 0, -1):
        locator = MaxNLocator(nbins=count, steps=[1, 2, 2.5, 5, 10], min_n_ticks=1)
        axis.set_major_locator(locator)
        places = [at for at in locator.tick_values(low, high) if low <= at <= high]
        longest = max(map(len, formatter.format_ticks(places)), default=0)
        step = np.min(np.diff(places), initial=high - low)
        is_apart = room * step >= (high - low) * (longest + _GAP) * _CHARACTER
        if len(places) <= most and is_apart:
            return


def beyond(limit: float, values: Array) -> int:
    """Return on which side a limit lies so far off that it would squeeze values; 0: on none."""
    if not values.size:
        return 0
    low, high = float(values.min()), float(values.max())
    reach = (high - low) or max(abs(high), 1e-12)
    return int(limit > high + reach) - int(limit < low - reach)


def limit_text(limit: float, symbol: str) -> str:
    """Return what stands at the edge of an axis that does not reach a limit."""
    return f"limit {measured_amount(limit, symbol, 0.0)}"
