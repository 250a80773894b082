"""Requirements as limit states, and their rare failures, by FORM and by subset simulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from bywire.bench.requirements import Limit
from bywire.core.typing import Array
from bywire.data.file_format import library
from bywire.studies.designs import OPENTURNS, STEPS, TOGETHER
from bywire.studies.distribution import NEVER
from bywire.studies.statistics import (
    UNKNOWN,
    FailureProbability,
    Interval,
    Level,
    State,
    counted,
    interval,
)

BEYOND = -1e300
"""margin of a case without the figure, which is a failure beyond every level"""
_LEAST = float(np.finfo(float).tiny)  # margin of a case that meets its limit exactly

Margins = Callable[[Array], Array]
"""margins of a batch of cases from their scores, shape (cases, quantities); a case fails at <= 0"""


class UnfinishedError(Exception):
    """Requested cases are missing, because the budget is spent or they are not computed."""


class BudgetSpentError(UnfinishedError):
    """The budget of cases is spent."""


def margins_of(values: Array, limit: Limit) -> Array:
    """Return each figure's margin to its limit, in its unit; the limit is missed at <= 0.

    An undefined figure has the margin `BEYOND`, a finite number, because levels rank margins.

    Examples
    --------
    >>> limit = Limit("overshoot", "<=", 15.0, "%", "<= 15 %")
    >>> margins_of(np.array([14.0, 16.0, np.nan]), limit).tolist()
    [1.0, -1.0, -1e+300]
    """
    distance = limit.bound - values if limit.is_upper else values - limit.bound
    finite = np.clip(np.where(np.isnan(values), BEYOND, distance), BEYOND, -BEYOND)
    return np.asarray(
        np.where(limit.is_met(values), np.maximum(finite, _LEAST), np.minimum(finite, 0.0))
    )


@dataclass
class Trail:
    """The cases that a method requested, in order.

    Parameters
    ----------
    margins
        Function of their margins; see `Margins`.
    """

    margins: Margins
    _scores: list[Array] = field(default_factory=list)
    _values: list[Array] = field(default_factory=list)
    _stopped: list[BaseException] = field(default_factory=list)

    def __call__(self, scores: Any) -> Array:
        """Return the margins of a batch, and record scores and margins."""
        z = np.array(scores, dtype=float)
        if self._stopped:
            raise self._stopped[0]
        try:
            values = self.margins(z)
        except BaseException as error:
            self._stopped.append(error)
            raise
        self._scores.append(z)
        self._values.append(values)
        return values

    @property
    def runs(self) -> int:
        """Number of cases."""
        return sum(map(len, self._values))

    @property
    def nearest(self) -> tuple[int, Array] | None:
        """The most probable failing case: its position and scores; None if no case failed."""
        if not self._values:
            return None
        scores, failed = np.vstack(self._scores), np.concatenate(self._values) <= 0.0
        if not failed.any():
            return None
        place = int(np.argmin(np.where(failed, (scores**2).sum(axis=1), np.inf)))
        return place, scores[place]

    @contextmanager
    def within_library(self, seed: int) -> Iterator[None]:
        """Raise the error of a batch unchanged, which the library would wrap in its own error.

        The library's random numbers are global, so their state is restored for other users.
        """
        ot = library("openturns", *OPENTURNS)
        state, shown = ot.RandomGenerator.GetState(), ot.Log.Flags()
        ot.Log.Show(ot.Log.NONE)
        # a seed has 32 bits
        ot.RandomGenerator.SetSeed(int(np.random.SeedSequence(seed).generate_state(1)[0]))
        try:
            yield
        except Exception:
            if self._stopped:
                raise self._stopped[0] from None
            raise
        finally:
            ot.RandomGenerator.SetState(state)
            ot.Log.Show(shown)


def failing_event(margins: Margins, quantities: int, step: float | None = None) -> Any:
    """Return the library's event of a margin <= 0 of standard normal scores.

    Parameters
    ----------
    margins
        Function of a batch of cases.
    quantities
        Number of scores of a case.
    step
        Step of central differences for derivatives, in scores; None without derivatives.
    """
    ot = library("openturns", *OPENTURNS)

    def batch(scores: Any) -> Array:
        return margins(np.asarray(scores))[:, None]

    function = ot.Function(ot.PythonFunction(quantities, 1, func_sample=batch))
    if step is not None:
        function.setGradient(ot.CenteredFiniteDifferenceGradient(step, function.getEvaluation()))
    vector = ot.CompositeRandomVector(function, ot.RandomVector(ot.Normal(quantities)))
    return ot.ThresholdEvent(vector, ot.LessOrEqual(), 0.0)


# --- Importance sampling around the most probable failure, which FORM finds

_STEP = 0.1  # of the differences, in scores: larger than a figure's noise and steps
_ITERATIONS = 30


class _NoDesignPointError(Exception):
    """The search ended without a point on the limit."""


@dataclass
class _Drawn:
    """Cases drawn around the center, with their weights."""

    margins: list[Array] = field(default_factory=list)
    weights: list[Array] = field(default_factory=list)

    @property
    def span(self) -> tuple[float, float]:
        """Range of margins around failure with similar weights."""
        low, high = np.quantile(np.concatenate(self.margins), [0.05, 0.6])
        return float(low), max(float(high), 0.0)

    def below(self, confidence: float, margin: float) -> Interval:
        """Return the probability of a margin <= the given margin."""
        if not self.margins:
            return UNKNOWN
        weights, failed = np.concatenate(self.weights), np.concatenate(self.margins) <= margin
        if (weights == 1.0).all():  # drawn from the true distribution: exact
            return counted(int(failed.sum()), failed.size, confidence)
        counts = weights * failed
        value = float(counts.mean())
        if not value > 0.0:
            return UNKNOWN
        return interval(value, float(counts.std()) / value / math.sqrt(counts.size), confidence)


def importance_sampling(
    margins: Margins,
    searched: Margins,
    quantities: int,
    budget: int,
    seed: int,
    confidence: float,
    chunk: int = 64,
    report: Callable[[float], None] = lambda estimate: None,
) -> FailureProbability:
    """Return the probability of failure by importance sampling around the design point.

    OpenTURNS' FORM with the algorithm of Abdo and Rackwitz finds the design point: the failing
    point nearest to the origin of the standard normal scores. Cases are then drawn around it, each
    weighted by its likelihood ratio. The estimate is unbiased for any point, and accurate if most
    failures are near the point. Failures far from it are drawn so rarely that the interval may not
    cover them.

    Parameters
    ----------
    margins
        Margins of a batch of cases from their standard normal scores; failure at <= 0.
    searched
        The same without case-to-case noise, for the search.
    quantities
        Number of scores of a case.
    budget
        Total number of cases; the search uses some, and the rest is drawn in whole chunks.
    seed
        Seed of the random numbers.
    confidence
        Confidence of the intervals, between 0 and 1.
    chunk
        Number of cases in a chunk; additional chunks continue the same sequence.
    report
        Called with the current estimate.

    Raises
    ------
    FileError
        If OpenTURNS is not installed.

    References
    ----------
    A. M. Hasofer and N. C. Lind, Exact and invariant second-moment code format, J. Eng. Mech. Div.
    100, 1974. T. Abdo and R. Rackwitz, A new beta-point algorithm for large time-invariant and
    time-variant reliability problems, 1990. R. E. Melchers, Importance sampling in structural
    systems, Structural Safety 6, 1989.
    """
    search, drawn, trail = Trail(partial(_with_result, searched)), _Drawn(), Trail(margins)
    state: State = "done"
    why, center, index = "", None, math.nan
    try:
        center = _design_point(search, quantities)
        index = float(np.linalg.norm(center))
        count = (budget - search.runs) // chunk
        if count < 1:
            raise BudgetSpentError
        for first in range(0, count, TOGETHER // chunk):
            numbers = range(first, min(first + TOGETHER // chunk, count))
            scores = np.vstack(
                [
                    center + np.random.default_rng((seed, k)).standard_normal((chunk, quantities))
                    for k in numbers
                ]
            )
            found = trail(scores)
            drawn.margins.append(found)
            # Ratio of the true density to the density around the center.
            drawn.weights.append(np.exp(0.5 * center @ center - scores @ center))
            report(drawn.below(confidence, 0.0).value)
    except _NoDesignPointError as error:
        state, why = "no design point", str(error)
    except BudgetSpentError:
        state = "budget spent"
    except UnfinishedError:
        state = "unfinished"
    below = partial(drawn.below, confidence)
    estimate = below(0.0) if state == "done" else UNKNOWN
    nearest = trail.nearest
    return FailureProbability(
        state,
        estimate,
        below if state == "done" else _unknown,
        (Level(0.0, estimate.value),),
        search.runs + trail.runs,
        drawn.span if state == "done" else None,
        place=nearest[0] + search.runs if nearest else None,
        scores=nearest[1] if nearest else None,
        center=center if index > 0.0 else None,
        first_order=index,
        why=why,
    )


def _with_result(margins: Margins, scores: Array) -> Array:
    """Return margins of a search, which cannot use cases without a result."""
    found = margins(scores)
    if (found <= BEYOND).any():
        raise _NoDesignPointError("a case of the search has no result")
    return found


def _unknown(margin: float) -> Interval:
    return UNKNOWN


def _design_point(search: Trail, quantities: int) -> Array:
    """Return the design point; the origin if the middle of all quantities fails."""
    origin = np.zeros(quantities)
    (middle,) = search(origin[None, :])
    if middle <= 0.0:
        return origin

    def scaled(scores: Array) -> Array:
        return np.asarray(search(scores) / middle)

    ot = library("openturns", *OPENTURNS)
    nearest = ot.AbdoRackwitz()
    nearest.setStartingPoint(origin)
    nearest.setMaximumIterationNumber(_ITERATIONS)
    nearest.setMaximumAbsoluteError(0.01)  # of the point, which is sufficient for the sample
    nearest.setMaximumConstraintError(0.01)
    try:
        with search.within_library(0):
            form = ot.FORM(nearest, failing_event(scaled, quantities, _STEP))
            form.run()
            point = np.array(form.getResult().getStandardSpaceDesignPoint())
    except RuntimeError:  # messages of OpenTURNS for zero derivatives, and for no convergence
        raise _NoDesignPointError("the search did not reach the key figure's limit") from None
    if not np.isfinite(point).all() or abs(float(scaled(point[None, :])[0])) > 0.1:
        raise _NoDesignPointError(f"{_ITERATIONS} steps did not reach the limit")
    return point


# --- Subset simulation: a rare failure as a chain of failures that are not rare

_FEW = 10  # minimum number of failing cases for an estimate
_SEEN = 100  # minimum number of cases of a level for its tail to be shown


@dataclass(frozen=True)
class _Subset:
    """A level: cases whose margin is at most the end of the previous level.

    ``entry``: probability that a case is in the level; ``variation``: its coefficient of variation;
    ``bound``: maximum margin in the level; ``correlation``: gamma of its chains.
    """

    entry: float
    variation: float
    bound: float
    margins: Array
    scores: Array
    correlation: float

    def below(self, margin: float, confidence: float) -> Interval:
        """Return the probability of a margin <= the given margin, within the level."""
        count, size = int((self.margins <= margin).sum()), self.margins.size
        if math.isinf(self.bound):  # independent cases: exact
            return counted(count, size, confidence)
        if not count:  # no such case, so at most the probability with one case
            high = self.below_share(1.0 / size, confidence).high
            return Interval(0.0, math.nan, 0.0, high)
        return self.below_share(count / size, confidence)

    def below_share(self, part: float, confidence: float) -> Interval:
        """Return the probability of a part of the level."""
        return interval(self.entry * part, self.variation + self._step(part), confidence)

    def _step(self, part: float) -> float:
        """Return the coefficient of variation of a part of the level (Au and Beck, eq. 28)."""
        alike = 1.0 + max(self.correlation, 0.0)
        return math.sqrt(alike * (1.0 - part) / (part * self.margins.size))

    def beyond(self, margin: float) -> tuple[float, float]:
        """Return entry and variation of the next level, which begins at a margin."""
        part = float((self.margins <= margin).mean())
        return self.entry * part, self.variation + self._step(part)


def subset_simulation(
    margins: Margins,
    quantities: int,
    level: int,
    seed: int,
    confidence: float,
    negligible: float = NEVER,
    report: Callable[[float], None] = lambda estimate: None,
) -> FailureProbability:
    """Return the probability of failure by subset simulation, with OpenTURNS.

    Each level ends at the margin of its worst tenth. From these cases, Markov chains (modified
    Metropolis) fill the next level, one step of all chains per batch. The coefficients of variation
    of the levels are added, as for fully dependent levels, which is an upper bound. For independent
    levels, their squares would be added; 95 % intervals then contained the probability of a plane
    in only 88 to 92 % of the simulations. OpenTURNS' own estimate also omits the first level.

    Parameters
    ----------
    margins
        Margins of a batch of cases from their standard normal scores; failure at <= 0.
    quantities
        Number of scores of a case.
    level
        Number of cases in each level, a multiple of 10.
    seed
        Seed of the random numbers.
    confidence
        Confidence of the intervals, between 0 and 1.
    negligible
        Probability below which the simulation stops.
    report
        Called with the probability of the current level.

    Raises
    ------
    FileError
        If OpenTURNS is not installed.

    References
    ----------
    S.-K. Au and J. L. Beck, Estimation of small failure probabilities in high dimensions by subset
    simulation, Probabilistic Engineering Mechanics 16, 2001; bounds of the variation, section 5.
    """
    trail = Trail(margins)
    ot = library("openturns", *OPENTURNS)
    state: State = "done"

    def reported(scores: Array) -> Array:
        report(min([1.0, *algorithm.getProbabilityEstimatePerStep()]))
        return trail(scores)

    algorithm = ot.SubsetSampling(failing_event(reported, quantities))
    algorithm.setConditionalProbability(1.0 / STEPS)
    algorithm.setMaximumOuterSampling(STEPS)
    algorithm.setBlockSize(level // STEPS)  # otherwise chains would miss their last step
    algorithm.setKeepSample(True)
    algorithm.setMinimumProbability(negligible)
    try:
        with trail.within_library(seed):
            algorithm.run()
    except BudgetSpentError:
        state = "budget spent"
    except UnfinishedError:
        state = "unfinished"
    except RuntimeError:  # message of OpenTURNS for a result below the minimum
        if not list(algorithm.getProbabilityEstimatePerStep())[-1:] < [negligible]:
            raise
        state = "negligible"
    subsets, ends = _subsets(algorithm)
    if state == "done" and ends[-1] > 0.0:
        # It ends where all cases have the same margin, because a level is too close to failure or
        # values are discrete.
        if (subsets[-1].margins <= 0.0).sum() >= _FEW:
            ends[-1] = 0.0
        else:
            state = "level"
    return _found(trail, state, subsets, ends, confidence)


def _subsets(algorithm: Any) -> tuple[list[_Subset], list[float]]:
    """Return the complete levels, and the margins at which they end."""
    made: list[_Subset] = []
    # The last threshold may be below the minimum probability, but its cases are not available.
    ends = [float(x) for x in algorithm.getThresholdPerStep()][: algorithm.getStepsNumber()]
    entry, variation, bound = 1.0, 0.0, math.inf
    for k, end in enumerate(ends):
        each = _Subset(
            entry,
            variation,
            bound,
            np.asarray(algorithm.getOutputSample(k))[:, 0],
            np.asarray(algorithm.getInputSample(k)),
            float(algorithm.getGammaPerStep()[k]),
        )
        made.append(each)
        (entry, variation), bound = each.beyond(end), end
    return made, ends


def _found(
    trail: Trail, state: State, subsets: list[_Subset], ends: list[float], confidence: float
) -> FailureProbability:
    below = partial(_below, subsets, confidence)
    levels = tuple(Level(end, each.beyond(end)[0]) for each, end in zip(subsets, ends, strict=True))
    estimate = below(0.0)
    if state != "done":  # failure is within the last level, so at most as probable as its end
        high = below(ends[-1]).high if ends else 1.0
        estimate = Interval(math.nan, math.nan, 0.0, high)
        below = partial(_end_of, below, ends[-1] if ends else math.inf, estimate)
    nearest = trail.nearest
    failing = None
    if state == "done":
        failing = subsets[-1].scores[subsets[-1].margins <= 0.0]
    return FailureProbability(
        state,
        estimate,
        below,
        levels,
        trail.runs,
        _span(subsets, ends[-1]) if subsets else None,
        place=nearest[0] if nearest else None,
        scores=nearest[1] if nearest else None,
        center=failing.mean(axis=0) if failing is not None and len(failing) else None,
        failing=failing,
    )


def _below(subsets: list[_Subset], confidence: float, margin: float) -> Interval:
    """Return the probability of a margin <= the given one, from the last level that contains it."""
    for each in reversed(subsets):
        if each.bound >= margin:
            return each.below(margin, confidence)
    return UNKNOWN


def _end_of(below: partial[Interval], end: float, estimate: Interval, margin: float) -> Interval:
    """Return the estimate of a margin if the simulation did not reach failure."""
    return below(margin) if margin >= end else estimate


def _span(subsets: list[_Subset], end: float) -> tuple[float, float] | None:
    """Return margins from the hundredth worst case of the last level to the median of all."""
    last = subsets[-1].margins
    known = last[last > BEYOND]
    if known.size < _SEEN:
        return None
    return min(float(np.sort(known)[_SEEN - 1]), end), float(np.median(subsets[0].margins))
