"""Whether records agree: each record's own estimate beside that of all others."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.core.units import shown
from bywire.identification.confidence import uncertainty
from bywire.identification.estimate import Estimate

_LEVEL = 1e-3  # of a false alarm, over all records and parameters
_SMALL = 1e-3  # of the value: less matters to nobody
_FLAT = 1e-6  # singular value per the largest one: a record that does not tell an unknown


@dataclass(frozen=True)
class Disagreement:
    """A parameter that a record tells otherwise than the other records do.

    Parameters
    ----------
    record, name, unit
        Which record, and which parameter.
    value, deviation
        Of the record alone [unit].
    others, others_deviation
        Of the other records together [unit].
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
        """Difference over its standard deviation."""
        return abs(self.value - self.others) / math.hypot(self.deviation, self.others_deviation)

    def __str__(self) -> str:
        """Return it as a sentence."""
        there, rest = (
            f"{shown(float(f'{value:.5g}'), self.unit)} +- {deviation:.2g}"
            for value, deviation in (
                (self.value, self.deviation),
                (self.others, self.others_deviation),
            )
        )
        return (
            f"records do not agree: {self.name} is {there} in {self.record} and {rest} in the "
            f"others (standard deviations), {self.apart:.2g} of their difference's apart: look at "
            "that record, or at what differs between them; no joint interval holds"
        )


@dataclass(frozen=True)
class _Told:
    """What a record alone tells of a parameter."""

    value: float
    deviation: float
    freedom: float
    unit: str


def disagreements(estimates: Mapping[str, Estimate]) -> tuple[Disagreement, ...]:
    """Return what several records of one thing, estimated one by one, tell differently.

    Parameters
    ----------
    estimates
        By the record's label, two at least; parameters go together by their names.

    Returns
    -------
    tuple of Disagreement
        The largest first; empty where chance explains all, which it fails to once in a thousand
        times. A record's estimate is compared with the mean of all others', weighted by their
        variances.

    Raises
    ------
    ParameterError
        When there are fewer than two estimates.

    References
    ----------
    W. G. Cochran, The combination of estimates from different experiments, Biometrics 10, 1954.
    """
    if len(estimates) < 2:
        raise ParameterError("one estimate alone agrees with itself: give one for each record")
    tables = {
        label: {
            u.name: _Told(float(v), float(d), estimate.freedom, u.unit)
            for u, v, d in zip(estimate.unknowns, estimate.values, estimate.deviations, strict=True)
        }
        for label, estimate in estimates.items()
    }
    return _apart(tables)


def between_records(estimate: Estimate, jacobian: Array) -> tuple[Disagreement, ...]:
    """Return what the records of a joint fit tell differently.

    Each record's own estimate is one step of Gauss and Newton from the joint one, so that no
    run is computed again.

    Parameters
    ----------
    estimate
        Of all records; its parts say which residuals are whose.
    jacobian
        There, per unknown's scale, shape (n, p).
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
    """Return the unknowns that a record tells, one less of a combination that it does not."""
    columns = [k for k in range(J.shape[1]) if J[:, k].any()]
    while columns:
        part = J[:, columns] / np.linalg.norm(J[:, columns], axis=0)
        _, s, V = np.linalg.svd(part, full_matrices=False)
        if s[-1] > _FLAT * s[0]:
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
    level = _LEVEL / max(len(compared), 1)
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
