"""Requirements: a KPI with its limit, as text such as ``"<= 15 %"``."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bywire.bench.kpis.kpi import Kpi
from bywire.bench.values import number
from bywire.core import units
from bywire.core.errors import ParameterError, UnitError, quoted, unknown_name
from bywire.core.typing import Array
from bywire.core.undefined import EqualWhereUndefined

# Longer signs first, as "<=" begins with "<".
_COMPARE: dict[str, Callable[[Any, float], Any]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}


@dataclass(frozen=True, eq=False)
class Verdict(EqualWhereUndefined):
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
        Whether the value meets the requirement for certain; an undefined KPI meets none.
    note
        Why the KPI is not defined.
    error
        How far the value may be off, in ``unit``; NaN where that was not estimated.
    is_decided
        Whether the recording shows what the value is, and this is further from the limit than it
        may be wrong.
    """

    kpi: str
    limit: str
    value: float
    unit: str
    met: bool
    note: str
    error: float = math.nan
    is_decided: bool = True

    @property
    def outcome(self) -> str:
        """``met``, ``missed`` or ``undecided``."""
        return ("met" if self.met else "missed") if self.is_decided else "undecided"


def check(requirements: Mapping[str, str], kpis: Mapping[str, str]) -> None:
    """Refuse requirements that cannot be judged.

    ``requirements``: texts by KPI name; ``kpis``: unit of every KPI of the experiment by name.

    Raises
    ------
    UnknownNameError
        When a requirement names no KPI of the experiment.
    ParameterError
        When a limit cannot be read.
    UnitError
        When a limit's unit measures something else than the KPI.
    """
    for name, text in requirements.items():
        if name not in kpis:
            raise unknown_name("KPI in [requirements]", name, kpis)
        limit_of(name, text, kpis[name])


def judge(requirements: Mapping[str, str], kpis: Sequence[Kpi]) -> tuple[Verdict, ...]:
    """Compare KPIs with their limits, which :func:`check` has admitted.

    Undecided is what lies no further from its limit than its error, and what the recording leaves
    open; a KPI without an error estimate is taken as it is.
    """
    by_name = {kpi.name: kpi for kpi in kpis}
    verdicts = []
    for name, text in requirements.items():
        kpi = by_name[name]
        compare, bound = limit_of(name, text, kpi.unit)
        is_close = abs(kpi.value - bound) <= kpi.bound or math.isinf(kpi.bound)
        is_decided = not (is_close or kpi.is_open)
        met = is_decided and not math.isnan(kpi.value) and bool(_COMPARE[compare](kpi.value, bound))
        verdicts.append(
            Verdict(name, text, kpi.value, kpi.unit, met, kpi.note, kpi.bound, is_decided)
        )
    return tuple(verdicts)


def is_met(values: Array, compare: str, bound: float) -> NDArray[np.bool_]:
    """Return whether each value meets a limit of `limit_of`; what is not defined does not."""
    return np.asarray(_COMPARE[compare](values, bound))


class Judged(Protocol):
    """A requirement that was judged: a `Verdict`, or one over many cases."""

    @property
    def outcome(self) -> str:
        """``met``, ``missed`` or ``undecided``."""
        ...


def status_of(verdicts: Sequence[Judged]) -> str:
    """Return ``done`` where nothing is required, else ``failed``, ``undecided`` or ``passed``."""
    if not verdicts:
        return "done"
    outcomes = {verdict.outcome for verdict in verdicts}
    if "missed" in outcomes:
        return "failed"
    return "undecided" if "undecided" in outcomes else "passed"


def limit_of(name: str, text: Any, unit: str) -> tuple[str, float]:
    """Return the comparison and the limit in the KPI's unit.

    Raises
    ------
    ParameterError
        When the text is no requirement.
    UnitError
        When its unit measures something else than the KPI.
    """
    example = "<= 15 %" if unit == "%" else f"<= {units.example(unit)}"
    written = text.strip() if isinstance(text, str) else ""
    compare = next((sign for sign in _COMPARE if written.startswith(sign)), "")
    if not compare:
        raise ParameterError(
            f"requirement {name} = {quoted(text)} cannot be read: write for instance {example!r}"
        )
    limit = written.removeprefix(compare).strip()
    if unit != "%":
        return compare, number(limit, unit, f"requirement {name}")
    if not limit.endswith("%"):  # 15 would be a share of 1500 %, which nobody means
        raise UnitError(
            f"requirement {name} = {quoted(text)} is no limit in percent: "
            f"write for instance {example!r}"
        )
    return compare, 100.0 * units.parse(limit, "1", f"requirement {name}")
