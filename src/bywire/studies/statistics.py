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


def quantile(values: Array, probability: float, confidence: float) -> Quantile:
    """Return a quantile of independent values with a distribution-free interval.

    W. J. Conover, Practical Nonparametric Statistics (1999), section 3.2: order statistics, with
    ranks from the binomial distribution.
    """
    if not values.size:
        return Quantile(probability, math.nan, math.nan, math.nan)
    beyond = 0.5 * (1.0 - confidence)
    low, above = binomial_ranks(values.size, probability, beyond)
    below = low - 1
    ordered = np.sort(values)
    return Quantile(
        probability,
        float(np.quantile(values, probability)),
        float(ordered[below]) if below >= 0 else math.nan,
        float(ordered[above]) if above < values.size else math.nan,
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


def running_share(met: NDArray[np.bool_], confidence: float, count: int = 60) -> list[Share]:
    """Return the convergence of an estimate: its value for a growing number of first cases."""
    sizes = np.unique(np.geomspace(1, max(met.size, 1), count).astype(int))
    return [share(int(met[:n].sum()), int(n), confidence) for n in sizes if met.size]


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


def spread_of(name: str, unit: str, nominal: float, figure: Array, confidence: float) -> Spread:
    """Return the spread of a key figure that is defined in at least one case.

    Parameters
    ----------
    name, unit, nominal
        Name and unit of the figure, and its value in the bench itself.
    figure
        Its value in every case, shape (cases,); NaN if it is undefined.
    confidence
        Confidence of the intervals of its quantiles, between 0 and 1.
    """
    known = figure[np.isfinite(figure)]
    return Spread(
        name,
        unit,
        nominal,
        figure.size - known.size,
        float(known.mean()),
        float(known.std(ddof=1)) if known.size > 1 else math.nan,
        tuple(quantile(known, p, confidence) for p in QUANTILES),
        float(known.min()),
        float(known.max()),
    )


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
