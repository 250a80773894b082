"""What each quantity does alone: a key figure as it varies, the others as they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bywire.core.typing import Array
from bywire.studies.plan import Varied

ONE = "one-at-a-time"
"""the design that shows it"""


@dataclass(frozen=True)
class Effect:
    """What a key figure does as one quantity varies.

    Parameters
    ----------
    quantity, unit
        Its name and SI unit; of a choice no unit.
    values
        Its values [SI], or the choices, in the order of the cases, shape (levels,).
    figures
        The key figure at each, NaN where it is not defined, shape (levels,).
    nominal
        The key figure of the bench itself.
    """

    quantity: str
    unit: str
    values: Sequence[float | str]
    figures: Array
    nominal: float

    @property
    def least(self) -> float:
        """Least value of the key figure, that of the bench itself among them."""
        return float(np.nanmin([*self.figures, self.nominal]))

    @property
    def largest(self) -> float:
        """Largest value."""
        return float(np.nanmax([*self.figures, self.nominal]))

    @property
    def swing(self) -> float:
        """How far the key figure goes."""
        return self.largest - self.least

    @property
    def lacking(self) -> int:
        """At how many levels it is not defined."""
        return int(np.count_nonzero(~np.isfinite(self.figures)))


def effects(
    varied: Sequence[Varied], levels: int, columns: Sequence[Sequence[float | str]], figure: Array
) -> list[Effect]:
    """Return what each quantity does to a key figure, the largest swing first.

    Quantities with which the figure is not defined any more come before that.

    Parameters
    ----------
    varied, levels
        What varies, and how many values each has; those of single values have theirs.
    columns
        Values of each quantity in every case, the bench itself first.
    figure
        The key figure in every case; what is not computed yet is missing at the end.
    """
    found: list[Effect] = []
    begin = 1
    for each, column in zip(varied, columns, strict=True):
        end = begin + len(each.distribution.levels(levels))
        figures = figure[begin:end]
        if figures.size == end - begin and np.isfinite([figure[0], *figures]).any():
            found.append(
                Effect(each.name, each.unit, list(column[begin:end]), figures, float(figure[0]))
            )
        begin = end
    return sorted(found, key=lambda effect: (-effect.lacking, -effect.swing))
