"""Selection of the cases and quantities that a study's figure draws, and its caption."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

POINTS = 4000
"""maximum number of scatter plot points that meet the limit; all points that miss it are drawn"""
LINES = 300
"""maximum number of lines that meet all requirements, and of lines that miss one"""

BARS = 8
"""maximum number of quantities in a panel of bars"""


@dataclass(frozen=True)
class DrawnCases:
    """The cases that a figure draws.

    Parameters
    ----------
    met, missed
        Rows of the cases that meet the requirements, and of the others.
    all_met, all_missed
        Total number of each.
    lacking
        Rows of the cases without the figure, which therefore miss the limit; all are drawn.
    """

    met: NDArray[np.intp]
    missed: NDArray[np.intp]
    all_met: int
    all_missed: int
    lacking: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, np.intp))

    def caption(self, met: str, missed: str) -> str:
        """Return the number of drawn cases as text; empty if all are drawn.

        ``met``, ``missed``: predicates of the two kinds, for example ``"meet the limit"``.
        """
        kinds = ((self.met.size, self.all_met, met), (self.missed.size, self.all_missed, missed))
        if all(drawn == count for drawn, count, _ in kinds):
            return ""
        said = " and ".join(
            f"{drawn} of {count} cases that {text}"
            if drawn < count
            else f"all {count} cases that {text}"
            for drawn, count, text in kinds
            if count
        )
        return f"The figure shows {said}."


def drawn_cases(
    met: NDArray[np.bool_],
    most_met: int,
    most_missed: int | None = None,
    known: NDArray[np.bool_] | None = None,
) -> DrawnCases:
    """Return the drawn cases: all, or an even selection if there are too many to distinguish.

    Parameters
    ----------
    met
        Whether each case meets the requirements, shape (cases,).
    most_met, most_missed
        Maximum numbers of drawn cases. Default: all that miss.
    known
        Whether each case has the drawn figure, shape (cases,); default: all. Others are drawn at
        an edge.
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
