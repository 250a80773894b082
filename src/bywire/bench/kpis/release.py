"""Key figures of a release: time until a signal stays low, and its residual level."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from typing import NamedTuple

from bywire.bench.kpis.kpi import Undefined, measure
from bywire.bench.kpis.samples import Samples

_ROUNDING = 1e-9  # s, rounding error of time zero


@dataclass(frozen=True)
class Setting:
    """Signal of the release.

    Parameters
    ----------
    signal
        Name of the signal in the recording; the release begins at time zero.
    empty
        Level below which the signal is treated as released, in its SI unit.
    """

    signal: str
    empty: float


class Release(NamedTuple):
    """A signal from time zero on."""

    t: Samples
    y: Samples


def released(t: Samples, signal: Samples) -> Release | Undefined:
    """Signal from time zero on."""
    first = bisect_left(t, -_ROUNDING)
    rows = len(t) - first
    if rows < 2:
        return Undefined(f"{rows} samples are too few: at least two are needed")
    return Release(t[first:], signal[first:])


@measure("s")
def time_to_empty(released: Release, setting: Setting) -> float | Undefined:
    """Time from the release until the output stays below the level of a released brake.

    Interpolated between the last sample above this level and the next sample.
    """
    t = released.t
    y = released.y
    k = len(t) - 1
    while k >= 0 and not y[k] > setting.empty:
        k -= 1
    if k == len(t) - 1:
        return Undefined("the output is not released within the recording")
    if k < 0:
        return Undefined("the output was already released before the release", is_open=True)
    share = (y[k] - setting.empty) / (y[k] - y[k + 1])
    return t[k] + share * (t[k + 1] - t[k])


@measure("level")
def residual_level(released: Release) -> float:
    """Output at the end of the recording."""
    return released.y[-1]
