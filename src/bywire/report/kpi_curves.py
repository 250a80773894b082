"""Figure: key figures over what a bench was varied over, with their limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from matplotlib.figure import Figure

from bywire.bench.bench import Bench
from bywire.bench.running import Result
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.panels import Role
from bywire.report.readable_axis import scale_of
from bywire.report.wording import in_display_unit

_COLUMNS = 2
_HEIGHT = 1.35  # of a panel [inch]


class Varied(Protocol):
    """What a bench gave for every value of a range; a `BenchRange` is one."""

    @property
    def bench(self) -> Bench:
        """The bench."""
        ...

    @property
    def name(self) -> str:
        """What was varied."""
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
        """What each of them gave."""
        ...


def kpi_curves(varied: Varied) -> Figure:
    """Draw every key figure that changes over the values, each in a panel of its own.

    Where a requirement limits it, the limit is drawn and points that miss it are crosses.
    """
    shown = {name: pair for name, pair in _curves(varied).items() if _moves(pair[0])}
    shown = shown or _curves(varied)
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


def _curves(varied: Varied) -> dict[str, tuple[Array, Array, str]]:
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
