"""Surrogates: key figures as fitted polynomials of the varied quantities, with their errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bywire.core.errors import ParameterError, counted, not_valid, quoted, unknown_name
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.data.file_format import library
from bywire.studies.designs import SOUGHT
from bywire.studies.findings import Findings
from bywire.studies.plan import StudyPlan, Varied

_SHOWN = 6  # maximum number of discrete values that an error lists
_SAME = 1e-9  # maximum relative difference between two texts of the same value

Polynomial = Callable[[Array], Array]


@dataclass(frozen=True)
class Surrogate:
    """A key figure as a polynomial of the varied quantities.

    Parameters
    ----------
    kpi, unit
        Key figure, and its unit.
    nominal
        Value of each quantity in the bench [SI].
    units
        SI unit of each quantity.
    low, high
        Minimum and maximum of each quantity in the cases [SI].
    singles
        Discrete values of quantities in the cases [SI], in ascending order. The surrogate is not
        valid between them.
    cases
        Number of cases with the figure.
    degree, terms
        Degree of the polynomial, and number of terms.
    rms, largest
        Root mean square and maximum of the errors of cases outside the fit, by fivefold
        cross-validation, in ``unit``. They contain the noise of the cases.
    explained
        Explained fraction of the variance in the cross-validation (Q2).
    """

    kpi: str
    unit: str
    nominal: Mapping[str, float]
    units: Mapping[str, str]
    low: Mapping[str, float]
    high: Mapping[str, float]
    singles: Mapping[str, Sequence[float]]
    cases: int
    degree: int
    terms: int
    rms: float
    largest: float
    explained: float
    polynomial: Polynomial = field(repr=False)

    def __call__(self, values: Mapping[str, ArrayLike]) -> Array:
        """Return the figure at values of the varied quantities, in `unit`.

        Parameters
        ----------
        values
            Quantities by name [SI], numbers or arrays of the same shape; others have the bench's
            value.

        Raises
        ------
        UnknownNameError
            For a quantity that did not vary.
        ParameterError
            For values outside the range of the cases, and for values between discrete values.
        """
        if not isinstance(values, Mapping):
            raise ParameterError(
                f"{quoted(values)} must map names of quantities to numbers in SI units, such as "
                f"{{{next(iter(self.nominal))!r}: {next(iter(self.nominal.values())):g}}}"
            )
        for name in values:
            if name not in self.nominal:
                raise unknown_name("quantity of the surrogate", name, self.nominal)
        columns: list[Array] = []
        for name, nominal in self.nominal.items():
            try:
                column = np.asarray(values.get(name, nominal), dtype=float)
            except (TypeError, ValueError):
                raise not_valid(name, quoted(values[name]), "SI numbers") from None
            self._require_seen(name, column)
            columns.append(column)
        try:
            wide = np.broadcast_arrays(*columns)
        except ValueError:
            raise ParameterError(
                "values must be arrays of the same shape", name="values", valid="the same shape"
            ) from None
        points = np.column_stack([column.ravel() for column in wide])
        if not points.size:  # OpenTURNS rejects an empty sample
            return np.zeros(wide[0].shape)
        return np.asarray(self.polynomial(points).reshape(wide[0].shape))

    def _require_seen(self, name: str, values: Array) -> None:
        low, high = self.low[name], self.high[name]
        at_end = np.isclose(values, low, _SAME, 0.0) | np.isclose(values, high, _SAME, 0.0)
        beyond = values[~((low <= values) & (values <= high) | at_end)]
        if beyond.size:
            unit = self.units[name]
            raise not_valid(
                name,
                shown(float(beyond[0]), unit),
                f"{shown(low, unit)} to {shown(high, unit)}",
                f"the range of the surrogate of {self.kpi}",
            )
        singles = np.asarray(self.singles.get(name, ()))
        if not singles.size or not values.size:
            return
        flat = values.ravel()
        nearest = singles[np.abs(flat[:, None] - singles).argmin(axis=1)]
        between = ~np.isclose(flat, nearest, rtol=_SAME, atol=0.0)
        if between.any():
            unit, k = self.units[name], int(between.argmax())
            raise not_valid(
                name,
                shown(float(flat[k]), unit),
                f"one of the values of the cases, {_listed(singles, unit)}",
                f"the nearest is {shown(float(nearest[k]), unit)}",
            )


def _listed(values: Array, unit: str) -> str:
    """Return discrete values as text for an error, abbreviated if there are many."""
    texts = [shown(float(value), unit) for value in values]
    if len(texts) > _SHOWN:
        texts = [*texts[: _SHOWN - 1], "...", texts[-1]]
    return ", ".join(texts)


# --- Polynomial chaos through the cases of a study
# R. G. Ghanem and P. D. Spanos, Stochastic Finite Elements, 1991. OpenTURNS fits the polynomial.
# Least angle regression selects its terms (G. Blatman and B. Sudret, Journal of Computational
# Physics 230, 2011).

LIBRARY = ("surrogates of studies", "studies")
_FEWEST = 30  # minimum number of cases for a surrogate
_LARGEST = 4  # degree: for five quantities, a fifth improves little and takes ten times longer
_FOLDS = 5  # cross-validation: each fifth of the cases is predicted from the others
_LACKING = ("one-at-a-time", "corners", "morris", *SOUGHT)  # designs that visit only a few points


def surrogate_of(findings: Findings, kpi: str) -> Surrogate:
    """Return the surrogate of a key figure from the cases of a study.

    Fivefold cross-validation determines the degree.

    Raises
    ------
    UnknownNameError
        For a figure that the study does not have.
    ParameterError
        For designs without points between their levels, structural choices among the varied
        quantities, too few cases, and a figure that does not vary.
    FileError
        If OpenTURNS is not installed.
    """
    plan = findings.plan
    require_fittable(plan)
    if kpi not in findings.units:
        raise unknown_name("key figure", kpi, findings.units)
    cases = findings.first
    y = np.asarray(cases[kpi], dtype=float) if len(cases) else np.empty(0)
    known = np.isfinite(y)
    columns = {
        v.name: np.asarray(cases[v.name] if len(cases) else (), dtype=float) for v in plan.varied
    }
    x, y = np.column_stack(list(columns.values()))[known], y[known]
    if y.size < _FEWEST:
        raise ParameterError(
            f"{kpi} is defined in only {counted(y.size, 'case')}, but a surrogate needs at least "
            f"{_FEWEST}. Extend the study",
            name=kpi,
            value=str(y.size),
            valid=f"at least {_FEWEST}",
        )
    if np.ptp(y) == 0.0:
        raise ParameterError(
            f"{kpi} is the same in all cases, so a surrogate would be a constant", name=kpi
        )
    errors, best = min(
        (_of_unseen(plan.varied, x, y, degree, 0) for degree in _degrees(x.shape)),
        key=lambda told: float(np.mean(told[0] ** 2)),
    )
    others = [_of_unseen(plan.varied, x, y, best.degree, k)[0] for k in range(1, _FOLDS)]
    errors = np.concatenate([errors, *others])
    best = _fitted(plan.varied, x, y, best.degree)
    nominal = _within(plan.varied, x)
    return Surrogate(
        kpi,
        findings.units[kpi],
        nominal,
        {v.name: v.unit for v in plan.varied},
        dict(zip(nominal, x.min(axis=0).tolist(), strict=True)),
        dict(zip(nominal, x.max(axis=0).tolist(), strict=True)),
        _singles(plan.varied, x),
        y.size,
        best.degree,
        best.terms,
        float(np.sqrt(np.mean(errors**2))),
        float(np.abs(errors).max()),
        1.0 - float(np.mean(errors**2) / np.var(y)),
        best.polynomial,
    )


def require_fittable(plan: StudyPlan) -> None:
    """Reject studies whose cases a polynomial cannot fit; see `surrogate_of`.

    Raises
    ------
    ParameterError
        For designs that visit only a few points, and choices among the varied quantities.
    """
    if plan.design in _LACKING:
        raise ParameterError(
            f"the cases of {plan.design!r} do not determine values between them. For a surrogate, "
            "use 'monte-carlo', 'latin-hypercube', 'sobol', 'sobol-indices' or 'grid'",
            name="[design] kind",
            value=plan.design,
            valid="'monte-carlo', 'latin-hypercube', 'sobol', 'sobol-indices' or 'grid'",
        )
    choices = [v.name for v in plan.varied if not v.unit]
    if choices:
        raise ParameterError(
            f"{', '.join(choices)}: a surrogate cannot depend on a choice. Run a study for each of "
            "its values",
            name=", ".join(choices),
        )


def _within(varied: Sequence[Varied], x: Array) -> dict[str, float]:
    """Return the bench's value of each quantity, or the nearest one in the cases."""
    singles = _singles(varied, x)
    return {
        v.name: min(singles[v.name], key=lambda single: abs(single - v.nominal))
        if v.name in singles
        else float(np.clip(v.nominal, x[:, k].min(), x[:, k].max()))
        for k, v in enumerate(varied)
    }


