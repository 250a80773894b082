"""The probability that a requirement is missed: an estimate, its interval, where it is from."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from bywire.core.typing import Array
from bywire.studies.laws import normal_quantile
from bywire.studies.statistics import Outcome, share

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
