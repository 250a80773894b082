"""Laws of probability by closed forms: as SciPy's, digit for digit, without what these load.

``scipy.stats`` takes as long to load as all else of a study, and every process of one would.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy import special

from bywire.core.typing import Array


class Law(Protocol):
    """A law of probability over the real numbers."""

    def support(self) -> tuple[float, float]:
        """Return its ends."""
        ...

    def ppf(self, q: Array) -> Array:
        """Return the values below which such shares lie, of shares in (0, 1)."""
        ...

    def cdf(self, x: float) -> float:
        """Return the probability of what lies below a value."""
        ...

    def sf(self, x: float) -> float:
        """Return the probability of what lies above a value."""
        ...


@dataclass(frozen=True)
class Uniform:
    """Evenly from ``low`` on, over a width."""

    low: float
    width: float

    def support(self) -> tuple[float, float]:
        """Return its ends."""
        return self.low, self.width + self.low

    def ppf(self, q: Array) -> Array:
        """Return quantiles."""
        return q * self.width + self.low

    def cdf(self, x: float) -> float:
        """Return the probability below."""
        return min(max((x - self.low) / self.width, 0.0), 1.0)

    def sf(self, x: float) -> float:
        """Return the probability above."""
        return 1.0 - self.cdf(x)


@dataclass(frozen=True)
class Normal:
    """The normal one, by mean and standard deviation."""

    mean: float
    sd: float

    def support(self) -> tuple[float, float]:
        """Return its ends: none."""
        return -math.inf, math.inf

    def ppf(self, q: Array) -> Array:
        """Return quantiles."""
        return np.asarray(normal_quantile(q) * self.sd + self.mean)

    def cdf(self, x: float) -> float:
        """Return the probability below."""
        return float(special.ndtr((x - self.mean) / self.sd))

    def sf(self, x: float) -> float:
        """Return the probability above."""
        return float(special.ndtr((self.mean - x) / self.sd))


@dataclass(frozen=True)
class LogNormal:
    """Of which the logarithm is normal, with standard deviation ``sigma`` around the median's."""

    sigma: float
    median: float

    def support(self) -> tuple[float, float]:
        """Return its ends."""
        return 0.0, math.inf

    def ppf(self, q: Array) -> Array:
        """Return quantiles."""
        return np.asarray(np.exp(self.sigma * normal_quantile(q)) * self.median)

    def cdf(self, x: float) -> float:
        """Return the probability below."""
        return float(special.ndtr(self._score(x)))

    def sf(self, x: float) -> float:
        """Return the probability above."""
        return float(special.ndtr(-self._score(x)))

    def _score(self, x: float) -> float:
        share = x / self.median
        return math.log(share) / self.sigma if share > 0.0 else -math.inf


@dataclass(frozen=True)
class Triangular:
    """Rising to a mode and falling from it; the mode as a share of the width."""

    mode: float
    low: float
    width: float

    def support(self) -> tuple[float, float]:
        """Return its ends."""
        return self.low, self.width + self.low

    def ppf(self, q: Array) -> Array:
        """Return quantiles."""
        c = self.mode
        shares = np.where(q < c, np.sqrt(c * q), 1 - np.sqrt((1 - c) * (1 - q)))
        return np.asarray(shares * self.width + self.low)

    def cdf(self, x: float) -> float:
        """Return the probability below."""
        at, c = min(max((x - self.low) / self.width, 0.0), 1.0), self.mode
        return at * at / c if at < c else 1.0 - (1.0 - at) ** 2 / (1.0 - c) if c < 1.0 else at * at

    def sf(self, x: float) -> float:
        """Return the probability above."""
        return 1.0 - self.cdf(x)


def truncated_normal(low: float, high: float, mean: float, sd: float) -> Law:
    """Return the normal law of what lies between two scores; SciPy's, for its tails' digits."""
    from scipy import stats

    law: Law = stats.truncnorm(low, high, mean, sd)
    return law


def normal_quantile(share: Any) -> Any:
    """Return the standard normal score below which a share lies."""
    return special.ndtri(share)


def binomial_ranks(count: int, probability: float, beyond: float) -> tuple[int, int]:
    """Return the ends of how often something comes, with a share beyond either of them.

    Parameters
    ----------
    count, probability
        Trials, and how probable it is in each.
    beyond
        Share, above 0 and below 1/2.

    Returns
    -------
    tuple
        The least number that no more come with at least this probability, and the least one that
        more come with at most this probability.
    """
    low = _least(lambda k: special.bdtr(k, count, probability) >= beyond, count)
    high = _least(lambda k: special.bdtrc(k, count, probability) <= beyond, count)
    return low, high


def _least(is_enough: Any, count: int) -> int:
    """Return the least number for which something holds that holds for all above it."""
    below, above = -1, count
    while above - below > 1:
        middle = (below + above) // 2
        below, above = (below, middle) if is_enough(middle) else (middle, above)
    return above


def ranked(values: Array) -> Array:
    """Return the ranks of values from 1 on, that of equal ones their mean."""
    _, place, times = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(times)
    return np.asarray((last - 0.5 * (times - 1))[place])
