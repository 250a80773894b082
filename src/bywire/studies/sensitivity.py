"""Sensitivity indices of a key figure: fractions of its variance, and elementary effects."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from bywire.core.typing import Array
from bywire.data.file_format import library
from bywire.studies.designs import LEVELS, SALIB, STEP, SensitivityDesign

_RESAMPLES = 200  # of the groups, for intervals, whose widths then scatter by 5 %
_ROUNDING = 1e-12  # fraction of a figure below which its differences are rounding errors


@dataclass(frozen=True)
class Estimate:
    """An estimate and its interval, in the unit of the estimate.

    Parameters
    ----------
    value, low, high
        Estimate, and ends of the interval.
    reach
        Half width of the interval before truncation to possible values.
    """

    value: float
    low: float
    high: float
    reach: float


@dataclass(frozen=True)
class VarianceShares:
    """Fraction of a quantity in the variance of a figure.

    Parameters
    ----------
    quantity
        Its name.
    first
        First-order index: the fraction of the variance that would vanish if the quantity were
        known.
    total
        Total index: the fraction that would remain if all other quantities were known; it exceeds
        the first-order index by interactions.
    """

    quantity: str
    first: Estimate
    total: Estimate

    @property
    def strength(self) -> Estimate:
        """Value by which quantities are ranked."""
        return self.total


@dataclass(frozen=True)
class ElementaryEffects:
    """Effect of the steps of a quantity on a figure, in the unit of the figure.

    Parameters
    ----------
    quantity
        Its name.
    mu_star
        Mean magnitude of its elementary effects: the change of the figure from end to end,
        extrapolated from a single step; for discrete values, the change from one to another.
    sigma
        Their standard deviation; if it is small, the effect is linear and independent of the other
        quantities.
    """

    quantity: str
    mu_star: Estimate
    sigma: float

    @property
    def strength(self) -> Estimate:
        """Value by which quantities are ranked."""
        return self.mu_star


@dataclass(frozen=True)
class Sensitivity:
    """The indices of a key figure.

    Parameters
    ----------
    drivers
        One for every quantity, the strongest first; empty if they cannot be computed.
    missing
        Reason why there are no indices; empty otherwise.
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
    """Return the drivers of a key figure.

    Estimators and their intervals come from SALib: normal intervals from resampled groups.
    Estimates of small first-order indices may be below zero. A group with an undefined case cannot
    be used, and without this group the sample would not represent the distributions. Therefore,
    there are no indices in this case.

    Parameters
    ----------
    design
        The computed design.
    names
        The quantities, in the order of the design.
    singles
        Those quantities that have discrete values.
    figure
        The key figure of every case in the order of the design, shape (cases,).
    confidence
        Confidence of the intervals, between 0 and 1.

    Raises
    ------
    FileError
        If SALib is not installed.

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
    # The variance that is decomposed is that of the points A and B, the first and last of a group.
    if is_sobol and np.ptp(groups[:, [0, -1]]) <= least:
        return Sensitivity((), "varies in too few cases")
    if is_sobol:
        return _variance_shares(design, names, figure, confidence)
    # A step between discrete values is the whole effect, not part of a longer path.
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
    """Return an estimate with its interval, truncated to possible values.

    If the estimate itself is beyond an end, the interval ends at the estimate.
    """
    low, high = max(value - reach, min(least, value)), min(value + reach, max(most, value))
    return Estimate(float(value), float(low), float(high), float(reach))
