"""Figures of identifications and replays: measured and modeled, residuals, correlations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bywire.core.typing import Array
from bywire.core.units import convert, difference_unit, display_factor
from bywire.identification.confidence import autocorrelation
from bywire.identification.estimate import Estimate
from bywire.identification.method import Curve
from bywire.identification.replay_fit import SegmentFit
from bywire.identification.tracking import Track
from bywire.report import style
from bywire.report.channel import axis_unit, channel, decimate, kept_samples
from bywire.report.panels import Role
from bywire.report.wording import amount, in_display_unit

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NAMED = 8  # maximum number of records with room for their names
_ROOM = 0.06  # fraction of the first panel's height for the names


def mark_records(panels: Sequence[Axes], at: xr.DataArray) -> None:
    """Draw a thin line between records, and their names at the top of the first panel.

    Parameters
    ----------
    panels
        Panels with a common abscissa.
    at
        The abscissa in display units; its coordinate ``record`` names each sample's record. Without
        this coordinate, the function draws nothing.
    """
    if "record" not in at.coords or at.coords["record"].dims != at.dims:
        return
    names, places = at.coords["record"].values, at.values
    starts = np.concatenate(([0], np.flatnonzero(names[1:] != names[:-1]) + 1))
    ends = [*starts[1:].tolist(), len(names)]
    if len(ends) <= _NAMED:
        low, high = panels[0].get_ylim()
        panels[0].set_ylim(low, high + _ROOM * (high - low))
    for start, end in zip(starts.tolist(), ends, strict=True):
        if start > 0:
            border = 0.5 * float(places[start - 1] + places[start])
            for axes in panels:
                axes.axvline(border, color=style.GRAY, linewidth=0.5, zorder=1.0)
        if len(ends) <= _NAMED:
            middle = 0.5 * float(places[start] + places[end - 1])
            panels[0].annotate(
                style.plain(names[start], 16),
                (middle, 1.0),
                xycoords=("data", "axes fraction"),
                ha="center",
                va="top",
                color=style.GRAY,
                fontsize=style.TEXT_SIZE - 1.5,
            )


# --- Measured and modeled curves, and values with their bands

_MOST = 6  # maximum number of curves in a family that have different colors
_LINE = 1.3  # width of the center line of a band [pt]


def method_curve(curve: Curve) -> Figure:
    """Draw measured and modeled with their difference below, or values with 95 % bands.

    If there are only a few measured points, no line connects them. Thin lines and names separate
    successive records.
    """
    if "measured" in curve.data and "modeled" in curve.data:
        return _beside(curve)
    figure, (axes,) = style.new_figure(3.8)
    _bands(axes, curve)
    return figure


def _beside(curve: Curve) -> Figure:
    figure, (upper, lower) = style.new_figure(4.4, (2.4, 1.0))
    data, x = curve.data, curve.x
    sparse = False
    for k, label in _family(data["measured"], data[x]):
        at = _abscissa(data, x, k)
        measured, modeled = (_row(data[name], data[x], k) for name in ("measured", "modeled"))
        few = int(np.isfinite(measured).sum()) <= style.FEW
        color = style.SEQUENCE[k % _MOST] if label else ""
        _draw_pair(upper, at, (measured, modeled), label, color, few)
        _draw(lower, at, modeled - measured, few, color=color or style.PURPLE, linewidth=0.9)
        sparse = sparse or few
    for name in (str(k) for k in data.data_vars if k not in ("measured", "modeled")):
        look = style.STROKES[Role.SECOND]
        upper.plot(
            *_drawn(_abscissa(data, x, 0), _row(data[name], data[x], 0)),
            color=look.color,
            zorder=look.zorder,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            label=style.plain(name),
        )
    lower.axhline(0.0, color=style.GRAY, linewidth=0.6)
    for axes in (upper, lower):
        axes.margins(x=0.02 if sparse else 0.0)
    symbol = str(data["measured"].attrs.get("units", "1"))
    name = str(data["measured"].attrs.get("long_name", "value"))
    upper.set_ylabel(style.axis_label(name, symbol))
    lower.set_ylabel(style.axis_label("difference", symbol, "\n"))
    lower.set_xlabel(_x_label(data, x))
    if x == "frequency":
        _over_frequency(upper, lower, symbol)
    mark_records((upper, lower), data[x])
    style.few_ticks(lower, 4)
    style.legend_above(upper)
    figure.align_ylabels([upper, lower])
    return figure


def _over_frequency(upper: Axes, lower: Axes, symbol: str) -> None:
    """Make the axes of frequency and gain logarithmic, but not that of phase."""
    lower.set_xscale("log")
    style.log_ticks(lower.xaxis)
    if symbol not in ("degree", "rad"):
        upper.set_yscale("log")
        style.log_ticks(upper.yaxis)


def _draw_pair(
    axes: Axes,
    at: Array,
    pair: tuple[Array, Array],
    label: str,
    color: str,
    few: bool,
) -> None:
    """Draw measured and modeled; a family's measured curves are wide and pale, one color each."""
    for values, role, word in zip(
        pair, (Role.MEASURED, Role.SIMULATED), ("measured", "modeled"), strict=True
    ):
        if not np.isfinite(values).any():
            continue
        look = style.STROKES[role]
        wide = bool(color) and role is Role.MEASURED and not few
        _draw(
            axes,
            at,
            values,
            few and role is Role.MEASURED,
            color=color or look.color,
            zorder=look.zorder,
            linestyle=look.linestyle,
            alpha=0.4 if wide else 1.0,
            linewidth=3.0 if wide else look.linewidth,
            label=style.plain(f"{label} {word}".strip()),
        )


