"""A stated figure of a fault, next to the computed figure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

FLOORS = {"bar": 0.2, "ms": 10.0}
"""minimum tolerance by unit, used if a tenth of the stated figure is smaller"""


@dataclass(frozen=True)
class Row:
    """A figure of a fault.

    Parameters
    ----------
    fault
        Name of the fault in ``[[faults]]``, if it has one.
    what
        Name of the figure.
    stated
        Stated figure, or its minimum and maximum; None without a stated figure.
    unit
        Unit of both figures.
    computed
        Function that runs the bench and returns the figure.
    because
        Reason for a disagreement; empty if the figures agree.
    note
        Explanation of a figure that agrees or has no stated figure.
    daily
        Whether the row is fast enough for every test run.
    """

    fault: str
    what: str
    stated: float | tuple[float, float] | None
    unit: str
    computed: Callable[[], float]
    because: str = ""
    note: str = ""
    daily: bool = False

    def agrees(self, value: float) -> bool:
        """Return whether a value is within the tolerance: a tenth, or the unit's minimum."""
        if self.stated is None:
            return True
        low, high = self.stated if isinstance(self.stated, tuple) else (self.stated, self.stated)
        floor = FLOORS.get(self.unit, 0.0)
        below, above = (max(0.1 * abs(limit), floor) for limit in (low, high))
        return low - below <= value <= high + above

    def cells(self, value: float) -> tuple[str, ...]:
        """Return the cells of the table."""
        if self.stated is None:
            stated, verdict = "-", ""
        else:
            limits = self.stated if isinstance(self.stated, tuple) else (self.stated,)
            stated = " to ".join(f"{limit:g}" for limit in limits)
            verdict = "yes" if self.agrees(value) else "**no**"
        shown = f"{0.0 if abs(value) < 1e-3 else value:.4g}"
        return (f"`{self.fault}`", self.what, stated, shown, self.unit, verdict)
