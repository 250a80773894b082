"""What drives a key figure, by indices: shares of its variance, and elementary effects."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from bywire.core.typing import Array
from bywire.data.file_format import library
from bywire.studies.designs import LEVELS, SALIB, STEP, SensitivityDesign

_RESAMPLES = 200  # of the groups, for intervals: their widths scatter by 5 %
_ROUNDING = 1e-12  # share of a figure below which its differences are those of rounding


@dataclass(frozen=True)
class Estimate:
    """An estimate and its interval, in the unit of what it is of.

    Parameters
    ----------
    value, low, high
        Estimate, and ends of the interval.
    reach
        How far the interval would reach to either side, did values not end anywhere.
    """

    value: float
    low: float
    high: float
    reach: float


@dataclass(frozen=True)
class VarianceShares:
    """How much of a figure's variance a quantity makes.

    Parameters
    ----------
    quantity
        Its name.
    first
        Index of first order: the share of the variance that would go, were the quantity known.
    total
        Total index: the share that would stay, were all others known; above the first by what it
        does together with others.
    """

    quantity: str
    first: Estimate
    total: Estimate

    @property
    def strength(self) -> Estimate:
        """What quantities are ranked by."""
        return self.total


@dataclass(frozen=True)
class ElementaryEffects:
    """What a figure does as a quantity steps; in the unit of the figure.

    Parameters
    ----------
    quantity
        Its name.
    mu_star
        Mean size of its elementary effects: what the figure changes by as the quantity goes from
        end to end, at the rate of a single step; of single values, as it goes from one to another.
    sigma
        Their standard deviation: where it is small the quantity acts linearly, whatever the others.
    """

    quantity: str
    mu_star: Estimate
    sigma: float

    @property
    def strength(self) -> Estimate:
        """What quantities are ranked by."""
        return self.mu_star


@dataclass(frozen=True)
class Sensitivity:
    """The indices of a key figure.

    Parameters
    ----------
    drivers
        Of every quantity, the strongest first; none where they cannot be had.
    missing
        Why there are none; empty where there are.
    """

    drivers: Sequence[VarianceShares] | Sequence[ElementaryEffects]
    missing: str = ""


def sensitivity(
    design: SensitivityDesign,
    names: Sequence[str],
    singles: Collection[str],
    figure: Array,
    confidence: float,
) -> Sensitivity:
    """Return what drives a key figure.

    Estimators and their intervals are SALib's: resampled groups, as normal ones. Indices of first
    order may come out below zero where they are none. A group with a case that has no figure is of
    no use, and to leave it out would answer for other quantities than those that vary: there are no
    indices then.

    Parameters
    ----------
    design
        What was computed.
    names
        The quantities, in the order of the design.
    singles
        Those of them that have single values.
    figure
        The key figure of every case in the order of the design, shape (cases,).
    confidence
        Of the intervals, between 0 and 1.

    Raises
    ------
    FileError
        When SALib is not installed.

    References
    ----------
    First order and total: A. Saltelli et al., Comput. Phys. Commun. 181, 2010, Table 2 (b) and (f).
    Mean size of effects: F. Campolongo, J. Cariboni and A. Saltelli, An effective screening design
    for sensitivity analysis of large models, Environ. Model. Softw. 22, 2007, section 2.
    """
    if figure.size != design.cases:
        return Sensitivity((), "not all cases are computed")
    if unknown := int(np.count_nonzero(~np.isfinite(figure))):
        return Sensitivity((), f"not defined in {unknown} of {figure.size} cases")
    least = _ROUNDING * np.max(np.abs(figure))
    if np.ptp(figure) <= least:
        return Sensitivity((), "does not vary")
    groups = figure.reshape(design.base, design.group)
    is_sobol = design.kind == "sobol-indices"
    # The variance that is shared out is that of the points A and B, first and last of a group.
    if is_sobol and np.ptp(groups[:, [0, -1]]) <= least:
        return Sensitivity((), "varies in too few cases")
    if is_sobol:
        return _variance_shares(design, names, figure, confidence)
    # A step between single values is all that they can do: it is no part of a longer way.
    ways = [STEP if name in singles else 1.0 for name in names]
    return _elementary_effects(design, names, ways, figure, confidence)


def _variance_shares(
    design: SensitivityDesign, names: Sequence[str], figure: Array, confidence: float
) -> Sensitivity:
    indices = library("SALib.analyze.sobol", *SALIB).analyze(
        design.problem,
        figure,
        calc_second_order=False,
        num_resamples=_RESAMPLES,
        conf_level=confidence,
        seed=np.random.default_rng(design.seed),
    )
    drivers = [
        VarianceShares(
            name,
            _estimate(indices["S1"][k], indices["S1_conf"][k], most=1.0),
            _estimate(indices["ST"][k], indices["ST_conf"][k], least=0.0, most=1.0),
        )
        for k, name in enumerate(names)
    ]
    return Sensitivity(sorted(drivers, key=lambda each: -each.total.value))


def _elementary_effects(
    design: SensitivityDesign,
    names: Sequence[str],
    ways: Sequence[float],
    figure: Array,
    confidence: float,
) -> Sensitivity:
    indices = library("SALib.analyze.morris", *SALIB).analyze(
        design.problem,
        design.probabilities,
        figure,
        num_resamples=_RESAMPLES,
        conf_level=confidence,
        num_levels=LEVELS,
        seed=np.random.default_rng(design.seed),
    )
    drivers = [
        ElementaryEffects(
            name,
            _estimate(way * indices["mu_star"][k], way * indices["mu_star_conf"][k], least=0.0),
            way * float(indices["sigma"][k]),
        )
        for k, (name, way) in enumerate(zip(names, ways, strict=True))
    ]
    return Sensitivity(sorted(drivers, key=lambda each: -each.mu_star.value))


def _estimate(value: float, reach: float, least: float = -np.inf, most: float = np.inf) -> Estimate:
    """Return an estimate with its interval, which ends where values end that can be.

    An estimate may scatter beyond such an end: then the interval ends at the estimate.
    """
    low, high = max(value - reach, min(least, value)), min(value + reach, max(most, value))
    return Estimate(float(value), float(low), float(high), float(reach))
