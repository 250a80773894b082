"""Uncertainty of least-squares estimates, undetermined unknowns, and agreement of records."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.core.units import difference_unit, shown
from bywire.data.recursive_filter import filtered
from bywire.identification.estimate import Estimate
from bywire.identification.measured import robust_scale

_TOGETHER = (1, 8, 64)  # neighbors in a sum
_BLOCKS = 10  # minimum number per unknown
_KEPT = 0.9  # minimum fraction of the squared Jacobian
_LEVEL = 0.01  # significance level of the whiteness test
_NEAREST = 3  # lags
_GROUPS = (8, 16, 64)  # blocks of the record, in addition to single samples
_FEWEST_GROUPS = 6.0  # minimum number that determines a variance


@dataclass(frozen=True)
class Uncertainty:
    """Uncertainty of a least-squares estimate.

    Parameters
    ----------
    covariance
        Shape (p, p).
    freedom
        Independent residuals minus unknowns.
    colored
        Whether neighboring residuals are correlated.
    """

    covariance: Array
    freedom: float
    colored: bool


def uncertainty(
    jacobian: Array,
    residuals: Array,
    instruments: Array | None = None,
    prior_rows: int = 0,
    *,
    ordered: bool = True,
) -> Uncertainty:
    r"""Return the covariance of a least-squares estimate.

    For white residuals, it is :math:`s^2 (J^T J)^{-1}`. For correlated neighbors, it is the
    sandwich :math:`(J^T J)^{-1} J^T \Gamma J (J^T J)^{-1}` with the autocovariance :math:`\Gamma`
    of an autoregressive model of the residuals; fewer residuals are then treated as independent.
    White noise may hide slow errors, so bywire repeats the computation for sums of neighbors and
    uses the largest result.

    Both formulas assume noise that is independent of the Jacobian. If the residuals are larger
    where the Jacobian is larger (noise that grows with the signal, or a model that is wrong in
    part of the range), the scores show it, by sample (White 1980) or summed over blocks of the
    record (Bester, Conley and Hansen 2011). If the scores reject a standard deviation at the 1 %
    level, the scores' standard deviation replaces it. For correlated neighbors, the scores use
    residuals that the autoregressive model has whitened.

    Parameters
    ----------
    jacobian
        d(residual)/d(unknown), shape (n, p).
    residuals
        Shape (n,), in the order in which they were measured.
    instruments
        Instruments of an instrumental-variable estimate, shape (n, p); the Jacobian by default.
    prior_rows
        Number of last rows that contain prior knowledge: independent, standard deviation of one.
    ordered
        False if the order has no meaning; all residuals are then treated as independent.

    References
    ----------
    H. White, A heteroskedasticity-consistent covariance matrix estimator, Econometrica 48, 1980;
    C. A. Bester, T. G. Conley, C. B. Hansen, Inference with dependent data using cluster
    covariance estimators, Journal of Econometrics 165, 2011.
    """
    n, p = jacobian.shape
    Z = jacobian if instruments is None else instruments
    data = slice(0, n - prior_rows)
    size = np.sqrt(np.sum(jacobian**2, axis=0))
    scale = np.where(size > 0.0, size, 1.0)
    bread = np.linalg.pinv((Z.T @ jacobian) / np.outer(scale, scale))
    known = (Z[n - prior_rows :].T @ Z[n - prior_rows :]) / np.outer(scale, scale)
    candidates: list[Uncertainty] = []
    for together in _TOGETHER if ordered else (1,):
        r, rows = _blocks(residuals[data], together), _blocks(Z[data] / scale, together)
        if together > 1 and not _still_told(r, rows, Z[data] / scale):
            break
        middle, freedom, colored = _spread(r, rows, p, ordered)
        if not candidates or colored:
            candidates.append(Uncertainty(bread @ middle @ bread.T, freedom, colored))

    def volume(candidate: Uncertainty) -> float:
        return float(np.sum(np.log(np.maximum(np.diag(candidate.covariance), 1e-300))))

    likely = max(candidates, key=volume)
    worst = _as_scattered(likely, (Z[data] / scale) @ bread.T, residuals[data], ordered)
    covariance = worst.covariance + bread @ known @ bread.T
    return Uncertainty(covariance / np.outer(scale, scale), worst.freedom, worst.colored)


def _as_scattered(sure: Uncertainty, influence: Array, r: Array, ordered: bool) -> Uncertainty:
    """Return an uncertainty, with the scores' deviations where the scores reject its own.

    Parameters
    ----------
    sure
        Uncertainty for noise that is independent of the Jacobian.
    influence
        Effect of each residual on each unknown, shape (n, p).
    r
        Residuals, shape (n,).
    ordered
        Whether the order has meaning, so that blocks of neighbors count too.
    """
    from scipy import special  # loads much faster than scipy.stats

    if sure.colored:  # neighbors that cancel have less scatter than the sum of their squares
        model = autoregression(r)
        later = _filtered(influence[::-1], model.coefficients)[: r.size]
        influence, r = later[::-1], filtered(model.coefficients, [1.0], r)
    n, p = influence.shape
    largest, freedom = np.ones(p), sure.freedom
    sizes = (n, *(count for count in _GROUPS if ordered and n >= 10 * count))
    for groups in sizes:
        begins = np.linspace(0, n, groups, endpoint=False).astype(int)
        scores = np.add.reduceat(influence * r[:, None], begins, axis=0)
        shares = np.add.reduceat(influence**2, begins, axis=0)
        total = shares.sum(axis=0)
        known = total > 0.0
        independent = np.zeros(p)  # effective number of groups (Satterthwaite 1946)
        independent[known] = total[known] ** 2 / (shares[:, known] ** 2).sum(axis=0) - 1.0
        variance = (scores**2).sum(axis=0) * groups / max(groups - 1.0, 1.0)
        ratio = variance / np.maximum(np.diag(sure.covariance), 1e-300)
        for k in np.flatnonzero(known & (independent >= _FEWEST_GROUPS)):
            level = _LEVEL / (p * (1 + len(_GROUPS)))
            limit = float(special.fdtri(independent[k], sure.freedom, 1.0 - level))
            if ratio[k] > max(limit, largest[k]):
                largest[k], freedom = ratio[k], min(freedom, float(independent[k]))
    wider = np.sqrt(largest)
    return Uncertainty(sure.covariance * np.outer(wider, wider), freedom, sure.colored)


def _blocks(values: Array, together: int) -> Array:
    """Return sums of neighbors, scaled so that white noise keeps its variance."""
    count = len(values) // together
    parts = values[: count * together].reshape(count, together, *values.shape[1:])
    return np.asarray(parts.sum(axis=1) / np.sqrt(together))


def _still_told(r: Array, rows: Array, whole: Array) -> bool:
    """Return whether there are enough blocks, each short relative to changes of the Jacobian."""
    kept = np.sum(rows**2, axis=0) >= _KEPT * np.sum(whole**2, axis=0)
    return bool(r.size >= _BLOCKS * rows.shape[1] and kept.all())


def _spread(r: Array, rows: Array, unknowns: int, ordered: bool) -> tuple[Array, float, bool]:
    """Return the scores' covariance, degrees of freedom, and whether neighbors are correlated."""
    n = r.size
    if not ordered or is_white(r):
        freedom = max(n - unknowns, 1)
        return float(r @ r) / freedom * (rows.T @ rows), float(freedom), False
    model = autoregression(r)
    spread = _filtered(rows[::-1], model.coefficients)
    independent = min(n * float(np.mean(r**2)) / model.at_zero_frequency, float(n))
    left = max(independent - unknowns, 1.0)
    middle = model.variance * (spread.T @ spread) * (independent / left)
    return middle, left, True


