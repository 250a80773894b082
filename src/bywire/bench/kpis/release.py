"""Key figures of a release: when a signal has fallen for good, and what is left of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from bywire.bench.kpis.kpi import Undefined, defect, measure, signal
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

    signal: str
    empty: float


@dataclass(frozen=True, eq=False)
class Release:
    """A signal from the release on: times [s], values, its SI unit, and the level of `Setting`."""

    t: Array
    y: Array
    empty: float
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
    after = recording.sel(time=slice(-1e-9, None))
    t, _ = signal(after, "time")
    y, unit = signal(after, setting.signal)
    return Release(t, y, setting.empty, unit)


@measure("s")
def time_to_empty(data: Release) -> float | Undefined:
    """Time from the release until the output stays below the level that counts as empty.

    Interpolated between the last sample above it and the next one.
    """
    above = np.flatnonzero(data.y > data.empty)
    if not above.size:
        return 0.0
    k = int(above[-1])
    if k + 1 == data.t.size:
        return Undefined("it does not empty in the recorded time")
    share = (data.y[k] - data.empty) / (data.y[k] - data.y[k + 1])
    return float(data.t[k] + share * (data.t[k + 1] - data.t[k]))


@measure("level")
def residual_level(data: Release) -> float:
    """Output at the end of the recording."""
    return float(data.y[-1])
