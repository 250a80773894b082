"""How a quantity varies: a distribution, drawn by its quantile function.

A range or a tolerance is a distribution as any other; a grid and a worst-case search use its ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.core.typing import Array

NEVER = 1e-9
"""probability that counts as none: of values that the model would not admit"""
TAIL = 0.5 * math.erfc(3.0 / math.sqrt(2.0))
"""probability beyond 3 standard deviations, at which a grid ends where a distribution does not"""


@dataclass(frozen=True)
class Distribution:
    """How a quantity varies.

    Parameters
    ----------
    kind
        What the study file calls it.
    text
        What it is, for instance ``"normal, mean 0.39 ohm, sd 0.02 ohm"``.
    quantile
        ``quantile(u) -> values`` [SI], of probabilities in (0, 1), shape (n,) each; of choices,
        an array of texts.
    low, high
        Ends [SI]; infinite where there is none, NaN of choices.
    below, above
        ``below(x)``, ``above(x)``: probability of values below and above; None of single values,
        which end at ``low`` and ``high``.
    singles
        Single values that it has [SI], or texts, in the order in which probabilities go through
        them; none of what has any value.
    weights
        Probability of each of them.
    """

    kind: str
    text: str
    quantile: Callable[[Array], NDArray[Any]]
    low: float = math.nan
    high: float = math.nan
    below: Callable[[float], float] | None = None
    above: Callable[[float], float] | None = None
    singles: tuple[Any, ...] = ()
    weights: tuple[float, ...] = ()

    @property
    def is_discrete(self) -> bool:
        """Whether it has single values."""
        return bool(self.singles)

    def levels(self, count: int) -> NDArray[Any]:
        """Return values for a grid: evenly from end to end; those of single values as they are.

        Where it has no end, the grid ends 3 standard deviations from the middle of a normal one:
        at a probability of 0.135 % beyond.
        """
        if self.is_discrete:
            return np.array(self.singles)
        near = self.quantile(np.array([TAIL, 1.0 - TAIL])).tolist()
        low = self.low if math.isfinite(self.low) else float(near[0])
        high = self.high if math.isfinite(self.high) else float(near[1])
        return np.asarray(np.linspace(low, high, count))

    def between(self, places: Array) -> NDArray[Any]:
        """Return values by their places between the ends of `levels`, 0 to 1."""
        ends = self.levels(2)
        if self.is_discrete:
            return np.asarray(ends[np.minimum((places * ends.size).astype(int), ends.size - 1)])
        return np.asarray(ends[0] + places * (ends[1] - ends[0]))