@dataclass(frozen=True)
class Autoregression:
    """Residuals as white noise filtered by :math:`1 / (1 + a_1 z^{-1} + ...)`.

    Parameters
    ----------
    coefficients
        1, a_1, ..., shape (order + 1,).
    variance
        Variance of the white noise.
    """

    coefficients: Array
    variance: float

    @property
    def at_zero_frequency(self) -> float:
        """Sum of the autocovariance over all lags."""
        return float(self.variance / np.sum(self.coefficients) ** 2)


def autoregression(residuals: Array) -> Autoregression:
    """Return the autoregressive model of a signal, with its order by Schwarz's criterion."""
    from scipy import linalg

    n = residuals.size
    most = max(min(int(10.0 * np.log10(n)), n // 10), 1)
    rho = autocorrelation(residuals, most)
    power = float(np.mean(residuals**2))
    best, lowest = Autoregression(np.ones(1), power), np.inf
    for order in range(1, most + 1):
        a = -linalg.solve_toeplitz(rho[:order], rho[1 : order + 1])
        variance = power * max(float(1.0 + a @ rho[1 : order + 1]), 1e-12)
        criterion = n * np.log(variance) + order * np.log(n)
        if criterion < lowest:
            best, lowest = Autoregression(np.concatenate(([1.0], a)), variance), criterion
    return best


def _filtered(columns: Array, coefficients: Array) -> Array:
    """Return columns filtered by the noise model, including its decay."""
    tail = np.zeros((min(len(columns), 50 * len(coefficients)), columns.shape[1]))
    return filtered([1.0], coefficients, np.vstack((columns, tail)))


def autocorrelation(residuals: Array, lags: int) -> Array:
    """Return the autocorrelation at the lags 0 .. lags, shape (lags + 1,)."""
    r = residuals - residuals.mean()
    size = 1 << (2 * r.size - 1).bit_length()
    spectrum = np.fft.rfft(r, size)
    covariances = np.fft.irfft(spectrum * spectrum.conj(), size)[: lags + 1]
    alone: Array = np.eye(1, lags + 1)[0]
    return np.asarray(covariances / covariances[0]) if covariances[0] > 0 else alone


def is_white(residuals: Array, lags: int = 20) -> bool:
    """Return whether neighbors are uncorrelated (Ljung and Box 1978, level 1 %).

    The test runs twice, for the nearest neighbors and for all lags, since a test over 20 lags
    easily misses a correlation of the nearest neighbors.
    """
    from scipy import special  # loads much faster than scipy.stats

    n = residuals.size
    lags = min(lags, n // 4)
    if lags < 1:
        return True
    rho = autocorrelation(residuals, lags)[1:]
    terms = n * (n + 2) * rho**2 / (n - np.arange(1, lags + 1))
    asked = {min(_NEAREST, lags), lags}
    level = _LEVEL / len(asked)
    return all(special.chdtrc(most, float(terms[:most].sum())) > level for most in asked)


# --- Which unknowns the data determine: singular values, correlations

_DETERMINED = 1.0  # maximum standard deviation of a determined unknown, relative to its scale
_FLAT = 1e-7  # singular value relative to the largest one, below which only rounding is left
_FAR = 10.0  # times the noise: residuals that noise cannot explain
_MISFIT = 4.0  # times the noise: filtered sensor noise reaches 3
_AS_ASSUMED = (0.5, 1.5)  # times the assumed noise: range in which it explains the residual
_EXACT = (
    "the residual is only rounding error, because the record agrees with the model to the last "
    "digits. The intervals do not apply to a measured record, which contains noise"
)
_CONTRADICTED = 3.0  # standard deviations of a prior


class MisfitWarning(UserWarning):
    """The residual exceeds the noise, or the step is too coarse: intervals are not valid."""


def misfit(estimate: Estimate) -> str:
    """Describe in a sentence a residual that exceeds the noise; empty if it is only noise.

    Differences of neighboring residuals are noise; the slow part of the residuals comes from the
    model. An assumed noise that explains the residual is accepted. Residuals from rounding or from
    the simulation step do not count against the model.
    """
    worst = max(
        (
            left
            for left in estimate.leftovers()
            if left.over_noise > _MISFIT and not left.is_numerical
        ),
        key=lambda left: left.over_noise,
        default=None,
    )
    if worst is None:
        return ""
    low, high = _AS_ASSUMED
    if worst.noise is not None and low <= worst.rms / worst.noise <= high:
        return ""
    size = shown(float(f"{worst.rms:.3g}"), difference_unit(worst.unit))
    return (
        f"{worst.label}: the residual is {size}, {worst.over_noise:.2g} times the noise between "
        "neighboring samples. The model is incomplete or wrong, and the intervals are invalid "
        "because they assume a random residual"
    )


def least_determined(estimate: Estimate, J: Array) -> tuple[int, str] | None:
    """Return the unknown that the data determine least, with the reason; None if they suffice."""
    share = estimate.singular_values[-1] / max(estimate.singular_values[0], 1e-300)
    reason = f"the smallest singular value is {share:.1e} times the largest"
    silent = np.flatnonzero(~J.any(axis=0))
    if silent.size:
        return int(silent[0]), "no measured signal depends on it"
    if share < _FLAT:
        direction = np.linalg.svd(J, full_matrices=False)[2][-1]
        return int(np.argmax(np.abs(direction))), (
            f"the data determine only its combination with others ({reason})"
        )
    relative = estimate.deviations / np.array([u.scale for u in estimate.unknowns])
    index = int(np.argmax(relative))
    if relative[index] <= _DETERMINED:
        return None
    unknown = estimate.unknowns[index]
    return index, (
        f"its standard deviation would be {relative[index]:.2g} times its usual magnitude of "
        f"{shown(float(f'{unknown.scale:.3g}'), difference_unit(unknown.unit))} ({reason})"
    )


def advice(estimate: Estimate, silent: bool) -> str:
    """Return advice for unknowns that the data do not determine.

    Parameters
    ----------
    estimate
        End of the search, with its residuals.
    silent
        Whether the model explains why no output depends on the unknown.
    """
    left = robust_scale(estimate.residuals)
    if left > _FAR:
        return (
            f"The model does not fit: its lowest residual is {left:.2g} times the noise. Check the "
            f"signs and units of the measured signals ({option('mapping')}), then the known "
            "parameters"
        )
    return "Switch it on, or choose another unknown" if silent else "Excite the system more"


def notes_of(estimate: Estimate) -> tuple[str, ...]:
    """Return notes about correlated unknowns, bounds, contradicted priors, and misfit."""
    notes = [
        f"{a} and {b} are correlated ({c:.3f}). The data determine their combination better "
        "than either one alone"
        for a, b, c in estimate.correlated()
    ]
    bounds = estimate.at_bounds()
    for u, value in zip(estimate.unknowns, estimate.values, strict=True):
        if u.label in bounds:
            notes.append(f"{u.label} is at its bound, {shown(bounds[u.label], u.unit)}")
        if u.prior is None:
            continue
        mean, deviation = u.prior
        away = abs(float(value) - mean) / deviation
        if away > _CONTRADICTED:
            notes.append(
                f"{u.label} = {shown(float(f'{value:.4g}'), u.unit)} is {away:.2g} standard "
                f"deviations from its prior ({shown(mean, u.unit)} ± "
                f"{shown(deviation, difference_unit(u.unit))}), so the prior or the model is "
                "wrong"
            )
    if estimate.is_exact:
        notes.append(_EXACT)
    wrong = misfit(estimate)
    return (*notes, wrong) if wrong else tuple(notes)


# --- Whether records agree

_FALSE_ALARM = 1e-3  # probability of a false alarm, over all records and parameters
_SMALL = 1e-3  # of the value: smaller differences are negligible
_UNDETERMINED = 1e-6  # singular value relative to the largest: the record lacks an unknown


@dataclass(frozen=True)
class Disagreement:
    """A parameter whose estimate from one record contradicts that from the other records.

    Parameters
    ----------
    record, name, unit
        The record, and the parameter with its unit.
    value, deviation
        Estimate from the record alone, and its standard deviation [unit].
    others, others_deviation
        Estimate from the other records together, and its standard deviation [unit].
    """

    record: str
    name: str
    unit: str
    value: float
    deviation: float
    others: float
    others_deviation: float

    @property
    def apart(self) -> float:
        """Difference divided by its standard deviation."""
        return abs(self.value - self.others) / math.hypot(self.deviation, self.others_deviation)

    def __str__(self) -> str:
        """Return it as a sentence."""
        there, rest = (
            f"{shown(float(f'{value:.5g}'), self.unit)} +- "
            f"{shown(float(f'{deviation:.2g}'), difference_unit(self.unit))}"
            for value, deviation in (
                (self.value, self.deviation),
                (self.others, self.others_deviation),
            )
        )
        return (
            f"records disagree: {self.name} is {there} in {self.record} and {rest} in the others. "
            f"The difference is {self.apart:.2g} times its standard deviation, so no joint "
            "interval is valid. Check that record, and the differences between the records"
        )


@dataclass(frozen=True)
class _Told:
    """Estimate of a parameter from a single record."""

    value: float
    deviation: float
    freedom: float
    unit: str


def disagreements(estimates: Mapping[str, Estimate]) -> tuple[Disagreement, ...]:
    """Return the parameters on which separate estimates from several records disagree.

    Parameters
    ----------
    estimates
        By record label, at least two; parameters are matched by name.

    Returns
    -------
    tuple of Disagreement
        The largest first. Empty if chance explains all differences; false alarms occur once in a
        thousand times. The estimate of each record is compared with the mean of all others,
        weighted by their variances.

    Raises
    ------
    ParameterError
        When there are fewer than two estimates.

    References
    ----------
    W. G. Cochran, The combination of estimates from different experiments, Biometrics 10, 1954.
    """
    if len(estimates) < 2:
        raise ParameterError(
            "a single estimate cannot be compared. Pass one estimate for each record",
            name="estimates",
        )
    tables = {
        label: {
            u.name: _Told(float(v), float(d), estimate.freedom, u.unit)
            for u, v, d in zip(estimate.unknowns, estimate.values, estimate.deviations, strict=True)
        }
        for label, estimate in estimates.items()
    }
    return _apart(tables)


def between_records(estimate: Estimate, jacobian: Array) -> tuple[Disagreement, ...]:
    """Return the parameters on which the records of a joint fit disagree.

    Each record's own estimate is one Gauss-Newton step from the joint estimate, so no run is
    repeated.

    Parameters
    ----------
    estimate
        Joint estimate; its parts assign the residuals to the records.
    jacobian
        Jacobian at the estimate, per unknown's scale, shape (n, p).
    """
    rows: dict[str, list[int]] = {}
    begin = 0
    for part in estimate.parts:
        rows.setdefault(part.record, []).extend(range(begin, begin + part.count))
        begin += part.count
    if len(rows) < 2:
        return ()
    scale = np.array([u.scale for u in estimate.unknowns])
    tables = {}
    for label, places in rows.items():
        r, J = estimate.residuals[places], jacobian[places]
        columns = _told_by(J)
        if r.size <= len(columns) or not columns:
            continue
        step = np.linalg.lstsq(J[:, columns], r, rcond=None)[0]
        sure = uncertainty(J[:, columns], r - J[:, columns] @ step)
        deviations = np.sqrt(np.diag(sure.covariance))
        tables[label] = {
            u.name: _Told(
                float(estimate.values[k] - step[i] * scale[k]),
                float(deviations[i] * scale[k]),
                sure.freedom,
                u.unit,
            )
            for i, k in enumerate(columns)
            if not (u := estimate.unknowns[k]).trial
        }
    return _apart(tables)


def _told_by(J: Array) -> list[int]:
    """Return the unknowns that a record determines, without undetermined combinations."""
    columns = [k for k in range(J.shape[1]) if J[:, k].any()]
    while columns:
        part = J[:, columns] / np.linalg.norm(J[:, columns], axis=0)
        _, s, V = np.linalg.svd(part, full_matrices=False)
        if s[-1] > _UNDETERMINED * s[0]:
            break
        columns.pop(int(np.argmax(np.abs(V[-1]))))
    return columns


def _apart(tables: Mapping[str, Mapping[str, _Told]]) -> tuple[Disagreement, ...]:
    from scipy import special

    names = list(dict.fromkeys(name for table in tables.values() for name in table))
    compared: list[tuple[Disagreement, float]] = []
    for name in names:
        known = {label: table[name] for label, table in tables.items() if name in table}
        for label, alone in known.items():
            others = [other for key, other in known.items() if key != label]
            if others and alone.deviation > 0.0:
                mean, deviation = _mean(others)
                freedom = min(alone.freedom, *(other.freedom for other in others))
                compared.append(
                    (
                        Disagreement(
                            label, name, alone.unit, alone.value, alone.deviation, mean, deviation
                        ),
                        freedom,
                    )
                )
    level = _FALSE_ALARM / max(len(compared), 1)
    apart = [
        each
        for each, freedom in compared
        if each.apart > special.stdtrit(max(freedom, 1.0), 1.0 - 0.5 * level)
        and abs(each.value - each.others) > _SMALL * abs(each.others)
    ]
    return tuple(sorted(apart, key=lambda each: -each.apart))


def _mean(records: Sequence[_Told]) -> tuple[float, float]:
    """Return the mean weighted by the variances, and its standard deviation."""
    weights = np.array([1.0 / max(each.deviation, 1e-300) ** 2 for each in records])
    values = np.array([each.value for each in records])
    return float(weights @ values / weights.sum()), float(1.0 / math.sqrt(weights.sum()))
