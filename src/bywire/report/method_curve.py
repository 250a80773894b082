"""Figure: a curve of an identification, measured beside modeled, or a value with its band."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bywire.core.quantities import display_unit
from bywire.core.units import convert
from bywire.identification.method import Curve
from bywire.report import style
from bywire.report.channel import FloatArray
from bywire.report.decimation import kept_samples
from bywire.report.wording import amount

_FEW = 30  # points: each was measured by itself, and has a marker
_MOST = 6  # curves of a family that have a color each


def method_curve(curve: Curve) -> Figure:
    """Draw measured and modeled with their difference below, or values with 95 % bands."""
    if "measured" in curve.data and "modeled" in curve.data:
        return _beside(curve)
    figure, (axes,) = style.new_figure(3.8)
    _bands(axes, curve)
    return figure


def _beside(curve: Curve) -> Figure:
    figure, (upper, lower) = style.new_figure(4.4, (2.4, 1.0))
    data, x = curve.data, curve.x
    at = _abscissa(data, x)
    for k, label in _family(data["measured"], x):
        measured, modeled = (_row(data[name], x, k) for name in ("measured", "modeled"))
        own = style.SEQUENCE[k % _MOST]
        for values, role, word in (
            (measured, style.Role.MEASURED, "measured"),
            (modeled, style.Role.SIMULATED, "modeled"),
        ):
            look = style.STROKES[role]
            upper.plot(
                *_drawn(at, values), color=own if label else look.color, zorder=look.zorder,
                linestyle=look.linestyle, linewidth=look.linewidth, markersize=3.0,
                marker="o" if at.size <= _FEW else None,
                label=style.plain(f"{label} {word}".strip()),
            )  # fmt: skip
        shown = own if label else style.PURPLE
        lower.plot(*_drawn(at, modeled - measured), linewidth=0.9, color=shown)
    for name in (str(k) for k in data.data_vars if k not in ("measured", "modeled")):
        look = style.STROKES[style.Role.SECOND]
        upper.plot(
            *_drawn(at, _row(data[name], x, 0)), color=look.color, zorder=look.zorder,
            linestyle=look.linestyle, linewidth=look.linewidth, label=style.plain(name),
        )  # fmt: skip
    lower.axhline(0.0, color=style.GRAY, linewidth=0.6)
    for axes in (upper, lower):
        axes.margins(x=0.0)
        if x == "frequency":
            axes.set_xscale("log")
    symbol = str(data["measured"].attrs.get("units", "1"))
    name = str(data["measured"].attrs.get("long_name", "value"))
    upper.set_ylabel(style.axis_label(name, symbol))
    lower.set_ylabel(style.axis_label("difference", symbol, "\n"))
    lower.set_xlabel(_x_label(data, x))
    style.few_ticks(lower, 4)
    style.legend_above(upper)
    figure.align_ylabels([upper, lower])
    return figure


def _bands(axes: Axes, curve: Curve) -> None:
    data, x = curve.data, curve.x
    at = _abscissa(data, x)
    for k, label in _family(data["value"], x):
        color = style.SEQUENCE[k % len(style.SEQUENCE)]
        if "low" in data and "high" in data:
            low, high = _row(data["low"], x, k), _row(data["high"], x, k)
            axes.fill_between(at, low, high, color=color, alpha=0.25, linewidth=0.0)
        name = label or "modeled"
        word = f"{name}, 95 % band" if "low" in data and not label else name
        axes.plot(
            at, _row(data["value"], x, k), color=color, linewidth=1.3,
            label=style.plain(word),
        )  # fmt: skip
        if "measured" in data:
            axes.plot(
                at, _row(data["measured"], x, k), "o", color=color, markersize=3.0,
                label=style.plain(f"{label} measured".strip()),
            )  # fmt: skip
    axes.margins(x=0.01)
    axes.set_xlabel(_x_label(data, x))
    value = data["value"]
    axes.set_ylabel(
        style.axis_label(str(value.attrs.get("long_name", "value")), value.attrs.get("units", "1"))
    )
    style.legend_above(axes)


def _drawn(at: FloatArray, values: FloatArray) -> tuple[FloatArray, ...]:
    """Return a line with fewer points where its abscissa does not turn back."""
    if np.all(np.diff(at) >= 0.0):
        keep = kept_samples(at, values)
        return at[keep], values[keep]
    return at, values


def _family(array: xr.DataArray, x: str) -> list[tuple[int, str]]:
    """Return number and label of each curve; one without a label where there is no family."""
    others = [dim for dim in array.dims if dim != x]
    if not others:
        return [(0, "")]
    (other,) = others
    axis = array[other]
    unit = str(axis.attrs.get("units", "1"))
    return [
        (k, amount(float(v), unit) if axis.dtype.kind in "fiu" else str(v))
        for k, v in enumerate(axis.values)
    ]


def _row(array: xr.DataArray, x: str, k: int) -> FloatArray:
    others = [dim for dim in array.dims if dim != x]
    one = array.isel({others[0]: k}) if others else array
    values = np.asarray(one.values, dtype=float)
    symbol = str(array.attrs.get("units", "1"))
    return np.asarray(values * convert(1.0, symbol, display_unit(symbol)))


def _abscissa(data: xr.Dataset, x: str) -> FloatArray:
    symbol = str(data[x].attrs.get("units", "s" if x == "time" else "1"))
    factor = convert(1.0, symbol, display_unit(symbol))
    return np.asarray(data[x].values, dtype=float) * factor


def _x_label(data: xr.Dataset, x: str) -> str:
    symbol = str(data[x].attrs.get("units", "s" if x == "time" else "1"))
    return style.axis_label(str(data[x].attrs.get("long_name", x)), symbol)
