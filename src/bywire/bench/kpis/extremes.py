"""Between which values a signal stays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import xarray as xr

from bywire.bench.kpis.in_c import InC
from bywire.bench.kpis.kpi import measure
from bywire.bench.kpis.samples import defect, signal
from bywire.core.typing import Array


@dataclass(frozen=True)
class Setting:
    """Name of the signal in the recording."""

    BY_CASE: ClassVar[tuple[str, ...]] = ()

    signal: str


IN_C = InC(("signal",))


@dataclass(frozen=True, eq=False)
class Course:
    """Samples of a signal: times [s], shape ``(n,)``, values, ``(..., n)``, and its SI unit."""

    t: Array
    y: Array
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


def select(recording: xr.Dataset, setting: Setting) -> Course:
    """Return the signal.

    Raises
    ------
    UnknownNameError
        When the recording does not hold it.
    """
    t, _ = signal(recording, "time")
    return Course(t, *signal(recording, setting.signal))


@measure("level")
def output_max(data: Course) -> Array:
    """Largest value of the output, over the recorded samples."""
    return np.asarray(np.max(data.y, axis=-1))


@measure("level")
def output_min(data: Course) -> Array:
    """Smallest value of the output, over the recorded samples."""
    return np.asarray(np.min(data.y, axis=-1))
