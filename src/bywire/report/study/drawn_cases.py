"""How much of a study a figure draws of many cases and quantities, and how its caption says so."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

POINTS = 4000
"""points of a scatter that meet the limit, at most: all that miss it are drawn"""
LINES = 300
"""of parallel coordinates that meet all requirements, and that miss one, at most each"""

BARS = 8
"""quantities in a panel of bars, at most"""


@dataclass(frozen=True)
class DrawnCases:
    """The cases that a figure draws.

    Parameters
    ----------
    met, missed
        Rows of the cases that meet what is required, and of the others.
    all_met, all_missed
        How many there are of each.
    lacking
        Rows of the cases that miss it because they do not have the figure; all are drawn.
    """

    met: NDArray[np.intp]
    missed: NDArray[np.intp]
    all_met: int
    all_missed: int
    lacking: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, np.intp))

    def caption(self, met: str, missed: str) -> str:
        """Return how many cases are drawn; empty where all are.

        ``met``, ``missed``: what cases of each kind do, for instance ``"meet the limit"``.
        """
        kinds = ((self.met.size, self.all_met, met), (self.missed.size, self.all_missed, missed))
        if all(drawn == count for drawn, count, _ in kinds):
            return ""
        said = " and ".join(
            f"{drawn} of {count} cases that {text}"
            if drawn < count
            else f"all that {text} ({count})"
            for drawn, count, text in kinds
            if count
        )
        return f"Drawn are {said}."


def drawn_cases(
    met: NDArray[np.bool_],
    most_met: int,
    most_missed: int | None = None,
    known: NDArray[np.bool_] | None = None,
) -> DrawnCases:
    """Return which cases are drawn, evenly out of all where they are too many to be told apart.

    Parameters
    ----------
    met
        Whether each case meets what is required, shape (cases,).
    most_met, most_missed
        How many are drawn at most; by default all that miss it.
    known
        Whether each case has the figure that is drawn, shape (cases,); by default all. Those that
        do not stand at an edge.
    """
    shown = np.ones(met.size, dtype=bool) if known is None else known
    good, bad = np.flatnonzero(met & shown), np.flatnonzero(~met & shown)
    return DrawnCases(
        _even(good, most_met), _even(bad, most_missed), good.size, bad.size, np.flatnonzero(~shown)
    )


def _even(rows: NDArray[np.intp], most: int | None) -> NDArray[np.intp]:
    if most is None or rows.size <= most:
        return rows
    return rows[np.linspace(0, rows.size - 1, most).astype(np.intp)]
