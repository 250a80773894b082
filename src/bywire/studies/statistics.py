"""Statistics over the cases of a study: probabilities and quantiles with intervals, spread.

Intervals are valid for independent cases. Averages of Latin hypercubes and scrambled sequences
scatter less, so their intervals are usually conservative (A. B. Owen, Monte Carlo variance of
scrambled net quadrature, SIAM J. Numer. Anal. 34, 1997).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import special

from bywire.core.typing import Array
from bywire.studies.distribution import binomial_ranks, normal_quantile, ranked

Outcome = Literal["met", "missed", "undecided"]


@dataclass(frozen=True)
class Share:
    """Relative frequency of an event, and the interval of its probability.

    Parameters
    ----------
    count, cases
        Number of events and of cases.
    low, high
        Interval of the probability.
    """

    count: int
    cases: int
    low: float
    high: float

    @property
    def value(self) -> float:
        """The estimate; NaN without cases."""
        return self.count / self.cases if self.cases else math.nan


def share(count: int, cases: int, confidence: float) -> Share:
    """Return a probability with its exact two-sided interval.

    C. J. Clopper and E. S. Pearson, The use of confidence or fiducial limits, Biometrika 26, 1934:
    the coverage is at least the specified confidence.

    Parameters
    ----------
    count, cases
        Number of events in this number of independent cases.
    confidence
        Confidence of the interval.

    Examples
    --------
    >>> round(share(0, 100, 0.95).high, 4)  # no event in a hundred cases proves little
    0.0362
    """
    if not cases:
        return Share(0, 0, 0.0, 1.0)
    beyond = 0.5 * (1.0 - confidence)
    # Quantiles of beta distributions: stats.binomtest needs a hundred times as long for the same
    # ends.
    low = special.betaincinv(count, cases - count + 1, beyond) if count else 0.0
    high = special.betaincinv(count + 1, cases - count, 1.0 - beyond) if count < cases else 1.0
    return Share(count, cases, float(low), float(high))


def judged(met: Share, surely: Share, wanted: float) -> Outcome:
    """Return whether a requirement is met with the required probability.

    Parameters
    ----------
    met
        Fraction of cases that meet it, or may meet it within their numerical error.
    surely
        Fraction of cases that certainly meet it.
    wanted
        Required probability.
    """
    if surely.low >= wanted:
        return "met"
    return "missed" if met.high < wanted else "undecided"


@dataclass(frozen=True)
class Quantile:
    """A quantile with its interval.

    Parameters
    ----------
    probability
        Fraction of the cases below it.
    value, low, high
        Estimate and interval; NaN if there are too few cases.
    """

    probability: float
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class QuantileRanks:
    """Ranks of the values that determine a quantile and its interval, 0 for the least value.

    Parameters
    ----------
    probability
        Fraction of the values below it.
    at
        Position of the quantile between two ranks.
    low, high
        Ends of its interval; None if there are too few values.
    """

    probability: float
    at: float
    low: int | None
    high: int | None

    @property
    def ranks(self) -> list[int]:
        """All ranks."""
        each = (math.floor(self.at), math.ceil(self.at), self.low, self.high)
        return [rank for rank in each if rank is not None]

    def quantile(self, ordered: Callable[[int], float]) -> Quantile:
        """Return the quantile from ``ordered(rank)``, the value of each rank."""
        first, last = ordered(math.floor(self.at)), ordered(math.ceil(self.at))
        part, step = self.at - math.floor(self.at), last - first
        # as NumPy's quantile, which returns the values themselves at both ends
        value = last - step * (1.0 - part) if part >= 0.5 else first + step * part
        low, high = (math.nan if r is None else ordered(r) for r in (self.low, self.high))
        return Quantile(self.probability, value, low, high)


def quantile_ranks(count: int, probability: float, confidence: float) -> QuantileRanks:
    """Return the ranks of a quantile of independent values, with a distribution-free interval.

    W. J. Conover, Practical Nonparametric Statistics (1999), section 3.2: order statistics, with
    ranks from the binomial distribution.

    Parameters
    ----------
    count
        Number of values, >= 1.
    probability
        Fraction of the values below the quantile.
    confidence
        Confidence of the interval.
    """
    low, high = binomial_ranks(count, probability, 0.5 * (1.0 - confidence))
    return QuantileRanks(
        probability,
        (count - 1) * probability,
        low - 1 if low > 0 else None,
        high if high < count else None,
    )


@dataclass(frozen=True)
class Influence:
    """Relation of a key figure to a quantity that varies.

    Parameters
    ----------
    quantity
        Its name.
    correlation
        Rank correlation (Spearman), -1 to 1; partial rank correlation for correlated quantities.
    low, high
        Its confidence interval.
    """

    quantity: str
    correlation: float
    low: float
    high: float

    @property
    def strength(self) -> float:
        """Strength of the relation, 0 to 1, regardless of its sign."""
        return abs(self.correlation)

    @property
    def is_distinct(self) -> bool:
        """Whether it differs significantly from zero."""
        return self.low > 0.0 or self.high < 0.0


def influences(
    names: Sequence[str],
    columns: Sequence[Array],
    figure: Array,
    confidence: float,
    is_partial: bool = False,
) -> list[Influence]:
    """Return the relation of a key figure to each quantity, the strongest first.

    A rank correlation detects monotonic relations; it may miss a quantity with an optimum within
    its range. The interval is Fisher's with the variance of Bonett and Wright, Psychometrika 65,
    2000.

    Correlated quantities appear to share their effects. The partial rank correlation is that of the
    residuals after a linear regression of the ranks on the ranks of the other quantities (R. L.
    Iman and W. J. Conover, Small sample sensitivity analysis techniques for computer models,
    Communications in Statistics A9, 1980). Its interval uses one case less for each other quantity.

    Parameters
    ----------
    names, columns
        Quantities, and their values in each case, shape (cases,) each.
    figure
        The key figure in each case, shape (cases,); undefined cases do not count.
    confidence
        Confidence of the intervals.
    is_partial
        Whether to compute partial correlations.
    """
    known = np.isfinite(figure)
    count = int(known.sum())
    if count < 8 or np.ptp(figure[known]) == 0.0:
        return []
    reach = float(normal_quantile(0.5 + 0.5 * confidence))
    each = {name: column[known] for name, column in zip(names, columns, strict=True)}
    moving = {name: ranked(x) for name, x in each.items() if np.ptp(x) > 0.0}
    fewer = len(moving) - 1 if is_partial else 0
    if count - 3 - fewer < 1:
        return []
    y = ranked(figure[known])
    found = []
    for name, x in moving.items():
        others = [each for other, each in moving.items() if other != name] if is_partial else []
        r = _correlation(*_rests(x, y, others))
        z = math.atanh(min(max(r, -1.0 + 1e-12), 1.0 - 1e-12))
        width = reach * math.sqrt((1.0 + 0.5 * r * r) / (count - 3 - fewer))
        low, high = math.tanh(z - width), math.tanh(z + width)
        found.append(Influence(name, r, min(low, r), max(high, r)))  # 1 is its own end
    return sorted(found, key=lambda each: -abs(each.correlation))


def _rests(x: Array, y: Array, others: Sequence[Array]) -> tuple[Array, Array]:
    """Return the residuals of two ranks after a linear regression on other ranks."""
    if not others:
        return x - x.mean(), y - y.mean()
    known, both = np.column_stack([np.ones(x.size), *others]), np.column_stack([x, y])
    rest = both - known @ np.linalg.lstsq(known, both, rcond=None)[0]
    return rest[:, 0], rest[:, 1]


def _correlation(x: Array, y: Array) -> float:
    """Return the correlation of centered values; 0 if one of them is only rounding errors."""
    # Sums instead of products of vectors: for 10,000 numbers, BLAS wakes all cores and waits for
    # them.
    xx, yy, xy = (float(np.sum(a * b)) for a, b in ((x, x), (y, y), (x, y)))
    size = math.sqrt(xx * yy)
    return xy / size if size > 1e-9 * x.size**3 else 0.0


def running_sizes(cases: int, count: int = 60) -> NDArray[np.int64]:
    """Return increasing numbers of first cases, for the convergence of an estimate."""
    return np.unique(np.geomspace(1, max(cases, 1), count).astype(np.int64))


# --- Spread of a key figure over the cases

QUANTILES = (0.05, 0.5, 0.95)
"""fractions of the cases below the displayed quantiles"""


@dataclass(frozen=True)
class Spread:
    """A key figure over all cases; values are in ``unit``, NaN if no case has the figure.

    Parameters
    ----------
    name, unit
        Name and unit of the figure.
    nominal
        Value of the bench itself.
    undefined
        Number of cases in which it is undefined, or without a result.
    mean, sd
        Mean and standard deviation.
    quantiles
        Quantiles at `QUANTILES`, with intervals.
    least, largest
        Extreme values.
    counts, edges
        Histogram: number of cases in each bin, and the edges of the bins.
    """

    name: str
    unit: str
    nominal: float
    undefined: int
    mean: float
    sd: float
    quantiles: tuple[Quantile, ...]
    least: float
    largest: float
    counts: NDArray[np.int64]
    edges: Array


_BINS = 60  # maximum number of bins


def bin_count(values: Array) -> int:
    """Return the number of bins that shows the shape of values instead of their scatter."""
    reach = np.ptp(values)
    if not reach > 0.0:
        return 1
    # relative to their reach, since NumPy rejects values that differ only by rounding
    edges = np.histogram_bin_edges((values - values.min()) / reach, bins="auto")
    return int(np.clip(edges.size - 1, 1, _BINS))


def bin_edges(least: float, largest: float, bins: int) -> Array:
    """Return the edges of bins of the same width, like NumPy's histogram."""
    beyond = 0.5 if least == largest else 0.0
    return np.linspace(least - beyond, largest + beyond, bins + 1)


