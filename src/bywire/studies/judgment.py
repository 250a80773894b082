"""A requirement judged over the cases of a study."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bywire.bench.requirements import Limit
from bywire.core.typing import Array
from bywire.studies.failure_probability import FailureProbability
from bywire.studies.statistics import Outcome, Share, judged, share


@dataclass(frozen=True)
class Judgment:
    """A requirement over all cases.

    Parameters
    ----------
    demand
        The requirement.
    met
        Whether each case meets it, shape (cases,); a case without a result does not.
    share
        How often, and the interval of the probability, whatever cases that are too close to the
        limit are.
    undecided
        Cases no further from the limit than their figure may be off by the step.
    outcome
        Whether it is met with the probability that is wanted; of one that every case has to meet,
        whether all do.
    worst
        Row of the case that is worst of all, or of the most probable failing one of a rare failure.
        Worse than any other is a case that ran and does not have the figure. None where none ran,
        or all have the same.
    failure
        How probable it is that the requirement is missed, of a study of rare failures: shares of
        its cases are no probabilities.
    """

    demand: Limit
    met: NDArray[np.bool_]
    share: Share
    undecided: int
    outcome: Outcome
    worst: int | None
    failure: FailureProbability | None = None


def judgment_of(
    demand: Limit,
    figure: Array,
    failed: NDArray[np.bool_],
    error: float,
    confidence: float,
) -> Judgment:
    """Return a requirement judged over cases.

    Parameters
    ----------
    demand
        The requirement.
    figure
        Its key figure in every case, shape (cases,); NaN where a case does not have it.
    failed
        Whether a case has no result, shape (cases,).
    error
        What the figure may be off by, in its unit: cases closer to the limit count for neither
        side.
    confidence
        Of the interval, between 0 and 1.
    """
    met, near = demand.is_met(figure), demand.is_near(figure, error)
    count = figure.size
    may, surely = (share(int(each.sum()), count, confidence) for each in (met | near, met & ~near))
    if demand.probability is not None:
        outcome = judged(may, surely, demand.probability)
    elif may.count < count:
        outcome = "missed"
    else:
        outcome = "met" if surely.count == count else "undecided"
    told = replace(share(int(met.sum()), count, confidence), low=surely.low, high=may.high)
    worst = _worst(figure, failed, demand.is_upper)
    return Judgment(demand, met, told, int(near.sum()), outcome, worst)


def _worst(figure: Array, failed: NDArray[np.bool_], is_upper: bool) -> int | None:
    """Return the row of the case that is worst by an upper or a lower limit."""
    known = np.isfinite(figure)
    lacking = np.flatnonzero(~known & ~failed)
    if lacking.size:
        return int(lacking[0])
    if not known.any() or (known.sum() > 1 and np.ptp(figure[known]) == 0.0):
        return None  # whichever were named, it would be no worse than the others
    return int(np.argmin(np.where(known, -figure if is_upper else figure, np.inf)))
