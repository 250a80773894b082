"""Margins of a loop over a range of a parameter: the worst case, and where it is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.loop import Loop
from bywire.analysis.margins import bandwidth, margin
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.parameters import ParameterSet

Array = NDArray[np.float64]
SENSES = {
    "gain": 1, "phase": 1, "delay": 1, "disk": 1, "bandwidth": 1,
    "sensitivity": -1, "complementary": -1,
}  # fmt: skip
"""figures of `LoopMargins`: 1 where more is better, -1 where less is"""
_POINTS = 2000
_LOWEST = 1e-2  # lower end of what is searched, Hz
_REST = 1e-6  # where a response counts as that at rest, Hz


@dataclass(frozen=True)
class LoopMargins:
    """Margins of a sampled loop as it is, with its delays and filters; NaN where it is unstable.

    Parameters
    ----------
    gain
        Smallest factor above 1 by which the loop gain may grow; inf where none makes it unstable.
    phase, crossover
        Smallest phase margin of all gain crossovers [degree], and the highest of these [Hz].
    delay
        Additional dead time that the loop can take [s].
    disk
        Disk-based margin (symmetric, skew 0): S - T of this size stays away from -1 in gain and
        phase at once; 0 to 2.
    sensitivity, complementary
        Largest magnitudes of S = 1/(1 + L) and T = L/(1 + L).
    bandwidth
        Frequency at which the closed loop has fallen to -3 dB of its gain at rest [Hz].
    stable
        Whether the closed loop is stable.
    phase_at
        Gain crossover at which the phase margin is read [Hz].
    """

    gain: float
    phase: float
    crossover: float
    delay: float
    disk: float
    sensitivity: float
    complementary: float
    bandwidth: float
    stable: bool
    phase_at: float = math.nan


UNSTABLE = LoopMargins(
    gain=math.nan, phase=math.nan, crossover=math.nan, delay=math.nan, disk=math.nan,
    sensitivity=math.nan, complementary=math.nan, bandwidth=math.nan, stable=False,
)  # fmt: skip
"""what an unstable loop has: no margins"""


def margins(loop: Loop, par: ParameterSet, value: float) -> LoopMargins:
    """Return the margins of a loop at an operating point, dry friction removed.

    Raises
    ------
    InputError
        When the operating point does not exist.
    """
    gain, closed = loop.gain(par, value), loop.closed(par, value)
    if not closed.is_stable:
        return UNSTABLE
    highest = 0.998 * min(gain.nyquist, closed.nyquist)
    band = (_LOWEST, highest)

    def response(f: Array) -> NDArray[np.complex128]:
        return gain.response(f)[:, 0, 0]

    f = np.geomspace(*band, _POINTS)
    L = response(f)
    S = 1.0 / (1.0 + L)
    found = margin(response, band)
    return LoopMargins(
        gain=_gain_margin(gain, L),
        phase=found.phase,
        crossover=found.crossover,
        delay=_delay_margin(f, L),
        disk=2.0 / float(np.max(np.abs(S - L * S))),
        sensitivity=float(np.max(np.abs(S))),
        complementary=float(np.max(np.abs(L * S))),
        bandwidth=bandwidth(lambda g: closed.response(g)[:, 0, 0], (_REST, highest)),
        stable=closed.is_stable,
        phase_at=found.at,
    )  # fmt: skip


def over(
    loop: Loop, par: ParameterSet, value: float, name: str, values: Sequence[float]
) -> list[LoopMargins]:
    """Return the margins for several values of a parameter, or of the operating point.

    Parameters
    ----------
    name
        Dotted name of a parameter, or that of the loop's operating quantity.
    values
        Its values, SI.

    Raises
    ------
    UnknownNameError
        When there is no such number.
    """
    if name == loop.at.name:
        return [margins(loop, par, one) for one in values]
    if name not in par.leaves():
        raise unknown_name("parameter", name, [loop.at.name, *par.leaves()])
    return [margins(loop, par.replace({name: one}), value) for one in values]


def worst(
    found: Sequence[LoopMargins], values: Sequence[float]
) -> Mapping[str, tuple[float, float]]:
    """Return the worst of each margin, and the value at which it occurs.

    Nothing is worse than an unstable loop, whose margins are NaN.
    """
    if not found:
        raise ParameterError("no margins to choose from: give at least one value")
    result: dict[str, tuple[float, float]] = {}
    for field, sign in SENSES.items():
        sizes = [sign * getattr(one, field) if one.stable else -math.inf for one in found]
        k = int(np.nanargmin(sizes)) if not all(map(math.isnan, sizes)) else 0
        result[field] = (getattr(found[k], field), float(values[k]))
    return result


def _delay_margin(f: Array, L: NDArray[np.complex128]) -> float:
    """Return the least dead time that turns a crossover of the response into -1; NaN for none."""
    size, phase = np.log(np.abs(L)), np.degrees(np.unwrap(np.angle(-L)))
    found = []
    for k in np.flatnonzero(np.diff(np.signbit(size))):
        share = size[k] / (size[k] - size[k + 1])
        at = f[k] * (f[k + 1] / f[k]) ** share
        found.append((phase[k] + share * (phase[k + 1] - phase[k])) % 360.0 / (360.0 * at))
    return float(min(found, default=math.nan))


def _gain_margin(gain: LinearModel, L: NDArray[np.complex128]) -> float:
    """Return the smallest factor above 1 at which the response passes through -1."""
    crossings = np.flatnonzero(np.diff(np.signbit(L.imag)) & (L.real[:-1] < 0))
    sizes = []
    for k in crossings:
        share = L.imag[k] / (L.imag[k] - L.imag[k + 1])
        sizes.append(float(abs(L.real[k] + share * (L.real[k + 1] - L.real[k]))))
    # Half the sampling frequency, where the response is real, lies beyond the grid.
    if gain.period:
        sizes.append(-float(gain.response(np.array([gain.nyquist]))[0, 0, 0].real))
    factors = [1.0 / size for size in sizes if 0.0 < size < 1.0]
    return min(factors, default=math.inf)
