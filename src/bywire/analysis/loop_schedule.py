"""What a loop's gain schedule consists of: regions of the operating quantity, gains of each."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bywire.core.parameters import ParameterSet


@dataclass(frozen=True)
class LoopSchedule:
    """Gains that depend on the operating point, region by region.

    Parameters
    ----------
    changes
        Parameters that switch the schedule on.
    borders
        Parameters at which regions meet, ascending.
    regions
        Name of each region -> what a design may choose there: dotted name -> lowest and highest
        value [SI]; by ascending operating point.
    main
        Region whose gains are also those without a schedule; it is designed first.
    points
        Operating points for which regions are usually designed [SI].
    """

    changes: Mapping[str, Any]
    borders: tuple[str, ...]
    regions: Mapping[str, Mapping[str, tuple[float, float]]]
    main: str
    points: tuple[float, ...]

    def is_on(self, par: ParameterSet) -> bool:
        """Tell whether parameters have the schedule switched on."""
        values = par.flat()
        return all(values[name] == value for name, value in self.changes.items())

    def region(self, par: ParameterSet, value: float) -> str:
        """Return the region of an operating point; a border belongs to the one above."""
        leaves = par.leaves()
        return tuple(self.regions)[bisect_right([leaves[name] for name in self.borders], value)]
