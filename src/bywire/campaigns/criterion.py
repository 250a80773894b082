"""Criteria: what a failure must not do, against a limit or against the same run without it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from bywire.bench.values import written
from bywire.campaigns.lasting import first_time, least_of_the_last
from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.signals import Signal
from bywire.core.typing import Array

Sense = Literal["above", "below", "above_healthy", "below_healthy", "below_share"]
SENSES: tuple[Sense, ...] = ("above", "below", "above_healthy", "below_healthy", "below_share")
_KEYS = ("name", "signal", "lasting", "severity", *SENSES)


@dataclass(frozen=True)
class Criterion:
    """What a failure must not do.

    Parameters
    ----------
    name
        What reports call it.
    signal
        Recorded signal that is judged.
    sense, level
        On which side of what it must not be [SI]: a level, that far from the healthy run, or below
        a share of it.
    lasting
        For how long without a break [s].
    severity
        Class that the user gives it, for instance ``"S3"``.
    """

    name: str
    signal: str
    sense: Sense
    level: float
    lasting: float = 0.0
    severity: str = ""

    def excess(self, values: Array, healthy: Array) -> Array:
        """Return by how much each row exceeds what is admitted, shape (cases, rows)."""
        if self.sense == "above":
            return values - self.level
        if self.sense == "below":
            return self.level - values
        if self.sense == "above_healthy":
            return values - healthy - self.level
        if self.sense == "below_healthy":
            return healthy - values - self.level
        return np.asarray(self.level * healthy - values)

    def reached(self, values: Array, healthy: Array, time: Array, onset: Array) -> Array:
        """Return when it has lasted as long as it must not [s], NaN where never; shape (cases,)."""
        dt = float(time[1] - time[0])
        rows = round(min(self.lasting, dt * time.size) / dt) + 1
        lasted = least_of_the_last(self.excess(values, healthy), rows)
        beyond = np.where(lasted > 0, 1.0, 0.0)
        return first_time(beyond, time, onset + self.lasting)


def read_criteria(entries: Any, signals: Mapping[str, Signal]) -> tuple[Criterion, ...]:
    """Return the criteria of a campaign.

    Parameters
    ----------
    entries
        Tables of ``[[criteria]]``.
    signals
        What the model records.

    Raises
    ------
    InputError
        When one of them does not fit.
    """
    if not isinstance(entries, list) or not all(isinstance(each, Mapping) for each in entries):
        raise ParameterError("write [[criteria]] with two brackets, once for each criterion")
    criteria = tuple(_criterion(each, signals) for each in entries)
    names = [criterion.name for criterion in criteria]
    for name in names:
        if names.count(name) > 1:
            raise ParameterError(f"[[criteria]] {name!r} stands there twice: rename one")
    return criteria


def _criterion(entry: Mapping[str, Any], signals: Mapping[str, Signal]) -> Criterion:
    for key in entry:
        if key not in _KEYS:
            raise unknown_name("key of [[criteria]]", key, _KEYS)
    name, signal = entry.get("name"), entry.get("signal")
    if not isinstance(name, str) or not name.strip():
        raise ParameterError(f"[[criteria]] name = {quoted(name)}: a text is wanted")
    if not isinstance(signal, str) or signal not in signals:
        raise unknown_name(f"signal of criterion {name!r}", str(signal), signals)
    senses = [sense for sense in SENSES if sense in entry]
    if len(senses) != 1:
        raise ParameterError(
            f"[[criteria]] {name!r}: say exactly one of {', '.join(SENSES)}, for instance "
            'above_healthy = "5 bar"'
        )
    (sense,) = senses
    unit = "1" if sense == "below_share" else signals[str(signal)].unit
    level = written(entry[sense], unit, f"criterion {name}.{sense}")
    lasting = written(entry.get("lasting", 0.0), "s", f"criterion {name}.lasting")
    if lasting < 0:
        raise ParameterError(f"criterion {name}.lasting = {lasting:g} s must be >= 0 s")
    severity = entry.get("severity", "")
    if not isinstance(severity, str):
        raise ParameterError(f"criterion {name}.severity = {quoted(severity)}: a text is wanted")
    return Criterion(name, str(signal), sense, level, lasting, severity)
