"""Maximum and minimum value of a signal."""

from __future__ import annotations

from dataclasses import dataclass

from bywire.bench.kpis.kpi import measure
from bywire.bench.kpis.samples import Samples


@dataclass(frozen=True)
class Setting:
    """Name of the signal in the recording."""

    signal: str


@measure("level")
def output_max(signal: Samples) -> float:
    """Maximum recorded value of the output."""
    return max(signal)


@measure("level")
def output_min(signal: Samples) -> float:
    """Minimum recorded value of the output."""
    return min(signal)
