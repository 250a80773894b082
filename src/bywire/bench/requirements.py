"""Requirements: a KPI with its limit, as text such as ``"<= 15 %"``."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from bywire.bench.kpis.kpi import Kpi
from bywire.core import units
from bywire.core.errors import ParameterError, unknown_name

_COMPARE: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}
_TEXT = re.compile(r"\s*(<=|>=|<|>)\s*(.+)")


@dataclass(frozen=True)
class Verdict:
    """A requirement beside what was found.

    Parameters
    ----------
    kpi
        Name of the KPI.
    limit
        The requirement as the user wrote it.
    value, unit
        What was found; NaN where the KPI is not defined.
    met
        Whether the requirement is met; an undefined KPI meets none.
    note
        Why the KPI is not defined.
    """

    kpi: str
    limit: str
    value: float
    unit: str
    met: bool
    note: str


def check_syntax(requirements: Mapping[str, str]) -> None:
    """Raise a ParameterError unless every requirement can be read."""
    for name, text in requirements.items():
        _parts(name, text)


def judge(requirements: Mapping[str, str], kpis: Sequence[Kpi]) -> tuple[Verdict, ...]:
    """Compare KPIs with their limits.

    Raises
    ------
    UnknownNameError
        When a requirement names no KPI of the experiment.
    ParameterError
        When a limit cannot be read.
    UnitError
        When a limit's unit measures something else than the KPI.
    """
    by_name = {kpi.name: kpi for kpi in kpis}
    verdicts = []
    for name, text in requirements.items():
        if name not in by_name:
            raise unknown_name("KPI in [requirements]", name, by_name)
        kpi = by_name[name]
        compare, limit = _parts(name, text)
        bound = _limit(limit, kpi)
        met = not math.isnan(kpi.value) and _COMPARE[compare](kpi.value, bound)
        verdicts.append(Verdict(name, text, kpi.value, kpi.unit, met, kpi.note))
    return tuple(verdicts)


def _parts(name: str, text: str) -> tuple[str, str]:
    match = _TEXT.fullmatch(text) if isinstance(text, str) else None
    if match is None:
        raise ParameterError(
            f"requirement {name} = {text!r} cannot be read: write for instance '<= 15 %'"
        )
    return match.group(1), match.group(2)


def _limit(text: str, kpi: Kpi) -> float:
    label = f"requirement {kpi.name}"
    if kpi.unit != "%":
        return units.parse(text, kpi.unit, label)
    # A percentage is written as one, or as a plain share of one.
    return 100.0 * units.parse(text, "1", label)
