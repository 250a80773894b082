"""How a key figure goes with a choice, which has no order and so no rank correlation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from bywire.core.typing import Array
from bywire.studies.laws import ranked


@dataclass(frozen=True)
class ChoiceInfluence:
    """How a key figure goes with a choice that varies.

    Parameters
    ----------
    quantity
        Its name.
    correlation_ratio
        0 to 1: beside sizes of rank correlations; it has no sign.
    is_distinct
        Whether it differs from none.
    """

    quantity: str
    correlation_ratio: float
    is_distinct: bool

    @property
    def strength(self) -> float:
        """How strong it is, 0 to 1."""
        return self.correlation_ratio


def choice_influence(
    quantity: str, choices: Sequence[str], figure: Array, confidence: float
) -> ChoiceInfluence | None:
    """Return how a key figure goes with a choice; None where either does not vary.

    The square of the ratio is the share of the ranks' variance that lies between the choices, less
    what chance makes of it (T. L. Kelley, An unbiased correlation ratio measure, Proc. Natl. Acad.
    Sci. 21, 1935). With two choices it is the size of the rank correlation with either, but for
    that. Whether it differs from none, ranks alone tell (W. H. Kruskal and W. A. Wallis, Use of
    ranks in one-criterion variance analysis, J. Am. Stat. Assoc. 47, 1952); an interval would need
    to know how the figure is distributed.

    Parameters
    ----------
    quantity, choices
        Its name, and the choice of each case.
    figure
        The key figure in each case, shape (cases,); cases without one are left out.
    confidence
        With which it differs from none, between 0 and 1.
    """
    known = np.isfinite(figure)
    y = ranked(figure[known])
    _, group = np.unique(np.asarray(choices, dtype=str)[known], return_inverse=True)
    counts = np.bincount(group)
    if counts.size < 2 or y.size - counts.size < 1 or np.ptp(y) == 0.0:
        return None
    within = y - (np.bincount(group, y) / counts)[group]
    rest = float(np.sum(within**2) / np.sum((y - y.mean()) ** 2))
    ratio = math.sqrt(max(0.0, 1.0 - rest * (y.size - 1) / (y.size - counts.size)))
    by_chance = float(special.chdtrc(counts.size - 1, (y.size - 1) * (1.0 - rest)))
    return ChoiceInfluence(quantity, ratio, by_chance < 1.0 - confidence)