def _draw(axes: Axes, at: Array, values: Array, alone: bool, **look: object) -> None:
    """Draw a line, or separate points."""
    if alone:
        look |= {"linestyle": "none", "marker": "o", "markersize": 3.5}
    axes.plot(*_drawn(at, values), **look)  # type: ignore[arg-type]


def _bands(axes: Axes, curve: Curve) -> None:
    from matplotlib.patches import Patch

    data, x = curve.data, curve.x
    banded = "low" in data and "high" in data
    family = _family(data["value"], data[x])
    for k, label in family:
        at = _abscissa(data, x, k)
        color = style.SEQUENCE[k % len(style.SEQUENCE)]
        if banded:
            low, high = _row(data["low"], data[x], k), _row(data["high"], data[x], k)
            axes.fill_between(at, low, high, color=color, alpha=0.25, linewidth=0.0)
        axes.plot(
            at,
            _row(data["value"], data[x], k),
            color=color,
            linewidth=_LINE,
            label=style.plain(label or "modeled"),
        )
        if "measured" in data:
            axes.plot(
                at,
                _row(data["measured"], data[x], k),
                "o",
                color=color,
                markersize=3.0,
                label=style.plain(f"{label} measured".strip()),
            )
    axes.margins(x=0.01)
    axes.set_xlabel(_x_label(data, x))
    value = data["value"]
    axes.set_ylabel(
        style.axis_label(str(value.attrs.get("long_name", "value")), value.attrs.get("units", "1"))
    )
    entries = list(axes.get_legend_handles_labels()[0])
    if banded:
        shade = style.GRAY if len(family) > 1 else style.SEQUENCE[0]
        half = 0.5 * np.asarray(data["high"].values - data["low"].values, dtype=float)
        label = _band_label(axes, half, str(value.attrs.get("units", "1")))
        entries.append(Patch(color=shade, alpha=0.25, linewidth=0.0, label=label))
    style.legend_above(axes, entries)


def _drawn(at: Array, values: Array) -> tuple[Array, ...]:
    """Return a line with fewer points if its abscissa is monotonic."""
    if np.all(np.diff(at) >= 0.0):
        keep = kept_samples(at, values)
        return at[keep], values[keep]
    return at, values