def _singles(varied: Sequence[Varied], x: Array) -> dict[str, tuple[float, ...]]:
    """Return the values in the cases of each discrete quantity."""
    return {
        v.name: tuple(np.unique(x[:, k]).tolist())
        for k, v in enumerate(varied)
        if v.distribution.is_discrete
    }


def _degrees(shape: tuple[int, ...]) -> list[int]:
    """Return degrees whose polynomial has fewer terms than half of the fitted cases."""
    cases, quantities = shape
    fit = [
        degree
        for degree in range(1, _LARGEST + 1)
        if math.comb(quantities + degree, degree) <= 0.5 * cases * (1.0 - 1.0 / _FOLDS)
    ]
    return fit or [1]


@dataclass(frozen=True)
class _Fit:
    """A polynomial that is fitted to cases, its degree, and its number of terms."""

    degree: int
    terms: int
    polynomial: Polynomial


def _of_unseen(
    varied: Sequence[Varied], x: Array, y: Array, degree: int, fifth: int
) -> tuple[Array, _Fit]:
    """Return the errors of a fifth of the cases, predicted from the others, and their fit."""
    apart = np.arange(y.size) % _FOLDS == fifth
    fit = _fitted(varied, x[~apart], y[~apart], degree)
    return fit.polynomial(x[apart]) - y[apart], fit


