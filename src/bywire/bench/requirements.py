"""Limits of figures, as text such as ``"<= 15 %"``, and verdicts on them."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from bywire.bench.kpis.kpi import Kpi
from bywire.core import units
from bywire.core.errors import ParameterError, UnitError, quoted, unknown_name
from bywire.core.undefined import EqualWhereUndefined
from bywire.core.values import number

Comparison = Literal["<=", ">=", "<", ">"]
COMPARE: Mapping[str, Callable[[Any, Any], Any]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}
"""how a value is compared with a bound; what is not defined meets none"""
_SIGN = re.compile("<=|>=|<|>")


@dataclass(frozen=True)
class Limit:
    """A limit of a figure, read once where a file or an option states it.

    Parameters
    ----------
    figure
        What is limited.
    compare, bound, unit
        The comparison, and the bound in the figure's unit: SI, ``"%"`` or what the figure has.
    text
        As the user wrote it, for instance ``"<= 15 %"``.
    probability
        Least probability that it is met; None where every case has to meet it.
    of_magnitude
        Whether it bounds the figure both ways.
    """

    figure: str
    compare: Comparison
    bound: float
    unit: str
    text: str
    probability: float | None = None
    of_magnitude: bool = False

    def __str__(self) -> str:
        share = "" if self.probability is None else f" with {100.0 * self.probability:.10g} %"
        return f"{self.figure} {self.text}{share}"

    @property
    def is_upper(self) -> bool:
        """Whether it bounds from above."""
        return self.compare in ("<=", "<")

    def is_met(self, values: Any) -> NDArray[np.bool_]:
        """Return whether each value meets it; what is not defined does not."""
        return np.asarray(COMPARE[self.compare](self._bounded(values), self.bound))

    def is_near(self, values: Any, error: float) -> NDArray[np.bool_]:
        """Return whether each value is no further from the bound than it may be off."""
        return np.asarray(np.abs(self._bounded(values) - self.bound) <= error)

    def _bounded(self, values: Any) -> Any:
        return np.abs(values) if self.of_magnitude else values


@dataclass(frozen=True, eq=False)
class Verdict(EqualWhereUndefined):
    """A requirement beside what was found.

    Parameters
    ----------
    required
        The requirement.
    value
        What was found, in its unit; NaN where the KPI is not defined.
    met
        Whether the value meets the requirement for certain; an undefined KPI meets none.
    note
        Why the KPI is not defined.
    error
        How far the value may be off, in its unit; NaN where that was not estimated.
    is_decided
        Whether the recording shows what the value is, and this is further from the limit than it
        may be wrong.
    """

    required: Limit
    value: float
    met: bool
    note: str
    error: float = math.nan
    is_decided: bool = True

    @property
    def kpi(self) -> str:
        """Name of the KPI."""
        return self.required.figure

    @property
    def limit(self) -> str:
        """The limit as the user wrote it."""
        return self.required.text

    @property
    def unit(self) -> str:
        """Unit of value, error and bound."""
        return self.required.unit

    @property
    def outcome(self) -> str:
        """``met``, ``missed`` or ``undecided``."""
        return ("met" if self.met else "missed") if self.is_decided else "undecided"


def judge(limits: Iterable[Limit], kpis: Iterable[Kpi]) -> tuple[Verdict, ...]:
    """Compare KPIs with their limits.

    Undecided is what lies no further from its limit than its error, and what the recording leaves
    open; a KPI without an error estimate is taken as it is.
    """
    by_name = {kpi.name: kpi for kpi in kpis}
    return tuple(verdict_of(limit, by_name[limit.figure]) for limit in limits)


def verdict_of(limit: Limit, kpi: Kpi) -> Verdict:
    """Return what a KPI is worth beside its limit; see `judge`."""
    is_close = bool(limit.is_near(kpi.value, kpi.bound)) or math.isinf(kpi.bound)
    is_decided = not (is_close or kpi.is_open)
    met = is_decided and bool(limit.is_met(kpi.value))
    return Verdict(limit, kpi.value, met, kpi.note, kpi.bound, is_decided)


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


def read_limits(requirements: Mapping[str, Any], units: Mapping[str, str]) -> dict[str, Limit]:
    """Return limits by KPI name.

    ``requirements``: texts by KPI name; ``units``: unit of every KPI of the experiment by name.

    Raises
    ------
    UnknownNameError
        When a requirement names no KPI of the experiment.
    ParameterError
        When a limit cannot be read.
    UnitError
        When a limit's unit measures something else than the KPI.
    """
    for name in requirements:
        if name not in units:
            raise unknown_name("KPI in [requirements]", name, units)
    return {name: read_limit(name, text, units[name]) for name, text in requirements.items()}


def read_limit(figure: str, text: Any, unit: str, what: str = "requirement") -> Limit:
    """Return the limit of a figure in its unit.

    ``what``: what errors call it.

    Raises
    ------
    ParameterError
        When the text is no limit.
    UnitError
        When its unit measures something else than the figure.
    """
    example = "<= 15 %" if unit == "%" else f"<= {units.example(unit)}"
    before, compare, bound = parted(text) if isinstance(text, str) else ("", None, "")
    if compare is None or before:
        raise ParameterError(
            f"{what} {figure} = {quoted(text)} cannot be read: write for instance {example!r}"
        )
    if unit != "%":
        return Limit(figure, compare, number(bound, unit, f"{what} {figure}"), unit, text)
    if not bound.endswith("%"):  # 15 would be a share of 1500 %, which nobody means
        raise UnitError(
            f"{what} {figure} = {quoted(text)} is no limit in percent: "
            f"write for instance {example!r}"
        )
    return Limit(figure, compare, 100.0 * units.parse(bound, "1", f"{what} {figure}"), unit, text)


def parted(text: str) -> tuple[str, Comparison | None, str]:
    """Return what stands before the first comparison of a text, the comparison, and what follows.

    Examples
    --------
    >>> parted("lag >= -1 ms")
    ('lag', '>=', '-1 ms')
    """
    match = _SIGN.search(text)
    if match is None:
        return text.strip(), None, ""
    return text[: match.start()].strip(), cast(Comparison, match[0]), text[match.end() :].strip()
