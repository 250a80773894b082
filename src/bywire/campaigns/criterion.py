"""Criteria: what a failure must not do, against a limit or against the same run without it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from bywire.campaigns.lasting import first_time, least_of_the_last
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.quantities import TimeConstant
from bywire.core.section import Name, Section
from bywire.core.signals import Signal
from bywire.core.typing import Array
from bywire.core.values import written

Sense = Literal["above", "below", "above_healthy", "below_healthy", "below_share"]
SENSES: tuple[Sense, ...] = ("above", "below", "above_healthy", "below_healthy", "below_share")


class CriterionSection(Section):
    """A section ``[[criteria]]``; its level has the unit of its signal."""

    name: Name
    signal: Any = ""
    lasting: TimeConstant = 0.0
    severity: str = ""
    above: Any = None
    below: Any = None
    above_healthy: Any = None
    below_healthy: Any = None
    below_share: Any = None


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


def criteria_of(
    sections: Sequence[CriterionSection], signals: Mapping[str, Signal]
) -> tuple[Criterion, ...]:
    """Return the criteria of a campaign.

    Parameters
    ----------
    sections
        What its file says.
    signals
        What the model records.

    Raises
    ------
    InputError
        When one of them does not fit.
    """
    criteria = tuple(_criterion(each, signals) for each in sections)
    names = [criterion.name for criterion in criteria]
    for name in names:
        if names.count(name) > 1:
            raise ParameterError(f"[[criteria]] {name!r} stands there twice: rename one")
    return criteria


def _criterion(section: CriterionSection, signals: Mapping[str, Signal]) -> Criterion:
    name, signal = section.name, section.signal
    if not isinstance(signal, str) or signal not in signals:
        raise unknown_name(f"signal of criterion {name!r}", str(signal), signals)
    senses = [sense for sense in SENSES if sense in section.given]
    if len(senses) != 1:
        raise ParameterError(
            f"[[criteria]] {name!r}: say exactly one of {', '.join(SENSES)}, for instance "
            'above_healthy = "5 bar"'
        )
    (sense,) = senses
    unit = "1" if sense == "below_share" else signals[signal].unit
    level = written(getattr(section, sense), unit, f"criterion {name}.{sense}")
    return Criterion(name, signal, sense, level, section.lasting, section.severity)
