"""Figures of varied quantities: key figures versus a range, a quantity versus two parameters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, Protocol

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from bywire.bench.bench import Bench
from bywire.bench.running import Result
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.panels import Role
from bywire.report.readable_axis import scale_of
from bywire.report.wording import in_display_unit
from bywire.synthesis.study import Map

if TYPE_CHECKING:
    import xarray as xr

_COLUMNS = 2
_HEIGHT = 1.35  # height of a panel [inch]


class Varied(Protocol):
    """Results of a bench for every value of a range, such as a `BenchRange`."""

    @property
    def bench(self) -> Bench:
        """The bench."""
        ...

    @property
    def name(self) -> str:
        """Name of the varied quantity."""
        ...

    @property
    def unit(self) -> str:
        """Its SI unit."""
        ...

    @property
    def values(self) -> tuple[float, ...]:
        """Its values."""
        ...

    @property
    def results(self) -> tuple[Result, ...]:
        """Result for each of them."""
        ...


def kpi_curves(varied: Varied) -> Figure:
    """Draw every key figure that changes over the range, each in its own panel.

    The figure shows limits of requirements. Points that miss them are crosses.
    """
    shown = {name: pair for name, pair in _kpi_lines(varied).items() if _moves(pair[0])}
    shown = shown or _kpi_lines(varied)
    count = max(len(shown), 1)
    rows = -(-count // _COLUMNS)
    figure = Figure(
        figsize=(style.WIDTH, 0.6 + _HEIGHT * rows), layout="constrained", facecolor="white"
    )
    grid = figure.subplots(rows, _COLUMNS, sharex=True, squeeze=False)
    abscissa = in_display_unit(np.array(varied.values), varied.unit)[0]
    for axes, name in zip(grid.flat, shown, strict=False):
        style.dress(axes)
        values, errors, unit = shown[name]
        scale = scale_of(values, unit)
        values, errors = scale(values), scale.factor * errors
        known = np.isfinite(errors)
        axes.errorbar(
            abscissa[known],
            values[known],
            errors[known],
            fmt="none",
            ecolor=style.BLUE,
            elinewidth=0.8,
            capsize=2.0,
        )
        axes.plot(abscissa, values, color=style.BLUE, linewidth=1.0, marker="o", markersize=3.0)
        if (limit := varied.bench.limits.get(name)) is not None:
            look = style.STROKES[Role.LIMIT]
            axes.axhline(
                scale(limit.bound),
                color=look.color,
                linestyle=look.linestyle,
                linewidth=look.linewidth,
            )
            missed = _missed(name, varied.results)
            axes.plot(
                abscissa[missed],
                values[missed],
                color=look.color,
                marker="x",
                linestyle="none",
                markersize=6.0,
            )
        style.few_ticks(axes, 4)
        axes.set_ylabel(scale.label(name.replace("_", " "), "\n"))
    for spare in list(grid.flat)[len(shown) :]:
        spare.set_visible(False)
    for axes in list(grid.flat)[max(count - _COLUMNS, 0) : count]:
        axes.set_xlabel(style.axis_label(varied.name, varied.unit))
        axes.tick_params(labelbottom=True)
    return figure


def _kpi_lines(varied: Varied) -> dict[str, tuple[Array, Array, str]]:
    """Return value and error by case, and unit, of every key figure by name."""
    units = {kpi.name: kpi.unit for result in varied.results for kpi in result.kpis}
    each = [{kpi.name: (kpi.value, kpi.bound) for kpi in r.kpis} for r in varied.results]
    lacking = (math.nan, math.nan)
    return {
        name: (*np.array([known.get(name, lacking) for known in each]).T, unit)
        for name, unit in units.items()
    }


def _moves(values: Array) -> bool:
    finite = values[np.isfinite(values)]
    return finite.size > 0 and bool(np.ptp(finite) > 0 or finite.size < values.size)


def _missed(name: str, results: Sequence[Result]) -> Array:
    return np.array([any(v.kpi == name and not v.met for v in r.verdicts) for r in results])


# --- A quantity over two parameters of a design

_Extend = Literal["neither", "min", "max", "both"]
_STEPS = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)  # share of a decade
_EXACT = 1e-9  # fraction of a step: tolerance for a value on a level
_MOST = 14  # levels; more colors are hard to distinguish
_MARKERS = ("*", "o", "s", "D")
_HATCHES = ("///", "...", "xx")
_LINES = ("-", "--", ":")
_CURVES = ("--", ":", "-.")


def contour(data: xr.Dataset, shown: Map) -> Figure:
    """Draw a variable as a contour map.

    Parameters
    ----------
    data
        Dataset of a study; variables with ``units`` and ``long_name``. NaN remains white.
    shown
        Variable, coordinates, marks and limits to draw.

    Raises
    ------
    ParameterError
        When all values are NaN.
    """
    x, y = (_displayed(data[name]) for name in (shown.x, shown.y))
    z = _displayed(data[shown.values].transpose(shown.y, shown.x))
    known = z[np.isfinite(z)]
    if not known.size:
        raise ParameterError(
            f"contour: {shown.values} has no finite value to plot",
            name=shown.values,
        )
    figure, (axes,) = style.new_figure(4.4)
    levels = levels_between(float(known.min()), float(known.max()))
    colors = mpl.colormaps["viridis_r"]
    slack = _EXACT * (levels[-1] - levels[0])  # a share may be 1 plus rounding
    below, above = known.min() < levels[0] - slack, known.max() > levels[-1] + slack
    z = np.clip(z, None if below else levels[0], None if above else levels[-1])
    extend: _Extend = ("both" if above else "min") if below else ("max" if above else "neither")
    filled = axes.contourf(
        x,
        y,
        z,
        levels=levels,
        extend=extend,
        cmap=colors,
        norm=BoundaryNorm(levels, colors.N, extend=extend),
        alpha=0.75,
    )
    between = levels[0 if below else 1 : None if above else -1]
    axes.contour(x, y, z, levels=between, colors="white", linewidths=0.5)
    bar = figure.colorbar(filled, ax=axes, ticks=levels, format="%g")
    bar.ax.tick_params(labelsize=style.TEXT_SIZE)
    bar.set_label(_label(data[shown.values]), fontsize=style.TEXT_SIZE)
    handles = [
        *_limits(axes, data, shown, x, y),
        *_compared_lines(axes, data, shown),
        *_marks(axes, data, shown),
    ]
    axes.set_xlabel(_label(data[shown.x]))
    axes.set_ylabel(_label(data[shown.y]))
    if handles:
        style.legend_above(axes, handles)
    return figure


def levels_between(low: float, high: float) -> list[float]:
    """Return round levels: evenly between two numbers, or 1-2-5 steps beyond a ratio of 3.

    Examples
    --------
    >>> levels_between(0.0, 1.0)
    [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]
    >>> levels_between(57.0, 240.0)
    [60.0, 80.0, 100.0, 120.0, 150.0, 200.0]
    """
    if low > 0 and high > 3.0 * low:
        decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        every = [step * 10.0**n for n in decades for step in _STEPS]
        levels = [float(f"{level:g}") for level in every if low < level < high]
        return levels[:: math.ceil(len(levels) / _MOST)]
    span = (high - low) or abs(high) or 1.0
    step = 10.0 ** math.floor(math.log10(span / 5.0))
    step *= next(f for f in (1.0, 2.0, 5.0, 10.0) if span / (f * step) <= 10.0)
    first, last = math.floor(low / step + _EXACT), math.ceil(high / step - _EXACT)
    return [float(f"{k * step:.6g}") for k in range(first, max(last, first + 2) + 1)]


def _limits(axes: Axes, data: xr.Dataset, shown: Map, x: Array, y: Array) -> list[Line2D | Patch]:
    """Draw the limits of the feasible region, hatched beyond; return the legend's entries."""
    handles: list[Line2D | Patch] = []
    for k, (label, (name, level)) in enumerate(shown.limits.items()):
        values = np.asarray(data[name].transpose(shown.y, shown.x).values, dtype=float)
        if not (values > level).any():
            continue
        hatch, line = _HATCHES[k % len(_HATCHES)], _LINES[k % len(_LINES)]
        beyond = [level, max(float(np.nanmax(values)), level) * 2.0 + 1.0]
        with mpl.rc_context({"hatch.color": style.GRAY, "hatch.linewidth": 0.5}):
            axes.contourf(x, y, values, levels=beyond, colors="none", hatches=[hatch])
        axes.contour(
            x, y, values, levels=[level], colors=style.BLACK, linewidths=1.0, linestyles=line
        )
        handles.append(
            Patch(
                facecolor="none",
                edgecolor=style.BLACK,
                hatch=hatch,
                linewidth=0.8,
                label=style.plain(label),
            )
        )
    return handles


