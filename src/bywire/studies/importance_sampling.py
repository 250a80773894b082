"""Importance sampling around the design point that FORM finds: the most probable failure."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from bywire.core.typing import Array
from bywire.data.file_format import library
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
from bywire.studies.sought_design import LIBRARY, TOGETHER

_STEP = 0.1  # of the differences, in scores: above the noise and the steps of a figure
_ITERATIONS = 30


class _NoDesignPointError(Exception):
    """The search ended without a point where the requirement is just missed."""


@dataclass
class _Drawn:
    """The cases drawn around the center, and how much each counts."""

    margins: list[Array] = field(default_factory=list)
    weights: list[Array] = field(default_factory=list)

    @property
    def span(self) -> tuple[float, float]:
        """Margins around failure, of which weights are alike."""
        low, high = np.quantile(np.concatenate(self.margins), [0.05, 0.6])
        return float(low), max(float(high), 0.0)

    def below(self, confidence: float, margin: float) -> Interval:
        """Return the probability of a margin <= one."""
        if not self.margins:
            return UNKNOWN
        weights, failed = np.concatenate(self.weights), np.concatenate(self.margins) <= margin
        if (weights == 1.0).all():  # drawn as they are in truth: exact
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

    OpenTURNS' FORM with the algorithm of Abdo and Rackwitz finds the design point, the failing
    point nearest to the origin of the standard normal scores. Cases are then drawn around it, each
    weighed by how much more probable it was there than in truth: the estimate is right wherever the
    point is, and close where most failures are near it. Other failures, far from it, are met so
    seldom that the interval may not know of them.

    Parameters
    ----------
    margins
        Margins of a batch of cases by their standard normal scores; failure at <= 0.
    searched
        The same without noise that differs from case to case, for the search.
    quantities
        How many scores a case has.
    budget
        Cases altogether; what the search leaves is drawn, in whole chunks.
    seed
        Of the random numbers.
    confidence
        Of the intervals, between 0 and 1.
    chunk
        Cases of a chunk; more of them go on with the same sequence.
    report
        Called with the estimate so far.

    Raises
    ------
    FileError
        When OpenTURNS is not installed.

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
            # Density in truth over that around the center.
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
    """Return margins of a search, which finds nothing by those of cases without a result."""
    found = margins(scores)
    if (found <= BEYOND).any():
        raise _NoDesignPointError("a case of the search has no result")
    return found


def _unknown(margin: float) -> Interval:
    return UNKNOWN


def _design_point(search: Trail, quantities: int) -> Array:
    """Return the design point; the origin where the middle of all quantities fails itself."""
    origin = np.zeros(quantities)
    (middle,) = search(origin[None, :])
    if middle <= 0.0:
        return origin

    def scaled(scores: Array) -> Array:
        return np.asarray(search(scores) / middle)

    ot = library("openturns", *LIBRARY)
    nearest = ot.AbdoRackwitz()
    nearest.setStartingPoint(origin)
    nearest.setMaximumIterationNumber(_ITERATIONS)
    nearest.setMaximumAbsoluteError(0.01)  # of the point; the draw needs no more
    nearest.setMaximumConstraintError(0.01)
    try:
        with search.within_library(0):
            form = ot.FORM(nearest, failing_event(scaled, quantities, _STEP))
            form.run()
            point = np.array(form.getResult().getStandardSpaceDesignPoint())
    except RuntimeError:  # what OpenTURNS says of derivatives that are zero, and of no end
        raise _NoDesignPointError("the figure does not lead to its limit") from None
    if not np.isfinite(point).all() or abs(float(scaled(point[None, :])[0])) > 0.1:
        raise _NoDesignPointError(f"{_ITERATIONS} steps did not come to the limit")
    return point
