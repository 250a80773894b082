"""What the cases of a study say: probabilities and quantiles with intervals, and spread.

Intervals are those of independent cases. Latin hypercubes and scrambled sequences scatter less, of
averages at least: their intervals are on the safe side as a rule (A. B. Owen, Monte Carlo variance
of scrambled net quadrature, SIAM J. Numer. Anal. 34, 1997).
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
    """How often something was so, and what that says of how probable it is.

    Parameters
    ----------
    count, cases
        How often, of how many.
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
    it holds the probability at least as often as it claims.

    Parameters
    ----------
    count, cases
        How often it was so, of how many independent cases.
    confidence
        Of the interval.

    Examples
    --------
    >>> round(share(0, 100, 0.95).high, 4)  # nothing seen in a hundred is no proof
    0.0362
    """
    if not cases:
        return Share(0, 0, 0.0, 1.0)
    beyond = 0.5 * (1.0 - confidence)
    # As quantiles of beta distributions: stats.binomtest looks for the same ends a hundred times
    # as long.
    low = special.betaincinv(count, cases - count + 1, beyond) if count else 0.0
    high = special.betaincinv(count + 1, cases - count, 1.0 - beyond) if count < cases else 1.0
    return Share(count, cases, float(low), float(high))


def judged(met: Share, surely: Share, wanted: float) -> Outcome:
    """Return whether a requirement is met with a probability.

    Parameters
    ----------
    met
        Cases that meet it, or may do so within the error of their figures.
    surely
        Cases that meet it for certain.
    wanted
        Least probability.
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
        Share of the cases below it.
    value, low, high
        Estimate and interval; NaN where the cases are too few for one.
    """

    probability: float
    value: float
    low: float
    high: float


def quantile(values: Array, probability: float, confidence: float) -> Quantile:
    """Return a quantile of independent values with an interval that needs no distribution.

    W. J. Conover, Practical Nonparametric Statistics (1999), section 3.2: order statistics whose
    ranks the binomial distribution gives.
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
    """How a key figure goes with a quantity that varies.

    Parameters
    ----------
    quantity
        Its name.
    correlation
        Rank correlation (Spearman), -1 to 1; the partial one where quantities are correlated.
    low, high
        Its interval.
    """

    quantity: str
    correlation: float
    low: float
    high: float

    @property
    def strength(self) -> float:
        """How strong it is, 0 to 1, whatever its sign."""
        return abs(self.correlation)

    @property
    def is_distinct(self) -> bool:
        """Whether it differs from none."""
        return self.low > 0.0 or self.high < 0.0


