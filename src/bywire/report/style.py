"""Style of every figure: colors, line styles by meaning, legends, axes, scales.

Nothing here changes matplotlib's global state, and pyplot is never imported. Matplotlib itself is
loaded for the first figure, because loading takes half as long as a short command.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from bywire.bench.kpis.samples import smoothed
from bywire.core.quantities import display_unit
from bywire.core.typing import Array
from bywire.report.channel import COLUMNS, Channel, decimate
from bywire.report.panels import Role
from bywire.report.wording import amount, clean, in_display_unit, unit_text

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

_FASTEST = 3 * COLUMNS
"""points of a thinned line above which most pixel columns contain a whole period of ripple"""


def _is_band(shown: Channel) -> bool:
    """Return whether a line through all samples fills an area."""
    kept = len(decimate(shown.time, shown.values)[0])
    return _FASTEST < kept < len(shown.values)


def _averaging_time(time: Array) -> float:
    """Return 1, 2 or 5 times a power of ten [s], at least one pixel column wide.

    Examples
    --------
    >>> _averaging_time(np.array([0.0, 50.0]))
    0.1
    """
    column = float(time[-1] - time[0]) / COLUMNS
    decade = 10.0 ** math.floor(math.log10(column))
    return round(next(k * decade for k in (1.0, 2.0, 5.0, 10.0) if k * decade >= column), 12)


def inside(shown: Channel) -> tuple[Channel, float] | None:
    """Return the moving average and its averaging time [s] if a line fills an area."""
    if not _is_band(shown) or not bool(np.all(np.isfinite(shown.values))):
        return None
    width = _averaging_time(shown.time)
    return replace(shown, values=smoothed(shown.time, shown.values, width)), width


# --- Colors, lines and axes

# Okabe and Ito, "Color universal design", 2008: distinguishable with any kind of color vision.
BLUE = "#0072B2"
VERMILLION = "#D55E00"
GREEN = "#009E73"
PURPLE = "#CC79A7"
SKY = "#56B4E9"
ORANGE = "#E69F00"
YELLOW = "#F0E442"
BLACK = "#1A1A1A"
GRAY = "#7F7F7F"
PALE = "#DDDDDD"
SHADE = "#CBD8E6"
SHADE_AGAIN = "#E9EFF5"
SEQUENCE = (BLUE, VERMILLION, GREEN, PURPLE, SKY, ORANGE, BLACK)
"""colors of lines without a fixed meaning, in order"""

WIDTH = 7.2
"""width of a figure [inch]"""
TEXT_SIZE = 8.5
"""size of all text in a figure [points]"""

FEW = 40
"""number of points up to which they are drawn without a line"""

_EM_PER_CHARACTER = 0.58  # of the default font, slightly more than its mean
_EMS_BESIDE_TEXT = 4.4  # handle, its gap and the gap between columns in a legend


Dash = str | tuple[float, tuple[float, ...]]
"""a line style of matplotlib"""


@dataclass(frozen=True)
class Stroke:
    """Color, line style, width [points] and drawing order of a line."""

    color: str
    linestyle: Dash
    linewidth: float
    zorder: float


STROKES = {
    Role.MAIN: Stroke(BLUE, "-", 1.2, 3.0),
    Role.SECOND: Stroke(ORANGE, (0, (1.5, 1.5)), 1.3, 3.1),
    Role.SET_POINT: Stroke(BLACK, "--", 1.0, 3.2),
    Role.MEASURED: Stroke(BLUE, "-", 1.4, 2.9),
    Role.SIMULATED: Stroke(VERMILLION, "--", 1.3, 3.1),
    Role.LIMIT: Stroke(VERMILLION, ":", 1.2, 2.5),
}

PALE_OPACITY = 0.3
"""opacity of a ripple behind its average"""
_BAND_ORDER = 2.4
"""drawing order of a ripple that fills an area: behind every line"""


def new_figure(
    height: float, heights: Sequence[float] = (1.0,), *, is_shared: bool = True
) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels one above the other.

    ``height``: height of the figure [inch]; ``heights``: relative heights of the panels;
    ``is_shared``: whether they share their abscissa; otherwise each may show another quantity.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), layout="constrained", facecolor="white")
    grid = figure.subplots(
        len(heights),
        1,
        sharex=is_shared,
        squeeze=False,
        gridspec_kw={"height_ratios": list(heights)},
    )
    panels: list[Axes] = list(grid[:, 0])
    for axes in panels:
        dress(axes)
    return figure, panels


def dress(axes: Axes) -> None:
    """Apply the common style to axes: thin grid behind the data, no box."""
    axes.grid(True, color=PALE, linewidth=0.5)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(GRAY)
    axes.tick_params(labelsize=TEXT_SIZE, color=GRAY, length=3.0)
    axes.xaxis.label.set_fontsize(TEXT_SIZE)
    axes.yaxis.label.set_fontsize(TEXT_SIZE)
    for axis in (axes.xaxis, axes.yaxis):
        axis.get_offset_text().set_fontsize(TEXT_SIZE)


def few_ticks(axes: Axes, count: int) -> None:
    """Limit the ordinate of a low panel to ``count`` intervals."""
    from matplotlib.ticker import MaxNLocator

    axes.yaxis.set_major_locator(MaxNLocator(nbins=count, steps=[1, 2, 2.5, 5, 10]))


def log_ticks(axis: Axis) -> None:
    """Label a logarithmic axis with plain numbers: 1, 2, 5, 10, or only decades if it is long."""
    from matplotlib.ticker import LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high < 1e3 * low else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.set_minor_formatter(NullFormatter())


def plain(text: object, longest: int = 90) -> str:
    """Return one line that matplotlib draws literally: no formulas, no control characters.

    Parameters
    ----------
    text
        Text from a user or a recording.
    longest
        Maximum number of characters; longer text is cut.
    """
    line = clean(text).replace("\n", " ")
    short = line if len(line) <= longest else line[: longest - 1] + "…"
    return short.replace("$", r"\$")


def axis_label(label: str, symbol: str, gap: str = " ") -> str:
    """Return the label of an axis in the display unit of an SI unit.

    Parameters
    ----------
    label
        Quantity.
    symbol
        Its SI unit.
    gap
        Separator of quantity and unit; a line break in low panels.

    Examples
    --------
    >>> axis_label("caliper pressure", "Pa"), axis_label("duty cycle", "1")
    ('caliper pressure [bar]', 'duty cycle [-]')
    """
    return unit_label(label, display_unit(symbol), gap)


def unit_label(label: str, unit: str, gap: str = " ") -> str:
    """Return the label of an axis in a unit; ``gap``: see `axis_label`."""
    return f"{plain(label, 40)}{gap}[{plain(unit_text(unit), 20) or '-'}]"


def channel_label(shown: Channel) -> str:
    """Return the label of an axis that shows one channel."""
    return unit_label(shown.label, shown.unit)


def time_scale(time: Array) -> tuple[float, str]:
    """Return factor and unit of a time axis: ms for recordings of up to 0.2 s."""
    short = len(time) > 0 and float(time[-1] - time[0]) <= 0.2
    return (1e3, "ms") if short else (1.0, "s")


def draw_channel(
    axes: Axes, shown: Channel, role: Role, suffix: str = "", opacity: float = 1.0
) -> None:
    """Draw a channel over time, labeled by its name and ``suffix``.

    Ripple that is too fast to be visible is drawn as the pale band that it fills, with its moving
    average on it, and the label mentions it. In this case, only the average of a set point is
    drawn, because its band would hide the judged line.
    """
    scale, _ = time_scale(shown.time)
    look = STROKES[role]
    label = shown.label + suffix
    average = inside(shown)
    if average is not None:
        if role is not Role.SET_POINT:
            axes.plot(
                *decimate(scale * shown.time, shown.values),
                color=look.color,
                alpha=opacity * PALE_OPACITY,
                linewidth=0.8,
                zorder=_BAND_ORDER,
            )
        shown, width = average
        pale = "" if role is Role.SET_POINT else " (pale: ripple)"
        label = f"{label}, {amount(width, 's', 3)} average{pale}"
    axes.plot(
        *decimate(scale * shown.time, shown.values),
        color=look.color,
        linestyle=look.linestyle,
        linewidth=look.linewidth,
        zorder=look.zorder,
        alpha=opacity,
        label=plain(label),
    )


def legend_above(axes: Axes, handles: Sequence[Artist] | None = None) -> None:
    """Put the legend above the axes, where it never hides data, in as few rows as possible.

    Parameters
    ----------
    axes
        Axes for the legend.
    handles
        Entries. Default: everything in the axes with a label.
    """
    entries = axes.get_legend_handles_labels()[0] if handles is None else list(handles)
    if entries:
        axes.legend(
            handles=entries,
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=_fitting_columns([str(entry.get_label()) for entry in entries]),
            fontsize=TEXT_SIZE,
            frameon=False,
            borderaxespad=0.2,
            borderpad=0.1,
            handlelength=2.2,
            columnspacing=1.4,
        )


def _fitting_columns(labels: Sequence[str]) -> int:
    """Return the number of legend columns that fit; the legend fills them one by one."""
    lengths = list(map(len, labels))
    for columns in range(len(labels), 1, -1):
        longest = [float(np.max(part)) for part in np.array_split(lengths, columns)]
        ems = sum(_EM_PER_CHARACTER * n + _EMS_BESIDE_TEXT for n in longest)
        if ems * TEXT_SIZE / 72.0 <= WIDTH - 0.8:
            return columns
    return 1


# --- Colors of lines that belong to values of a varied quantity, and their scale

Color = tuple[float, float, float, float]

_COLORS = "cividis"  # suitable for any kind of color vision
_BRIGHTEST = 0.9  # part of the color map: brighter colors are not visible on white


def value_color(values: Sequence[float], k: int) -> Color:
    """Return the color of one of several values."""
    low, high = min(values), max(values)
    share = (values[k] - low) / (high - low) if high > low else 0.0
    import matplotlib as mpl

    return mpl.colormaps[_COLORS](_BRIGHTEST * share)


def value_scale(
    figure: Figure, panels: list[Axes], name: str, unit: str, values: Sequence[float]
) -> None:
    """Put the scale of a varied quantity next to the panels.

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
    bar.ax.tick_params(labelsize=TEXT_SIZE)
    bar.set_label(axis_label(name, unit), fontsize=TEXT_SIZE)


# --- One legend for a figure whose panels use the same lines

_COLUMNS = 4  # that fit


def legend_outside(
    figure: Figure,
    handles: Sequence[Artist],
    place: Literal["left", "right"] = "left",
    *,
    columns: int = _COLUMNS,
) -> None:
    """Put one legend above all panels of a figure, at its left or right end."""
    figure.legend(
        handles=list(handles),
        ncols=columns,
        frameon=False,
        fontsize=TEXT_SIZE,
        loc="outside upper left" if place == "left" else "outside upper right",
    )
