"""Figure: magnitude and phase of frequency responses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.report import style
from bywire.report.wording import clean

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.ticker import MultipleLocator


@dataclass(frozen=True)
class Response:
    """A frequency response.

    Parameters
    ----------
    label
        What the legend says.
    frequency
        Frequencies [Hz], ascending and positive, shape ``(n,)``.
    value
        Complex response, shape ``(n,)``; NaN where there is none.
    measured
        Draw points instead of a line.
    """

    label: str
    frequency: Array
    value: NDArray[np.complexfloating[Any, Any]]
    measured: bool = False

    def __post_init__(self) -> None:
        if np.shape(self.frequency) != np.shape(self.value):
            raise ParameterError(
                f"response {self.label!r} has {np.size(self.value)} values for "
                f"{np.size(self.frequency)} frequencies: give one per frequency"
            )
        if not bool(np.all(np.asarray(self.frequency) > 0)):
            raise ParameterError(
                f"response {self.label!r} has a frequency that is not above 0 Hz: "
                "a logarithmic axis cannot show it"
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
        What to draw, each with its label.
    gain_unit
        What 0 dB stands for one of, as people write it (``"bar/A"``); ``"1"`` for a pure number.
    marks
        Frequencies [Hz] to mark by their label, for instance the crossover.
    depth
        What lies by more than this below the largest magnitude [dB] is left out.

    Raises
    ------
    ParameterError
        When there is no response.
    """
    if not responses:
        raise ParameterError("bode: no response given: give at least one")
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
    """Return a response up to where it falls by a depth [dB] for good."""
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