def _compared_lines(axes: Axes, data: xr.Dataset, shown: Map) -> list[Line2D | Patch]:
    """Draw the comparison lines; return the legend's entries."""
    handles: list[Line2D | Patch] = []
    units = [str(data[name].attrs["units"]) for name in (shown.x, shown.y)]
    for k, (label, points) in enumerate(shown.curves.items()):
        at = [in_display_unit(np.array(part), u)[0] for part, u in zip(points, units, strict=True)]
        (handle,) = axes.plot(
            *at,
            color=style.VERMILLION,
            linewidth=1.3,
            linestyle=_CURVES[k % len(_CURVES)],
            zorder=4,
            label=style.plain(label),
        )
        handles.append(handle)
    return handles


def _marks(axes: Axes, data: xr.Dataset, shown: Map) -> list[Line2D | Patch]:
    """Draw the marked designs within the map; return the legend's entries."""
    handles: list[Line2D | Patch] = []
    for k, mark in enumerate(shown.marks):
        inside = all(
            float(data[name].min()) <= value <= float(data[name].max())
            for name, value in ((shown.x, mark.x), (shown.y, mark.y))
        )
        if not inside:
            continue
        at = [
            in_display_unit(value, str(data[name].attrs["units"]))[0]
            for name, value in ((shown.x, mark.x), (shown.y, mark.y))
        ]
        marker = _MARKERS[k % len(_MARKERS)]
        (handle,) = axes.plot(
            *at,
            marker,
            color=style.VERMILLION,
            markersize=11 if marker == "*" else 6,
            markeredgecolor="white",
            linestyle="none",
            zorder=5,
            label=style.plain(mark.label),
        )
        handles.append(handle)
    return handles


def _displayed(variable: xr.DataArray) -> Array:
    values = np.asarray(variable.values, dtype=float)
    return in_display_unit(values, str(variable.attrs["units"]))[0]


def _label(variable: xr.DataArray) -> str:
    return style.axis_label(str(variable.attrs["long_name"]), str(variable.attrs["units"]))
