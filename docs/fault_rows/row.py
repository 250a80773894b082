"""One figure that is stated of a fault, beside the one that is computed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

FLOORS = {"bar": 0.2, "ms": 10.0}
"""admitted at least, by unit, where a tenth of what is stated is less"""


@dataclass(frozen=True)
class Row:
    """A figure of a fault.

    Parameters
    ----------
    fault
        What fails, as ``[[faults]]`` names it where it does.
    what
        Which figure.
    stated
        It, or least and most of it; None where none is stated.
    unit
        Of both figures.
    computed
        Runs our bench.
    because
        Why the two disagree; empty where they agree.
    note
        What explains a figure that agrees, or of which none is stated.
    daily
        Whether it is cheap enough for every run of the tests.
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
        """Return whether a value lies within a tenth, or the unit's floor, of what is stated."""
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
