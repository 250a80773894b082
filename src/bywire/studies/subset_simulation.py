"""Subset simulation: a rare failure as a chain of failures that are not rare."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from bywire.core.typing import Array
from bywire.data.file_format import library
from bywire.studies.distribution import NEVER
from bywire.studies.failure_probability import (
    UNKNOWN,
    FailureProbability,
    Interval,
    Level,
    State,
    counted,
    interval,
)
from bywire.studies.limit_state import (
    BEYOND,
    BudgetSpentError,
    Margins,
    Trail,
    UnfinishedError,
    failing_event,
)
from bywire.studies.sought_design import LIBRARY, STEPS

_FEW = 10  # failing cases that make an estimate
_SEEN = 100  # cases of a level below which its tail is not shown


@dataclass(frozen=True)
class _Subset:
    """A level: cases with a margin of no more than where the level before ended.

    ``entry``: probability that a case is one of them; ``variation``: its coefficient of variation;
    ``bound``: largest margin of them; ``correlation``: gamma of their chains.
    """

    entry: float
    variation: float
    bound: float
    margins: Array
    scores: Array
    correlation: float

    def below(self, margin: float, confidence: float) -> Interval:
        """Return the probability of a margin <= one that is within the level."""
        count, size = int((self.margins <= margin).sum()), self.margins.size
        if math.isinf(self.bound):  # independent cases: exact
            return counted(count, size, confidence)
        if not count:  # none of them: no more than what one of them would say
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
        """Return entry and its variation of the next level, which begins at a margin."""
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

    Each level ends where a tenth of its cases is: from these, Markov chains (modified Metropolis)
    fill the next one, a step of all chains at once. Its coefficient of variation is summed over
    the levels, as of levels that depend on each other fully: its upper bound. Were they
    independent, its square would be; intervals of 95 % then held the probability of a plane in 88
    to 92 % of the simulations only. OpenTURNS' own leaves the first level out, too.

    Parameters
    ----------
    margins
        Margins of a batch of cases by their standard normal scores; failure at <= 0.
    quantities
        How many scores a case has.
    level
        Cases of each level, a multiple of 10.
    seed
        Of the random numbers.
    confidence
        Of the intervals, between 0 and 1.
    negligible
        Probability below which it is not followed further.
    report
        Called with the probability of the level that is reached.

    Raises
    ------
    FileError
        When OpenTURNS is not installed.

    References
    ----------
    S.-K. Au and J. L. Beck, Estimation of small failure probabilities in high dimensions by subset
    simulation, Probabilistic Engineering Mechanics 16, 2001; bounds of the variation, section 5.
    """
    trail = Trail(margins)
    ot = library("openturns", *LIBRARY)
    state: State = "done"

    def told(scores: Array) -> Array:
        report(min([1.0, *algorithm.getProbabilityEstimatePerStep()]))
        return trail(scores)

    algorithm = ot.SubsetSampling(failing_event(told, quantities))
    algorithm.setConditionalProbability(1.0 / STEPS)
    algorithm.setMaximumOuterSampling(STEPS)
    algorithm.setBlockSize(level // STEPS)  # one more, and chains would not see their last step
    algorithm.setKeepSample(True)
    algorithm.setMinimumProbability(negligible)
    try:
        with trail.within_library(seed):
            algorithm.run()
    except BudgetSpentError:
        state = "budget spent"
    except UnfinishedError:
        state = "unfinished"
    except RuntimeError:  # what OpenTURNS says of less than the minimum
        if not list(algorithm.getProbabilityEstimatePerStep())[-1:] < [negligible]:
            raise
        state = "negligible"
    subsets, ends = _subsets(algorithm)
    if state == "done" and ends[-1] > 0.0:
        # It ends where all cases are alike: a level too close to failure, or of single values.
        if (subsets[-1].margins <= 0.0).sum() >= _FEW:
            ends[-1] = 0.0
        else:
            state = "level"
    return _found(trail, state, subsets, ends, confidence)


def _subsets(algorithm: Any) -> tuple[list[_Subset], list[float]]:
    """Return the levels that are whole, and the margins at which they end."""
    made: list[_Subset] = []
    # One below the minimum is the last threshold, but its cases are not to be had.
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
    if state != "done":  # failure lies within the last level: no more probable than its end
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
    """Return the probability of a margin <= one, by the last level that reaches up to it."""
    for each in reversed(subsets):
        if each.bound >= margin:
            return each.below(margin, confidence)
    return UNKNOWN


def _end_of(below: partial[Interval], end: float, estimate: Interval, margin: float) -> Interval:
    """Return what is known of a margin where failure was not come to."""
    return below(margin) if margin >= end else estimate


def _span(subsets: list[_Subset], end: float) -> tuple[float, float] | None:
    """Return margins from the hundredth worst case of the last level to the middle of all."""
    last = subsets[-1].margins
    known = last[last > BEYOND]
    if known.size < _SEEN:
        return None
    return min(float(np.sort(known)[_SEEN - 1]), end), float(np.median(subsets[0].margins))