def _fitted(varied: Sequence[Varied], x: Array, y: Array, degree: int) -> _Fit:
    ot: Any = library("openturns", *LIBRARY)
    law = ot.JointDistribution([_marginal(ot, v, x[:, k]) for k, v in enumerate(varied)])
    basis = ot.OrthogonalProductPolynomialFactory([law.getMarginal(k) for k in range(len(varied))])
    count = basis.getEnumerateFunction().getStrataCumulatedCardinal(degree)
    chosen = ot.LeastSquaresMetaModelSelectionFactory(ot.LARS(), ot.CorrectedLeaveOneOut())
    algorithm = ot.FunctionalChaosAlgorithm(
        ot.Sample(x),
        ot.Sample(y[:, None]),
        law,
        ot.FixedStrategy(basis, count),
        ot.LeastSquaresStrategy(chosen),
    )
    algorithm.run()
    result = algorithm.getResult()
    model = result.getMetaModel()

    def polynomial(points: Array) -> Array:
        return np.asarray(model(ot.Sample(points)), dtype=float)[:, 0]

    return _Fit(degree, result.getCoefficients().getSize(), polynomial)


def _marginal(ot: Any, varied: Varied, values: NDArray[np.float64]) -> Any:
    """Return any distribution as wide as a quantity, for its polynomials."""
    low, high = float(values.min()), float(values.max())
    if low == high:
        return ot.Uniform(low - 1.0, high + 1.0)
    law = varied.distribution
    if math.isfinite(law.low) and math.isfinite(law.high):
        return ot.Uniform(min(low, law.low), max(high, law.high))
    return ot.Normal(float(values.mean()), float(values.std()))