def influences(
    names: Sequence[str],
    columns: Sequence[Array],
    figure: Array,
    confidence: float,
    is_partial: bool = False,
) -> list[Influence]:
    """Return how a key figure goes with each quantity, the strongest first.

    A rank correlation sees what rises or falls throughout; a quantity whose effect has an optimum
    within its range it may miss. The interval is Fisher's with the variance of Bonett and Wright,
    Psychometrika 65, 2000.

    Of quantities that are correlated one seems to drive what the other does. The partial rank
    correlation is that of what the others, by a straight line through ranks, do not tell of
    either (R. L. Iman and W. J. Conover, Small sample sensitivity analysis techniques for computer
    models, Communications in Statistics A9, 1980); its interval has a case less for each of them.

    Parameters
    ----------
    names, columns
        Quantities, and their values in each case, shape (cases,) each.
    figure
        The key figure in each case, shape (cases,); cases without one are left out.
    confidence
        Of the intervals.
    is_partial
        Whether correlations are partial ones.
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
        found.append(Influence(name, r, min(low, r), max(high, r)))  # one of 1 lies at its end
    return sorted(found, key=lambda each: -abs(each.correlation))


def _rests(x: Array, y: Array, others: Sequence[Array]) -> tuple[Array, Array]:
    """Return what other ranks, by a straight line, do not tell of ranks of two."""
    if not others:
        return x - x.mean(), y - y.mean()
    known, both = np.column_stack([np.ones(x.size), *others]), np.column_stack([x, y])
    rest = both - known @ np.linalg.lstsq(known, both, rcond=None)[0]
    return rest[:, 0], rest[:, 1]


def _correlation(x: Array, y: Array) -> float:
    """Return the correlation of centered values; 0 where one of them is rounding alone."""
    # Sums, and no products of vectors: of 10,000 numbers BLAS wakes all cores, and waits for them.
    xx, yy, xy = (float(np.sum(a * b)) for a, b in ((x, x), (y, y), (x, y)))
    size = math.sqrt(xx * yy)
    return xy / size if size > 1e-9 * x.size**3 else 0.0


def running_share(met: NDArray[np.bool_], confidence: float, count: int = 60) -> list[Share]:
    """Return how an estimate came about: the share of the first cases, of ever more of them."""
    sizes = np.unique(np.geomspace(1, max(met.size, 1), count).astype(int))
    return [share(int(met[:n].sum()), int(n), confidence) for n in sizes if met.size]


# --- Spread of a key figure over the cases

QUANTILES = (0.05, 0.5, 0.95)
"""shares of the cases below the quantiles that are shown"""


@dataclass(frozen=True)
class Spread:
    """A key figure over all cases; values in ``unit``, NaN where no case has it.

    Parameters
    ----------
    name, unit
        The figure.
    nominal
        What the bench itself gives.
    undefined
        Cases in which it is not defined, or without a result.
    mean, sd
        Mean and standard deviation.
    quantiles
        Those of `QUANTILES`, with intervals.
    least, largest
        Ends.
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
    """Return the spread of a key figure that some case has.

    Parameters
    ----------
    name, unit, nominal
        The figure, and what the bench itself gives.
    figure
        In every case, shape (cases,); NaN where a case does not have it.
    confidence
        Of the intervals of its quantiles, between 0 and 1.
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


# --- Probability of a missed requirement: an estimate, its interval, where it is from

State = Literal["done", "negligible", "budget spent", "unfinished", "level", "no design point"]


@dataclass(frozen=True)
class Interval:
    """An estimate of a probability with its coefficient of variation and its interval.

    Parameters
    ----------
    value, variation
        The estimate and its standard deviation over it; NaN where there is none.
    low, high
        Ends of the interval.
    """

    value: float
    variation: float
    low: float
    high: float


UNKNOWN = Interval(math.nan, math.nan, 0.0, 1.0)
"""what is known of a probability without any case"""


def interval(value: float, variation: float, confidence: float) -> Interval:
    """Return an estimate with an interval that is log-normal: products of shares are skewed.

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
    """Return a probability by independent cases, with its exact interval."""
    exact = share(count, cases, confidence)
    variation = math.sqrt((1.0 - exact.value) / count) if count else math.nan
    return Interval(exact.value, variation, exact.low, exact.high)


@dataclass(frozen=True)
class Level:
    """A level of subset simulation, or the only one of another method.

    Parameters
    ----------
    margin
        Margin at which it ends, in the figure's unit; zero of the last.
    probability
        That a case has this margin or less.
    """

    margin: float
    probability: float


@dataclass(frozen=True)
class FailureProbability:
    """How probable a failure is, by a method for rare ones.

    Parameters
    ----------
    state
        ``done``; ``negligible``: below what the method went on for; ``budget spent``;
        ``unfinished``: cases are not computed yet; ``level``: too many cases have the same figure;
        ``no design point``: a search found none.
    estimate
        Of the probability that the margin is <= 0; of a method that did not come there, an upper
        end alone.
    below
        ``below(x)``: estimate of the probability that the margin is <= x, in the figure's unit.
    levels
        How the estimate came about.
    runs
        Cases used.
    span
        Least and largest margin of which ``below`` has something to say; none where it has not.
    place, scores
        The most probable failing case: its place among the cases used, and its standard normal
        scores, independent ones; None where none failed.
    center
        Where failures lie: the mean of their scores, or FORM's design point; None where it is not
        known.
    failing
        Scores of failing cases, as probable as they are, shape (cases, quantities); None of another
        method than subset simulation.
    first_order
        FORM's reliability index beta; NaN of another method.
    failed
        How many of the cases failed, where somebody has counted them.
    why
        What else there is to say of the state.
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
        """Return the estimate with the interval that decides.

        Parameters
        ----------
        error
            As of `outcome`.
        """
        low, high = self.below(-error).low, self.below(error).high
        known = self.estimate
        return replace(known, low=min(low, known.low), high=max(high, known.high))

    def outcome(self, wanted: float, error: float) -> Outcome:
        """Return whether a requirement is met with a probability.

        Parameters
        ----------
        wanted
            Least probability that it is met.
        error
            What the figure may be off by, in its unit: cases this close to the limit count for
            neither side.
        """
        decides, allowed = self.within(error), 1.0 - wanted
        if decides.high <= allowed:
            return "met"
        return "missed" if decides.low > allowed else "undecided"
