"""How a key figure is spread over the cases of a study."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bywire.core.typing import Array
from bywire.studies.statistics import Quantile, quantile

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
