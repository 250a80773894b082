"""Key figures of a release: when a signal has fallen for good, and what is left of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import xarray as xr

from bywire.bench.kpis.kpi import Values, Why, measure
from bywire.bench.kpis.samples import defect, sample, signal
from bywire.core.typing import Array


@dataclass(frozen=True)
class Setting:
    """What is released.

    Parameters
    ----------
    signal
        Name of the signal in the recording; the release begins at time zero.
    empty
        Level below which it counts as released, in its SI unit.
    """

    BY_CASE: ClassVar[tuple[str, ...]] = ("empty",)

    signal: str
    empty: float


@dataclass(frozen=True, eq=False)
class Release:
    """A signal from the release on: times [s], values, its SI unit, and the level of `Setting`.

    Times and values of shapes ``(n,)`` and ``(..., n)``, the level ``(...)``.
    """

    t: Array
    y: Array
    empty: float | Array
    unit: str = "1"

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of the signal."""
        return {"level": self.unit}

    @cached_property
    def defect(self) -> str:
        """Why no figure is defined."""
        return defect(self.t, self.y)

    @property
    def note(self) -> str:
        """Nothing is treated."""
        return ""


def select(recording: xr.Dataset, setting: Setting) -> Release:
    """Return the signal from time zero on.

    Raises
    ------
    UnknownNameError
        When the recording does not hold it.
    """
    t, _ = signal(recording, "time")
    y, unit = signal(recording, setting.signal)
    first = int(np.searchsorted(t, -1e-9))
    return Release(t[first:], y[..., first:], setting.empty, unit)


@measure("s")
def time_to_empty(data: Release) -> Values:
    """Time from the release until the output stays below the level that counts as empty.

    Interpolated between the last sample above it and the next one.
    """
    t, y, last = data.t, data.y, data.t.size - 1
    above = y > np.asarray(data.empty)[..., None]
    k = last - np.argmax(above[..., ::-1], axis=-1)
    full = above[..., -1]
    k = np.where(full, 0, np.minimum(k, last - 1))
    here, there = sample(y, k), sample(y, k + 1)
    with np.errstate(all="ignore"):  # where it never was above
        share = (here - data.empty) / (here - there)
        left = t[k] + share * (t[k + 1] - t[k])
    return Values(
        left,
        Why(full, lambda _: "it does not empty in the recorded time"),
        Why(~above.any(axis=-1), lambda _: "it was empty already at the release", is_open=True),
    )


@measure("level")
def residual_level(data: Release) -> Array:
    """Output at the end of the recording."""
    return np.asarray(data.y[..., -1])
