r"""Choice among several models by their prediction of held-out data.

The result also contains information criteria, with the likelihood of correlated residuals
(an autoregressive model of the richest candidate's residuals): :math:`AIC = n \ln s^2 + 2 k`,
:math:`BIC = n \ln s^2 + k \ln n`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.identification.confidence import MisfitWarning, autoregression, misfit
from bywire.identification.estimate import Estimate
from bywire.identification.least_squares import Problem, estimate
from bywire.identification.unknown import Unknown

Predict = Callable[[xr.Dataset, Array], tuple[Array, Array]]

_BLOCKS = 10  # per record
_FOLDS = 5
_RECORDS = 3  # least number of records to hold out whole ones


@dataclass(frozen=True)
class Candidate:
    """A model that may explain a signal.

    Parameters
    ----------
    name
        Name of the model.
    unknowns
        ``unknowns(data) -> (Unknown, ...)``: unknowns of the fit, with starts from the data.
    predict
        ``predict(data, values) -> (prediction, jacobian)``, shapes (n,) and (n, p).
    """

    name: str
    unknowns: Callable[[xr.Dataset], tuple[Unknown, ...]]
    predict: Predict


@dataclass(frozen=True)
class Judged:
    """A candidate with its figures.

    Parameters
    ----------
    candidate, estimate
        The model, fitted to all data.
    training_error, validation_error
        Root mean square of the residual for fitted and for held-out data, in the unit of the
        signal.
    excess, excess_error
        Mean over the folds of its held-out error minus that of the best candidate, and the
        standard error of that mean.
    aic, bic
        Information criteria: smaller is better, and only differences matter.
    """

    candidate: Candidate
    estimate: Estimate
    training_error: float
    validation_error: float
    excess: float
    excess_error: float
    aic: float
    bic: float


@dataclass(frozen=True)
class Choice:
    """Result of the choice.

    Parameters
    ----------
    judged
        Candidates in their order, the simplest first.
    chosen
        The simplest whose held-out error exceeds the lowest by at most one standard error.
    held_out
        Description of the held-out data.
    """

    judged: tuple[Judged, ...]
    chosen: Judged
    held_out: str


def choose(
    candidates: Sequence[Candidate], records: Mapping[str, xr.Dataset], signal: str
) -> Choice:
    """Choose a model by prediction of held-out data.

    With three records or more, each is held out in turn; otherwise blocks of the records, two
    distant ones at a time. Errors are compared in each fold, so that a fold that is hard for all
    candidates does not hide differences.

    Parameters
    ----------
    candidates
        The simplest first.
    records
        By label, each over ``time``; without NaN.
    signal
        Name of the predicted signal.

    Raises
    ------
    ParameterError
        When a candidate cannot be fitted, or there is too little data to hold some out.

    References
    ----------
    Breiman, Friedman, Olshen, Stone (1984), section 3.4.3: the rule of one standard error.
    """
    folds, held_out = _folds(records)
    everything = list(records.values())
    estimates = [_fitted(c, everything, signal) for c in candidates]
    left = [_left(c, e, everything, signal) for c, e in zip(candidates, estimates, strict=True)]
    richest = max(range(len(candidates)), key=lambda k: len(estimates[k].unknowns))
    coefficients = autoregression(left[richest]).coefficients
    errors = np.array([[_held_out(c, fold, signal) for fold in folds] for c in candidates])
    best = int(np.argmin(np.sqrt(np.mean(errors**2, axis=1))))
    judged = []
    for k, (candidate, fit) in enumerate(zip(candidates, estimates, strict=True)):
        more = errors[k] - errors[best]
        scatter = float(more.std(ddof=1)) / math.sqrt(len(folds))
        n, unknowns = left[k].size, len(fit.unknowns) + 1  # the noise's variance is one
        s2 = _innovation_variance(left[k], coefficients)
        judged.append(
            Judged(
                candidate,
                fit,
                float(np.sqrt(np.mean(left[k] ** 2))),
                float(np.sqrt(np.mean(errors[k] ** 2))),
                float(more.mean()),
                scatter,
                n * math.log(s2) + 2 * unknowns,
                n * math.log(s2) + unknowns * math.log(n),
            )
        )
    chosen = next(j for j in judged if j.excess <= j.excess_error)
    if wrong := misfit(chosen.estimate):
        warnings.warn(wrong, MisfitWarning, stacklevel=2)
    return Choice(tuple(judged), chosen, held_out)


@dataclass(frozen=True)
class _Fold:
    training: list[xr.Dataset]
    held: list[xr.Dataset]


def _folds(records: Mapping[str, xr.Dataset]) -> tuple[list[_Fold], str]:
    parts = list(records.values())
    if len(parts) >= _RECORDS:
        folds = [_Fold([r for r in parts if r is not part], [part]) for part in parts]
        return folds, f"each of {len(parts)} records in turn"
    blocks = [
        part.isel(time=rows)
        for part in parts
        for rows in np.array_split(np.arange(part.sizes["time"]), _BLOCKS)
    ]
    if min(b.sizes["time"] for b in blocks) < 2:
        raise ParameterError(
            "there are too few samples to hold some out. Measure longer, or add records",
            name="records",
        )
    folds = []
    for k in range(_FOLDS):
        held = [b for j, b in enumerate(blocks) if j % _FOLDS == k]
        folds.append(_Fold([b for j, b in enumerate(blocks) if j % _FOLDS != k], held))
    return folds, f"blocks of {len(parts)} record{'s' * (len(parts) > 1)}, a fifth at a time"


def _fitted(candidate: Candidate, parts: Sequence[xr.Dataset], signal: str) -> Estimate:
    whole = xr.concat(parts, "time", combine_attrs="override")
    unknowns, y = candidate.unknowns(whole), whole[signal].values
    size = max(float(np.std(y)), 1e-300)

    def evaluate(values: Array) -> tuple[Array, Array]:
        predicted, slopes = candidate.predict(whole, values)
        return (predicted - y) / size, slopes / size

    with warnings.catch_warnings():  # expected, since most candidates are wrong
        warnings.simplefilter("ignore", MisfitWarning)
        return estimate(Problem(unknowns, evaluate))


def _left(candidate: Candidate, fit: Estimate, parts: Sequence[xr.Dataset], signal: str) -> Array:
    values = _values(candidate, fit, xr.concat(parts, "time", combine_attrs="override"))
    return np.concatenate(
        [part[signal].values - candidate.predict(part, values)[0] for part in parts]
    )


def _values(candidate: Candidate, fit: Estimate, whole: xr.Dataset) -> Array:
    """Return all values of a candidate; undetermined ones are at their starts."""
    known = dict(zip(fit.names, fit.values.tolist(), strict=True))
    return np.array([known.get(u.label, u.start) for u in candidate.unknowns(whole)])


def _held_out(candidate: Candidate, fold: _Fold, signal: str) -> float:
    fit = _fitted(candidate, fold.training, signal)
    whole = xr.concat(fold.training, "time", combine_attrs="override")
    values = _values(candidate, fit, whole)
    left = [part[signal].values - candidate.predict(part, values)[0] for part in fold.held]
    return float(np.sqrt(np.mean(np.concatenate(left) ** 2)))


def _innovation_variance(left: Array, coefficients: Array) -> float:
    from scipy import signal

    white = signal.lfilter(coefficients, [1.0], left)[coefficients.size - 1 :]
    return max(float(np.mean(white**2)), 1e-300)
