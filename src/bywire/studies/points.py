"""Where a study computes: designs of points, as probabilities of every quantity.

A chunk of points depends on the seed and its number alone, so that chunks may be computed in any
order, anywhere, and more of them be added later.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import special

from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.studies.distribution import Distribution
from bywire.studies.laws import normal_quantile

SAMPLED = ("monte-carlo", "latin-hypercube", "sobol")
"""designs that draw from the distributions: what they count are probabilities"""
SPANNED = ("grid", "corners", "one-at-a-time")
"""designs that go to the ends: what they show is what may happen, not how often"""
MOST = 10_000_000
"""cases of one study"""
_INSIDE = (2.0**-53, 1.0 - 2.0**-53)  # probabilities that have a finite quantile
_CORNERS = 16  # quantities of which all corners are visited


@dataclass(frozen=True)
class Sampled:
    """Points that are drawn, chunk by chunk.

    Parameters
    ----------
    kind
        One of `SAMPLED`. Of a Latin hypercube every chunk is one, so that more can be added; a
        Sobol sequence is scrambled.
    seed
        Of its random numbers.
    distributions
        Of each quantity.
    factor
        Lower triangular factor of the correlation of their normal scores; None of independent ones.
    """

    kind: str
    seed: int
    distributions: Sequence[Distribution]
    factor: Array | None = None

    def values(self, chunk: int, size: int) -> list[NDArray[np.generic]]:
        """Return the values of each quantity in a chunk of points, shape (size,) each."""
        u = np.clip(self._probabilities(chunk, size), *_INSIDE)
        if self.factor is not None:
            return self.values_at(normal_quantile(u))
        return self._quantiles(u)

    def values_at(self, scores: Array) -> list[NDArray[np.generic]]:
        """Return the values of each quantity at independent standard normal scores.

        Parameters
        ----------
        scores
            Shape (cases, quantities).
        """
        return self._quantiles(np.clip(special.ndtr(self.correlated(scores)), *_INSIDE))

    def correlated(self, scores: Array) -> Array:
        """Return the normal scores of the quantities by independent ones."""
        return scores if self.factor is None else scores @ self.factor.T

    def _quantiles(self, u: Array) -> list[NDArray[np.generic]]:
        return [each.quantile(u[:, k]) for k, each in enumerate(self.distributions)]

    def _probabilities(self, chunk: int, size: int) -> Array:
        """Return points of the unit cube, shape (size, quantities)."""
        count = len(self.distributions)
        if self.kind == "sobol":
            from scipy.stats import qmc  # slow to load

            sequence = qmc.Sobol(count, scramble=True, rng=np.random.default_rng(self.seed))
            if chunk:
                sequence.fast_forward(chunk * size)
            return np.asarray(sequence.random(size))
        rng = np.random.default_rng((self.seed, chunk))
        if self.kind == "latin-hypercube":
            from scipy.stats import qmc

            return np.asarray(qmc.LatinHypercube(count, rng=rng).random(size))
        return rng.random((size, count))


@dataclass(frozen=True)
class Spanned:
    """Points that are listed: all of them at once.

    Parameters
    ----------
    columns
        Values of each quantity, shape (cases,) each.
    """

    columns: Sequence[NDArray[np.generic]]

    @property
    def cases(self) -> int:
        """How many points there are."""
        return len(self.columns[0])

    def values(self, chunk: int, size: int) -> list[NDArray[np.generic]]:
        """Return the values of each quantity in a chunk of points; the last one is shorter."""
        return [column[chunk * size : (chunk + 1) * size] for column in self.columns]


def spanned(
    kind: str, distributions: Sequence[Distribution], nominal: Sequence[object], levels: int
) -> Spanned:
    """Return the points of a design that goes to the ends, the bench's own values first.

    Parameters
    ----------
    kind
        ``grid``: all combinations of ``levels`` values each; ``corners``: of both ends of each;
        ``one-at-a-time``: ``levels`` values of each, the others as they are.
    distributions
        Of each quantity.
    nominal
        What the bench has.
    levels
        Values of each quantity, >= 2; quantities of single values take these.

    Raises
    ------
    ParameterError
        For more cases than a study may have.
    """
    if kind == "corners" and len(distributions) > _CORNERS:
        raise ParameterError(
            f"[design] corners of {len(distributions)} quantities are too many (at most "
            f"{_CORNERS}): take 'latin-hypercube', or 'one-at-a-time' to see which matter"
        )
    each = [d.levels(2 if kind == "corners" else levels) for d in distributions]
    if kind == "one-at-a-time":
        rows = [
            [*nominal[:k], value, *nominal[k + 1 :]]
            for k, values in enumerate(each)
            for value in values
        ]
    else:
        count = int(np.prod([float(len(values)) for values in each]))
        if count > MOST:
            raise ParameterError(
                f"[design] a grid of {count:.3g} cases is too large (at most {MOST:.0e}): take "
                "fewer levels, or 'latin-hypercube'"
            )
        rows = [list(row) for row in product(*each)]
    rows.insert(0, list(nominal))
    return Spanned([np.array(column) for column in zip(*rows, strict=True)])
