"""Sliders in a notebook. Each change reruns the bench, and updates the figure and the table."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from html import escape
from io import BytesIO
from typing import Any, Protocol

from bywire.core.errors import BywireError, ParameterError, unknown_name
from bywire.core.parameters import Leaf, ParameterSet, leaf_fields
from bywire.core.quantities import display_unit
from bywire.core.units import convert, unit_text
from bywire.data.file_format import library
from bywire.export.exported import finite_range
from bywire.report.page import table_html
from bywire.report.tables import KpiRow, kpi_table

_REACH = 4.0  # factor from a positive value to either end of its slider
_DPI = 110


class Shown(Protocol):
    """Result of a bench that the widget shows."""

    @property
    def rows(self) -> list[KpiRow]:
        """The key figures with their requirements."""
        ...

    def plot(self, name: str = "") -> Any:
        """Return a figure."""
        ...


def sliders(
    result: Shown,
    par: ParameterSet,
    parameters: Sequence[str],
    figure: str,
    run: Callable[[Mapping[str, float]], Shown],
) -> Any:
    """Return a widget with a slider for each parameter.

    Parameters
    ----------
    result, par
        First result, and the parameters of its bench.
    parameters, figure
        See `bywire.api.run.BenchResult.interact`.
    run
        Function that returns the result for changed parameters.
    """
    widgets = library("ipywidgets", "sliders in a notebook", "notebook")
    controls = {name: _slider(widgets, par, name) for name in parameters}
    image, table, message = widgets.Image(format="png"), widgets.HTML(), widgets.HTML()

    def show(shown: Shown) -> None:
        image.value = _png(shown.plot(figure))
        table.value = f'<div class="bywire">{table_html(kpi_table(shown.rows))}</div>'
        message.value = ""

    def rerun(_: Any) -> None:
        changes = {name: value() for name, (_, value) in controls.items()}
        try:
            show(run(changes))
        except BywireError as error:  # the sliders stay usable
            message.value = f"<b>{escape(str(error))}</b>"

    show(result)
    for slider, _ in controls.values():
        slider.observe(rerun, names="value")
    return widgets.VBox([*(slider for slider, _ in controls.values()), message, image, table])


def _slider(widgets: Any, par: ParameterSet, name: str) -> tuple[Any, Any]:
    """Return a parameter's slider, and a function that returns its value [SI]."""
    known, values = leaf_fields(type(par)), par.leaves()
    if name not in known or name not in values:
        raise unknown_name("parameter", name, [each for each in values if each in known])
    leaf, start = known[name], values[name]
    low, high = ends_of(leaf, start)
    symbol = leaf.unit.symbol
    unit = display_unit(symbol)
    shown = [float(convert(value, symbol, unit)) for value in (low, high, start)]
    label = f"{name} [{unit_text(unit)}]" if symbol != "1" else name
    common = {
        "description": label,
        "continuous_update": False,
        "style": {"description_width": "initial"},
        "layout": {"width": "36rem"},
    }
    if leaf.is_whole:
        slider = widgets.IntSlider(
            value=round(start), min=math.ceil(low), max=math.floor(high), **common
        )
    elif shown[0] > 0.0:
        slider = widgets.FloatLogSlider(
            value=shown[2],
            min=math.log10(shown[0]),
            max=math.log10(shown[1]),
            step=math.log10(shown[1] / shown[0]) / 200.0,
            readout_format=".4g",
            **common,
        )
    else:
        slider = widgets.FloatSlider(
            value=shown[2],
            min=shown[0],
            max=shown[1],
            step=(shown[1] - shown[0]) / 200.0,
            readout_format=".4g",
            **common,
        )

    def value() -> float:
        if slider.value == shown[2]:
            return start  # to the last bit
        moved = float(convert(float(slider.value), unit, symbol))
        return min(max(moved, low), high)

    return slider, value


def ends_of(leaf: Leaf, start: float) -> tuple[float, float]:
    """Return the ends of a parameter's slider [SI], around its value and within its range.

    Raises
    ------
    ParameterError
        If the value is 0 and the range has no ends.
    """
    low, high = finite_range(leaf)
    if low == 0.0 and high == 1.0:
        return low, high
    if start > 0.0:
        least, most = start / _REACH, start * _REACH
    elif start < 0.0:
        least, most = 3.0 * start, -start
    elif low is not None and high is not None:
        return low, high
    else:
        raise ParameterError(
            f"{leaf.name} is 0 and its range ({leaf.range_text}) has no limits, so it has no "
            f"slider. Change it first, for example with bywire.run(..., {{{leaf.name!r}: VALUE}})",
            name=leaf.name,
            value="0",
        )
    return (
        least if low is None else max(least, low),
        most if high is None else min(most, high),
    )


def _png(figure: Any) -> bytes:
    stream = BytesIO()
    figure.savefig(stream, format="png", dpi=_DPI)
    return stream.getvalue()
