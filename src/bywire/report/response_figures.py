"""Figures of frequency responses: linear models of loops and plants, nonlinear against linear."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.linear.linear_model import LinearModel
from bywire.core.errors import ParameterError, counted
from bywire.core.quantities import display_unit
from bywire.core.typing import Array
from bywire.core.units import display_factor
from bywire.report import style
from bywire.report.panels import Role
from bywire.report.wording import amount, clean, in_display_unit, unit_text

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure
    from matplotlib.ticker import MultipleLocator


@dataclass(frozen=True)
class Response:
    """A frequency response.

    Parameters
    ----------
    label
        Label in the legend.
    frequency
        Frequencies [Hz], ascending and positive, shape ``(n,)``.
    value
        Complex response, shape ``(n,)``; NaN where it is undefined.
    measured
        Whether to draw points instead of a line.
    """

    label: str
    frequency: Array
    value: NDArray[np.complexfloating[Any, Any]]
    measured: bool = False

    def __post_init__(self) -> None:
        if np.shape(self.frequency) != np.shape(self.value):
            raise ParameterError(
                f"response {self.label!r} has {counted(np.size(self.value), 'value')} for "
                f"{np.size(self.frequency)} frequencies. Pass one per frequency",
                name=self.label,
                value=str(np.size(self.value)),
                valid=str(np.size(self.frequency)),
            )
        if not bool(np.all(np.asarray(self.frequency) > 0)):
            raise ParameterError(
                f"response {self.label!r} has a frequency that is not above 0 Hz, which a "
                "logarithmic axis cannot show",
                name=self.label,
                valid="above 0 Hz",
            )

    @property
    def magnitude_db(self) -> Array:
        """Magnitude [dB]; NaN where the response is 0."""
        size = np.abs(self.value)
        return 20.0 * np.log10(np.where(size > 0, size, np.nan))

    @property
    def phase_deg(self) -> Array:
        """Phase [degree] without jumps, above -180 and at most 180 at the lowest frequency."""
        phase = np.full(np.shape(self.value), np.nan)
        known = np.isfinite(self.value)
        phase[known] = np.degrees(np.unwrap(np.angle(self.value[known])))
        return phase


def bode(
    responses: Sequence[Response],
    *,
    gain_unit: str = "1",
    marks: Mapping[str, float] | None = None,
    depth: float = math.inf,
) -> Figure:
    """Draw magnitude and phase of one or several frequency responses.

    Parameters
    ----------
    responses
        Responses, each with its label.
    gain_unit
        Unit of 0 dB in its usual spelling (``"bar/A"``); ``"1"`` for a pure number.
    marks
        Frequencies [Hz] to mark, by label, for example the crossover.
    depth
        Depth below the maximum magnitude [dB]; lower responses are left out.

    Raises
    ------
    ParameterError
        Without a response.
    """
    if not responses:
        raise ParameterError("bode: no response was passed. Pass at least one")
    responses = [_above(response, depth) for response in responses]
    figure, (upper, lower) = style.new_figure(4.6, (1.0, 1.0))
    for k, response in enumerate(responses):
        line = "o" if response.measured else ("-", "--", "-.")[k // len(style.SEQUENCE) % 3]
        for axes, values in ((upper, response.magnitude_db), (lower, response.phase_deg)):
            axes.plot(
                response.frequency,
                values,
                line,
                color=style.SEQUENCE[k % len(style.SEQUENCE)],
                markersize=3.5,
                linewidth=1.3,
                markerfacecolor="white",
                label=style.plain(response.label),
            )
    for k, (label, frequency) in enumerate((marks or {}).items()):
        for axes in (upper, lower):
            axes.axvline(
                frequency,
                color=style.GRAY,
                linewidth=1.0,
                zorder=1.5,
                linestyle=(":", "--", "-.")[k % 3],
                label=style.plain(label),
            )
    upper.set_xscale("log")
    upper.margins(x=0.01)
    style.log_ticks(upper.xaxis)
    upper.axhline(0.0, color=style.GRAY, linewidth=0.6, zorder=1)
    for axes in (upper, lower):
        axes.grid(True, which="minor", axis="x", color=style.PALE, linewidth=0.3)
        axes.tick_params(which="minor", color=style.GRAY, length=1.5)
    lower.yaxis.set_major_locator(_phase_ticks(responses))
    reference = "" if gain_unit == "1" else f" re 1 {clean(gain_unit)}"
    upper.set_ylabel(style.plain(f"magnitude [dB{reference}]"))
    lower.set_ylabel("phase [°]")
    lower.set_xlabel(style.axis_label("frequency", "Hz"))
    style.legend_above(upper)
    figure.align_ylabels([upper, lower])
    return figure


def _above(response: Response, depth: float) -> Response:
    """Return the part of a response before it permanently falls below a depth [dB]."""
    size = response.magnitude_db
    seen = np.flatnonzero(size > np.nanmax(size, initial=-math.inf) - depth)
    if not math.isfinite(depth) or not seen.size:
        return response
    end = int(seen[-1]) + 1
    return replace(response, frequency=response.frequency[:end], value=response.value[:end])


def _phase_ticks(responses: Sequence[Response]) -> MultipleLocator:
    """Return ticks at multiples of 15, 45, 90, ... degrees, at most about six."""
    from matplotlib.ticker import MultipleLocator

    phases = np.concatenate([response.phase_deg for response in responses])
    phases = phases[np.isfinite(phases)]
    span = float(np.ptp(phases)) if len(phases) else 0.0
    steps = (5.0, 15.0, 30.0, 45.0, 90.0, 180.0, 360.0)
    return MultipleLocator(next((s for s in steps if span / s <= 5.0), max(720.0, span / 5.0)))


# --- Plants

_POINTS = 400
_DECADES = 3.0
_APART = 16  # spacing of the points of other models


def plant_figures(models: Mapping[str, LinearModel], band: float) -> list[tuple[str, Figure]]:
    """Return name and figure of every output's response to the first input.

    ``models``: label -> model, of the same inputs and outputs; ``band``: maximum frequency [Hz].
    """
    f = np.geomspace(band * 10.0**-_DECADES, band, _POINTS)
    first = next(iter(models.values()))
    values = {label: model.response(f) for label, model in models.items()}
    taken, drawn = first.input_units[0], []
    for row, (signal, given) in enumerate(zip(first.outputs, first.output_units, strict=True)):
        if not any(np.any(response[:, row, 0]) for response in values.values()):
            continue
        shown = display_unit(given)
        scale = display_factor(given) / display_factor(taken)
        unit = f"{unit_text(shown) or '1'}/{unit_text(display_unit(taken)) or '1'}"
        lines = []
        for k, (label, response) in enumerate(values.items()):
            # Points on top of a line, because equal models would otherwise hide each other.
            some = slice(None) if k == 0 else slice(k * _APART // 2, None, _APART)
            path = f"{label}, {first.inputs[0]} to {signal}"
            lines.append(Response(path, f[some], scale * response[some, row, 0], measured=k > 0))
        drawn.append((signal, bode(lines, gain_unit=unit)))
    return drawn


# --- Nonlinear responses

_DASHES: tuple[style.Dash, ...] = ("-", "--", ":")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")
_LEAST = 0.01  # fraction of the tolerance: smaller differences are drawn at the lower edge


def differences(
    frequency: Array,
    sizes: Mapping[str, tuple[Array, Array]],
    tolerance: tuple[float, float],
) -> Figure:
    """Draw the magnitude of gain and phase differences versus frequency on logarithmic axes.

    Parameters
    ----------
    frequency
        Frequencies [Hz], shape (n,).
    sizes
        Label -> differences of gain [dB] and phase [degree], shape (n,) each; NaN is left out.
    tolerance
        Tolerance in dB and degree, drawn as limits.

    Raises
    ------
    ParameterError
        Without anything to draw.
    """
    from matplotlib.ticker import NullFormatter

    if not sizes:
        raise ParameterError("differences: no cause was passed. Pass at least one")
    figure, panels = style.new_figure(5.2, (1.0, 1.0))
    look = style.STROKES[Role.LIMIT]
    for n, (axes, label) in enumerate(zip(panels, ("gain [dB]", "phase [°]"), strict=True)):
        floor = _LEAST * tolerance[n]
        for k, (name, values) in enumerate(sizes.items()):
            size = np.abs(values[n])
            axes.plot(
                frequency,
                np.where(np.isfinite(size), np.maximum(size, floor), np.nan),
                color=style.SEQUENCE[k % len(style.SEQUENCE)],
                linestyle=_DASHES[k // len(style.SEQUENCE) % len(_DASHES)],
                marker=_MARKERS[k % len(_MARKERS)],
                markersize=4.5,
                linewidth=1.2,
                label=style.plain(name),
            )
        axes.axhline(
            tolerance[n],
            color=look.color,
            linestyle=look.linestyle,
            linewidth=look.linewidth,
            label="limit of agreement",
        )
        axes.set_yscale("log")
        axes.set_ylabel(f"difference of {label}")
    panels[1].set_xscale("log")
    panels[1].xaxis.set_major_formatter(lambda hertz, _: f"{hertz:g}")
    panels[1].xaxis.set_minor_formatter(NullFormatter())
    panels[1].set_xlabel(style.axis_label("frequency", "Hz"))
    style.legend_above(panels[0])
    figure.align_ylabels(panels)
    return figure


# --- Bandwidth versus a range of one parameter, by amplitude

_COLORS = (style.BLUE, style.VERMILLION, style.GREEN, style.PURPLE, style.ORANGE, style.SKY)


def bandwidth_range(
    response: xr.Dataset, labels: Sequence[float], name: str, symbol: str
) -> Figure:
    """Draw the bandwidth at every amplitude; a ring marks the worst case.

    Parameters
    ----------
    response
        Dataset with ``bandwidth`` [Hz] over ``variant`` and ``amplitude``; where it is beyond the
        measured frequencies, an arrow marks the last frequency.
    labels
        Values of the varied quantity, SI, shape (variants,).
    name, symbol
        Name and SI unit of the varied quantity.
    """
    figure, (axes,) = style.new_figure(2.9)
    x, _ = in_display_unit(np.asarray(labels), symbol)
    lowest, highest = response["frequency"].values[[0, -1]]
    size_unit = str(response["amplitude"].attrs["units"])
    for (j, size), color in zip(enumerate(response["amplitude"].values), cycle(_COLORS)):
        y = response["bandwidth"].values[:, j]
        inside = np.clip(y, lowest, highest)
        label = f"amplitude {amount(float(size), size_unit, 3)}"
        axes.plot(x, inside, marker="o", markersize=4, color=color, label=style.plain(label))
        for beyond, mark in ((y > highest, "^"), (y < lowest, "v")):
            axes.plot(x[beyond], inside[beyond], mark, color=color, markersize=8)
        k = int(np.argmin(y))
        axes.plot(x[k], inside[k], "o", markersize=11, fillstyle="none", color=color)
    axes.set_xlabel(style.axis_label(name, symbol))
    axes.set_ylabel(style.axis_label("bandwidth (-3 dB)", "Hz"))
    axes.set_ylim(bottom=0.0)
    style.legend_above(axes)
    return figure