# --- Probability of a missed requirement: estimate, interval, and source

State = Literal["done", "negligible", "budget spent", "unfinished", "level", "no design point"]


@dataclass(frozen=True)
class Interval:
    """An estimate of a probability with its coefficient of variation and its interval.

    Parameters
    ----------
    value, variation
        The estimate, and its relative standard deviation; NaN if there is none.
    low, high
        Ends of the interval.
    """

    value: float
    variation: float
    low: float
    high: float


UNKNOWN = Interval(math.nan, math.nan, 0.0, 1.0)
"""estimate of a probability without any case"""


def interval(value: float, variation: float, confidence: float) -> Interval:
    """Return an estimate with a log-normal interval, because products of fractions are skewed.

    Examples
    --------
    >>> found = interval(1e-4, 0.3, 0.95)
    >>> round(found.low * 1e5, 2), round(found.high * 1e5, 2)
    (5.62, 17.78)
    """
    if not value > 0.0:
        return UNKNOWN
    reach = float(normal_quantile(0.5 + 0.5 * confidence)) * math.sqrt(math.log1p(variation**2))
    return Interval(value, variation, value * math.exp(-reach), min(value * math.exp(reach), 1.0))


def counted(count: int, cases: int, confidence: float) -> Interval:
    """Return a probability from independent cases, with its exact interval."""
    exact = share(count, cases, confidence)
    variation = math.sqrt((1.0 - exact.value) / count) if count else math.nan
    return Interval(exact.value, variation, exact.low, exact.high)