def _family(array: xr.DataArray, x: xr.DataArray) -> list[tuple[int, str]]:
    """Return number and label of each curve; a single curve has no label."""
    others = [dim for dim in array.dims if dim != x.dims[-1]]
    if not others:
        return [(0, "")]
    (other,) = others
    axis = array[other]
    unit = str(axis.attrs.get("units", "1"))
    return [
        (k, amount(float(v), unit) if axis.dtype.kind in "fiu" else str(v))
        for k, v in enumerate(axis.values)
    ]


def _row(array: xr.DataArray, x: xr.DataArray, k: int) -> Array:
    """Return a curve of a family in its display unit."""
    others = [dim for dim in array.dims if dim != x.dims[-1]]
    curve = array.isel({others[0]: k}) if others else array
    values = np.asarray(curve.values, dtype=float)
    symbol = str(array.attrs.get("units", "1"))
    return in_display_unit(values, symbol)[0]


def _abscissa(data: xr.Dataset, x: str, k: int) -> Array:
    """Return the abscissa of a curve in the display unit: common to all curves, or its own."""
    symbol = str(data[x].attrs.get("units", "s" if x == "time" else "1"))
    values = in_display_unit(np.asarray(data[x].values, dtype=float), symbol)[0]
    return np.asarray(values[k] if values.ndim > 1 else values)


def _x_label(data: xr.Dataset, x: str) -> str:
    symbol = str(data[x].attrs.get("units", "s" if x == "time" else "1"))
    return style.axis_label(str(data[x].attrs.get("long_name", x)), symbol)


def _band_label(axes: Axes, half: Array, symbol: str) -> str:
    """Return the legend of a 95 % band: its width, and whether the center line hides the band.

    ``half`` widths of the band are in ``symbol``, NaN where there is none; the drawn data set the
    limits of the axes.
    """
    if not np.isfinite(half).any():
        return "95 % band"
    most = float(np.nanmax(half))
    low, high = axes.get_ylim()
    figure = axes.get_figure()
    points = 0.0 if figure is None else 72.0 * axes.bbox.height / figure.dpi
    drawn = 2.0 * display_factor(symbol) * most / max(abs(high - low), 1e-300) * points
    hidden = ", hidden by the line" if drawn < _LINE else ""
    return f"95 % band (± {amount(most, difference_unit(symbol), 2)} at most{hidden})"


# --- Residuals: in their order, their distribution, their autocorrelation

_LAGS = 60
_SURE = 1.96  # standard deviations that contain 95 % of the correlations of white residuals


