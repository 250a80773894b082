"""Selection of the cases and quantities that a study's figure draws, and its caption."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

POINTS = 4000
"""maximum number of scatter plot points that meet the limit, and of those without the figure"""
CROSSES = 20_000
"""maximum number of scatter plot points that miss the limit"""
LINES = 300
"""maximum number of lines that meet all requirements, and of lines that miss one"""

BARS = 8
"""maximum number of quantities in a panel of bars"""


@dataclass(frozen=True)
class DrawnCases:
    """The cases that a figure draws.

    Parameters
    ----------
    columns
        Columns of the drawn cases, by name.
    rows
        Row of each drawn case among all cases.
    met, missed
        Places, in the columns, of the cases that meet the requirements, and of the others.
    lacking
        Places of the cases without the figure, which therefore miss the limit.
    all_met, all_missed, all_lacking
        Total number of each.
    """

    columns: Mapping[str, NDArray[Any]]
    rows: NDArray[np.intp]
    met: NDArray[np.intp]
    missed: NDArray[np.intp]
    lacking: NDArray[np.intp]
    all_met: int
    all_missed: int
    all_lacking: int

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


@dataclass
class CaseSelection:
    """Even selection of cases to draw, from blocks of cases: all, if they can be distinguished.

    Parameters
    ----------
    all_met, all_missed, all_lacking
        Total number of cases that meet the requirements, of the others, and of cases without the
        figure, which therefore miss the limit.
    most_met, most_missed
        Maximum numbers of drawn cases.
    """

    all_met: int
    all_missed: int
    most_met: int
    most_missed: int
    all_lacking: int = 0

    def __post_init__(self) -> None:
        self._kinds = (
            _EvenRows(self.all_met, self.most_met),
            _EvenRows(self.all_missed, self.most_missed),
            _EvenRows(self.all_lacking, POINTS),
        )
        self._blocks: list[tuple[dict[str, NDArray[Any]], NDArray[np.intp]]] = []
        self._sizes: list[tuple[int, int, int]] = []
        self._passed = 0

    def add(
        self,
        columns: Mapping[str, NDArray[Any]],
        met: NDArray[np.bool_],
        known: NDArray[np.bool_] | None = None,
    ) -> None:
        """Select cases of a block.

        Parameters
        ----------
        columns
            Columns to keep for the figure, by name.
        met
            Whether each case meets the requirements, shape (cases,).
        known
            Whether each case has the drawn figure, shape (cases,); default: all.
        """
        shown = np.ones(met.size, dtype=bool) if known is None else known
        masks = (met & shown, ~met & shown, ~shown)
        each = [kind.of(mask) for kind, mask in zip(self._kinds, masks, strict=True)]
        rows = np.concatenate(each)
        self._sizes.append((each[0].size, each[1].size, each[2].size))
        self._blocks.append(
            ({name: column[rows] for name, column in columns.items()}, self._passed + rows)
        )
        self._passed += met.size

    @property
    def cases(self) -> DrawnCases:
        """The selected cases, once all blocks are added."""
        names = self._blocks[0][0] if self._blocks else ()
        kinds = np.concatenate([np.repeat(np.arange(3), sizes) for sizes in self._sizes])
        met, missed, lacking = (np.flatnonzero(kinds == kind) for kind in range(3))
        return DrawnCases(
            {name: np.concatenate([block[name] for block, _ in self._blocks]) for name in names},
            np.concatenate([rows for _, rows in self._blocks]),
            met,
            missed,
            lacking,
            self.all_met,
            self.all_missed,
            self.all_lacking,
        )


class _EvenRows:
    """Evenly selected true rows of a mask that arrives in blocks."""

    def __init__(self, count: int, most: int) -> None:
        is_whole = count <= most
        self._chosen = np.linspace(0, max(count - 1, 0), count if is_whole else most).astype(
            np.intp
        )
        self._passed = 0

    def of(self, mask: NDArray[np.bool_]) -> NDArray[np.intp]:
        rows = np.flatnonzero(mask)
        begin, end = np.searchsorted(self._chosen, [self._passed, self._passed + rows.size])
        chosen = rows[self._chosen[begin:end] - self._passed]
        self._passed += rows.size
        return chosen