@dataclass(frozen=True)
class Level:
    """A level of subset simulation, or the only level of another method.

    Parameters
    ----------
    margin
        Margin at its end, in the figure's unit; zero for the last level.
    probability
        Probability that a case has at most this margin.
    """

    margin: float
    probability: float


@dataclass(frozen=True)
class FailureProbability:
    """Probability of a failure, by a method for rare failures.

    Parameters
    ----------
    state
        ``done``; ``negligible``: below the minimum probability of interest; ``budget spent``;
        ``unfinished``: cases are not computed yet; ``level``: too many cases have the same figure;
        ``no design point``: the search found no point.
    estimate
        Estimate of the probability that the margin is <= 0; only an upper bound if the method did
        not reach failure.
    below
        ``below(x)``: estimate of the probability that the margin is <= x, in the figure's unit.
    levels
        Levels of the method.
    runs
        Number of cases used.
    span
        Minimum and maximum margin for which ``below`` has an estimate; None without an estimate.
    place, scores
        The most probable failing case: its position among the cases used, and its independent
        standard normal scores; None if no case failed.
    center
        Center of the failures: the mean of their scores, or FORM's design point; None if it is
        unknown.
    failing
        Scores of failing cases with the distribution of failures, shape (cases, quantities); None
        except for subset simulation.
    first_order
        FORM's reliability index beta; NaN for other methods.
    failed
        Number of failed cases, if counted.
    why
        Explanation of the state.
    """

    state: State
    estimate: Interval
    below: Callable[[float], Interval]
    levels: tuple[Level, ...]
    runs: int
    span: tuple[float, float] | None = None
    place: int | None = None
    scores: Array | None = None
    center: Array | None = None
    failing: Array | None = None
    first_order: float = math.nan
    failed: int = 0
    why: str = ""

    def within(self, error: float) -> Interval:
        """Return the estimate with the interval that decides the verdict.

        Parameters
        ----------
        error
            See `outcome`.
        """
        low, high = self.below(-error).low, self.below(error).high
        known = self.estimate
        return replace(known, low=min(low, known.low), high=max(high, known.high))

    def outcome(self, wanted: float, error: float) -> Outcome:
        """Return whether a requirement is met with the required probability.

        Parameters
        ----------
        wanted
            Required probability of meeting the requirement.
        error
            Numerical error of the figure, in its unit: cases closer to the limit count for neither
            side.
        """
        decides, allowed = self.within(error), 1.0 - wanted
        if decides.high <= allowed:
            return "met"
        return "missed" if decides.low > allowed else "undecided"
