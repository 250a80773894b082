r"""Bandwidth and crossover of a measured loop by amplitude, for small and large signals.

The controller is linear between its limits. Let C_r be its response to the set point, and C_y its
response to the output. The linear closed loop T_0 and loop gain L_0 determine their ratio H, for
any effect of friction and limits on the rest:

.. math:: H = \frac{C_r}{C_y} = T_0 \frac{1 + L_0}{L_0}, \qquad L = \frac{T}{H - T}

with the closed loop T measured with sines of one amplitude. L is the loop gain's describing
function.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from bywire.analysis.crossings import (
    fall,
    gain_factors,
    lower_factor,
    measured_margin,
    upper_factor,
)
from bywire.analysis.loop import Loop, Point
from bywire.analysis.loop_figures import LoopFigures
from bywire.analysis.response.sweep import complex_values
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of
from bywire.core.typing import Array, Complex


@dataclass(frozen=True)
class Variant:
    """Loop at an operating point.

    Parameters
    ----------
    loop, par, value
        Loop, parameters and operating point [SI].
    label
        Value of the varied quantity [SI]; NaN without variation.
    """

    loop: Loop
    par: ParameterSet
    value: float
    label: float = math.nan

    @property
    def point(self) -> Point:
        """The operating point, ready to run."""
        return self.loop.point(self.par, self.value)

    def linear(self, frequencies: Array) -> Complex:
        """Return the response of the linear closed loop, shape (frequencies,)."""
        return self.loop.closed(self.par, self.value).response(frequencies)[:, 0, 0]

    @cached_property
    def has_loop(self) -> bool:
        """Whether there is feedback; see `LoopFigures`."""
        gain, closed = self.loop.gain_and_closed(self.par, self.value)
        return LoopFigures(gain, closed).has_loop

    def gain(self, closed: Complex, frequencies: Array) -> Complex:
        """Return the loop gain from a measured closed-loop response, both of shape (n,)."""
        if not self.has_loop:
            return np.zeros_like(closed)
        T = self.linear(frequencies)
        L = self.loop.gain(self.par, self.value).response(frequencies)[:, 0, 0]
        H = T * (1.0 + L) / L  # the plant cancels: T = C_r P/(1 + L), L = C_y P
        return np.asarray(closed / (H - closed))


def variants_over(base: Variant, name: str, values: Sequence[float]) -> list[Variant]:
    """Return the cases for the values of one parameter, or of the operating quantity.

    Raises
    ------
    UnknownNameError
        When the parameter is unknown.
    ParameterError
        When there is no value, or one is not valid.
    """
    if not values:
        raise ParameterError(f"{name} needs at least one value", name=name)
    cases = base.loop.varied(base.par, base.value, name, values)
    return [Variant(base.loop, *case, at) for case, at in zip(cases, values, strict=True)]


@dataclass(frozen=True)
class Width:
    """Figures of a closed loop at one amplitude.

    Parameters
    ----------
    bandwidth
        Frequency at which the gain has fallen 3 dB below the linear loop's gain at standstill
        [Hz]; 0 if it is below from the lowest frequency on, infinity beyond the highest.
    crossover, phase_margin
        Of the loop gain's describing function [Hz, degree]; NaN if the frequencies contain no
        crossover, or more than one controller acts. The crossover is infinity beyond the highest.
    gain_margin, lower_gain_margin
        Factors by which the gain of the describing function may grow, and to which it may fall;
        NaN if the frequencies contain no such factor.
    """

    bandwidth: float
    crossover: float
    phase_margin: float
    gain_margin: float = math.nan
    lower_gain_margin: float = math.nan


def width(variant: Variant, response: xr.Dataset) -> Width:
    """Return the figures of one variant and amplitude.

    Parameters
    ----------
    variant
        The measured loop.
    response
        Its response over ``frequency``; see ``frequency_response``.
    """
    start = float(np.abs(variant.linear(np.zeros(1))[0]))
    values, f = complex_values(response), response["frequency"].values
    bandwidth, known = fall(response["gain"].values, f, start), np.isfinite(values)
    if start == 0.0:  # the output does not respond, so its gain cannot fall
        bandwidth = math.nan
    if not variant.loop.single or not known.any():
        return Width(bandwidth, math.nan, math.nan)
    L = variant.gain(values[known], f[known])
    margin, factors = measured_margin(f[known], L), gain_factors(f[known], L)
    upper, lower = upper_factor(factors), lower_factor(factors)
    return Width(
        bandwidth,
        margin.crossover,
        margin.phase,
        upper.factor if math.isfinite(upper.frequency) else math.nan,
        lower.factor if math.isfinite(lower.frequency) else math.nan,
    )


def widths(variants: Sequence[Variant], response: xr.Dataset) -> list[list[Width]]:
    """Return the figures of every variant, by amplitude."""
    return [
        [
            width(variant, response.isel(variant=k, amplitude=j))
            for j in range(response.sizes["amplitude"])
        ]
        for k, variant in enumerate(variants)
    ]


def with_widths(response: xr.Dataset, figures: Sequence[Sequence[Width]]) -> xr.Dataset:
    """Return a response with its figures by variant and amplitude; see `Width`."""
    units = {
        "bandwidth": "Hz",
        "crossover": "Hz",
        "phase_margin": "degree",
        "gain_margin": "1",
        "lower_gain_margin": "1",
    }
    rows = {name: [[getattr(figure, name) for figure in row] for row in figures] for name in units}
    return response.assign(
        {name: (("variant", "amplitude"), rows[name], {"units": units[name]}) for name in units}
    )


def narrowest(response: xr.Dataset, amplitude: int) -> int:
    """Return the first variant with the smallest bandwidth at an amplitude."""
    return int(np.argmin(response["bandwidth"].values[:, amplitude]))


if TYPE_CHECKING:
    import xarray as xr

    from bywire.analysis.loop import Loop
    from bywire.core.parameters import ParameterSet


def leaving(loop: Loop, par: ParameterSet, value: float, amplitude: float) -> str:
    """Return the reason why a sine leaves the brake's range; empty if it stays within the range.

    Parameters
    ----------
    loop, par, value
        The loop and its operating point.
    amplitude
        Amplitude of the sine [SI unit of the first input].

    Notes
    -----
    The check applies only to set points of the quantity that defines the operating point. It tries
    both ends of the sine as operating points.
    """
    stimulus = loop.point(par, value).model.Stimulus
    if signals_of(stimulus)[loop.inputs[0]].unit != loop.at.unit:
        return ""
    for end in (value - amplitude, value + amplitude):
        try:
            loop.point(par, end)
        except ParameterError as error:
            return str(error)
    return ""