def residual_figure(estimate: Estimate) -> Figure:
    """Draw the residuals of a model.

    Weighted residuals in order, their histogram with the normal distribution of the same variance,
    and their autocorrelation with the band for white residuals.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    r = estimate.residuals
    figure = Figure(figsize=(style.WIDTH, 4.6), layout="constrained", facecolor="white")
    grid = figure.add_gridspec(2, 2)
    whole = figure.add_subplot(grid[0, :])
    spread, together = figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1])
    for axes in (whole, spread, together):
        style.dress(axes)
    order = np.arange(1, r.size + 1, dtype=float)
    few = r.size <= style.FEW
    look = {"linestyle": "none", "marker": "o", "markersize": 3.5} if few else {"linewidth": 0.8}
    whole.plot(*decimate(order, r), color=style.BLUE, **look)
    whole.axhline(0.0, color=style.GRAY, linewidth=0.6)
    whole.margins(x=0.02 if few else 0.0)
    whole.set_xlabel("number of measured value")
    whole.set_ylabel("weighted residual [-]")
    _histogram(spread, r)
    lags = min(_LAGS, max(r.size // 2, 1))
    rho = autocorrelation(r, lags)
    together.vlines(np.arange(1, lags + 1), 0.0, rho[1:], color=style.BLUE, linewidth=1.2)
    for end in (-_SURE, _SURE):
        limit = end / np.sqrt(r.size)
        label = "95 % band of white residuals" if end > 0 else None
        together.axhline(limit, color=style.VERMILLION, linestyle=":", linewidth=1.2, label=label)
    lowest = min(-0.2, float(rho.min()), -_SURE / np.sqrt(r.size))
    together.set_ylim(lowest - 0.05, 1.0)
    for axes in (whole, together):
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    together.set_xlabel("lag [samples]")
    together.set_ylabel("autocorrelation [-]")
    style.legend_above(together)
    return figure


def _histogram(axes: Axes, r: Array) -> None:
    size = float(r.std()) or 1.0
    axes.hist(r, bins=min(max(r.size // 20, 8), 60), density=True, color=style.SKY)
    at = np.linspace(float(r.min()), float(r.max()), 200)
    normal = np.exp(-0.5 * ((at - r.mean()) / size) ** 2) / (size * np.sqrt(2.0 * np.pi))
    axes.plot(at, normal, color=style.VERMILLION, linestyle="--", label="normal, same variance")
    axes.set_xlabel("weighted residual [-]")
    axes.set_ylabel("density [-]")
    style.legend_above(axes)


# --- Correlations: which unknowns the data hardly separate

_NUMBERED = 14  # maximum number of unknowns with room for numbers


def correlation_matrix(estimate: Estimate) -> Figure:
    """Draw the correlation matrix with its numbers; blue is negative, red is positive."""
    names, c = estimate.names, estimate.correlation
    size = len(names)
    height = min(max(1.6 + 0.36 * size, 2.4), 6.5)
    from matplotlib.figure import Figure

    figure = Figure(figsize=(style.WIDTH, height), layout="constrained", facecolor="white")
    axes = figure.subplots()
    image = axes.imshow(c, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    axes.set_xticks(range(size), [style.plain(n, 24) for n in names], rotation=40, ha="right")
    axes.set_yticks(range(size), [style.plain(n, 24) for n in names])
    axes.tick_params(labelsize=style.TEXT_SIZE, length=0.0)
    axes.spines[:].set_visible(False)
    if size <= _NUMBERED:
        for (row, column), value in np.ndenumerate(c):
            axes.text(
                column,
                row,
                f"{value:.2f}",
                ha="center",
                va="center",
                fontsize=style.TEXT_SIZE - 1.5,
                color="white" if abs(value) > 0.6 else style.BLACK,
            )
    bar = figure.colorbar(image, ax=axes, shrink=0.9)
    bar.set_label("correlation [-]", fontsize=style.TEXT_SIZE)
    bar.ax.tick_params(labelsize=style.TEXT_SIZE)
    return figure


# --- Replays


def replay_figure(
    name: str, pair: xr.Dataset, inputs: xr.Dataset, fits: Sequence[SegmentFit]
) -> Figure:
    """Draw demand, measured (solid blue) and simulated (dashed red), and simulated minus measured.

    Thin lines separate segments. Segments that miss a tolerance are shaded.

    Parameters
    ----------
    name
        The signal.
    pair
        ``measured`` and ``modeled`` over ``time`` [s].
    inputs
        Inputs of the model.
    fits
        Fit of each segment.
    """
    figure, (top, middle, bottom) = style.new_figure(5.6, (0.8, 2.2, 1.0))
    scale, unit = style.time_scale(pair["time"].values)
    demand = axis_unit([inputs], *map(str, inputs.data_vars))
    for k, stimulus in enumerate(map(str, inputs.data_vars)):
        shown = channel(inputs, stimulus, demand)
        color = style.SEQUENCE[k % len(style.SEQUENCE)] if len(inputs.data_vars) > 1 else None
        look = style.STROKES[Role.SET_POINT]
        top.plot(
            *decimate(scale * shown.time, shown.values),
            color=color or look.color,
            linewidth=look.linewidth,
            label=style.plain(shown.label),
        )
        top.set_ylabel(style.unit_label("demand", demand, "\n"))
    symbol = str(pair["measured"].attrs.get("units", "1"))
    readable = axis_unit([pair], "measured", "modeled")
    for values, role, word in (
        (pair["measured"].values, Role.MEASURED, "measured"),
        (pair["modeled"].values, Role.SIMULATED, "simulated"),
    ):
        look = style.STROKES[role]
        middle.plot(
            *decimate(scale * pair["time"].values, convert(values, symbol, readable)),
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            zorder=look.zorder,
            label=word,
        )
    factor = convert(1.0, symbol, readable) - convert(0.0, symbol, readable)
    error = factor * (pair["modeled"].values - pair["measured"].values)
    bottom.plot(*decimate(scale * pair["time"].values, error), color=style.PURPLE, linewidth=0.9)
    bottom.axhline(0.0, color=style.GRAY, linewidth=0.6)
    label = str(pair["measured"].attrs.get("long_name", name))
    middle.set_ylabel(style.unit_label(label, readable))
    bottom.set_ylabel(style.unit_label("difference", readable, "\n"))
    bottom.set_xlabel(f"time [{unit}]")
    _segments((middle, bottom), fits, scale)
    for axes in (top, middle, bottom):
        axes.margins(x=0.0)
    for axes in (top, bottom):
        style.few_ticks(axes, 4)
    style.legend_above(top)
    style.legend_above(middle)
    figure.align_ylabels([top, middle, bottom])
    return figure


def _segments(panels: Sequence[Axes], fits: Sequence[SegmentFit], scale: float) -> None:
    if len(fits) < 2 and all(v.met for fit in fits for v in fit.verdicts):
        return
    label: str | None = "tolerance missed"
    for fit in fits:
        missed = any(not v.met for v in fit.verdicts)
        for axes in panels:
            axes.axvline(scale * fit.segment.start, color=style.GRAY, linewidth=0.5, zorder=1.0)
            if missed:
                axes.axvspan(
                    scale * fit.segment.start,
                    scale * fit.segment.stop,
                    color=style.ORANGE,
                    alpha=0.15,
                    linewidth=0.0,
                    zorder=0.5,
                    label=label,
                )
                label = None
        if len(fits) <= _NAMED:
            middle = scale * float(np.mean([fit.segment.start, fit.segment.stop]))
            panels[0].annotate(
                style.plain(fit.segment.name, 16),
                (middle, 1.0),
                xycoords=("data", "axes fraction"),
                ha="center",
                va="top",
                color=style.GRAY,
                fontsize=style.TEXT_SIZE - 1.5,
            )


# --- A drifting parameter, tracked, with its confidence band


def track_figure(track: Track, known: float | None = None) -> Figure:
    """Draw the tracked parameter over time with its 95 % band.

    Parameters
    ----------
    track
        Tracking result; its first parameter is drawn.
    known
        Value of the parameter set, drawn as a dashed line.
    """
    figure, (axes,) = style.new_figure(3.6)
    data, name = track.data.isel(parameter=0), track.relation.parameter
    symbol = track.relation.units[0]
    scale, unit = style.time_scale(data["time"].values)
    t, used = scale * data["time"].values, data["used"].values > 0
    begun = np.cumsum(used) > 0
    low, high, value = (
        in_display_unit(data[n].values, symbol)[0] for n in ("low", "high", "value")
    )
    axes.fill_between(
        t[begun],
        low[begun],
        high[begun],
        color=style.SKY,
        alpha=0.45,
        linewidth=0.0,
        label="95 % band",
    )
    axes.plot(t[begun], value[begun], color=style.BLUE, linewidth=1.2, label="tracked")
    axes.plot(
        t[used],
        value[used],
        "o",
        color=style.BLUE,
        markersize=2.5,
        label="where the relation holds",
    )
    if known is not None:
        known = in_display_unit(known, symbol)[0]
        look = style.STROKES[Role.SET_POINT]
        axes.axhline(
            known,
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            label="parameter set",
        )
    if begun.any():
        center = np.concatenate((value[used], [] if known is None else [known]))
        reach = float(np.median((high - low)[used]))
        axes.set_ylim(float(center.min()) - 2.0 * reach, float(center.max()) + 2.0 * reach)
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.margins(x=0.0)
    axes.set_ylabel(style.axis_label(name, symbol))
    axes.set_xlabel(f"time [{unit}]")
    style.legend_above(axes)
    return figure
