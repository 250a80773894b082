"""Limits of figures, from texts such as ``"<= 15 %"``, and verdicts on them."""

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
from bywire.core.errors import ParameterError, UnitError, not_valid, quoted, unknown_name
from bywire.core.undefined import EqualWhereUndefined
from bywire.core.values import number

Comparison = Literal["<=", ">=", "<", ">"]
COMPARE: Mapping[str, Callable[[Any, Any], Any]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}
"""comparisons of a value with a bound; an undefined value (NaN) meets none"""
_SIGN = re.compile("<=|>=|<|>")


@dataclass(frozen=True)
class Limit:
    """Limit of a figure, read from a file or an option.

    Parameters
    ----------
    figure
        Name of the limited figure.
    compare, bound, unit
        The comparison, and the bound in the figure's unit: SI, ``"%"`` or another one.
    text
        The user's text, for example ``"<= 15 %"``.
    probability
        Required probability of meeting the limit; None if every case must meet it.
    of_magnitude
        Whether the limit bounds the figure's magnitude.
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
        """Whether it is an upper limit."""
        return self.compare in ("<=", "<")

    def is_met(self, values: Any) -> NDArray[np.bool_]:
        """Return whether each value meets the limit; an undefined value does not."""
        return np.asarray(COMPARE[self.compare](self._bounded(values), self.bound))

    def is_near(self, values: Any, error: float) -> NDArray[np.bool_]:
        """Return whether each value is closer to the bound than its error."""
        return np.asarray(np.abs(self._bounded(values) - self.bound) <= error)

    def _bounded(self, values: Any) -> Any:
        return np.abs(values) if self.of_magnitude else values


@dataclass(frozen=True, eq=False)
class Verdict(EqualWhereUndefined):
    """Requirement with the value of its KPI.

    Parameters
    ----------
    required
        The requirement.
    value
        Value of the KPI in its unit; NaN if it is undefined.
    met
        Whether the value certainly meets the requirement; an undefined KPI does not.
    note
        Reason why the KPI is undefined.
    error
        Numerical error of the value, in its unit; NaN if it was not estimated.
    is_decided
        Whether the recording determines the value, and the value's distance to the limit exceeds
        its error.
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
        """Text of the limit."""
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

    A verdict is undecided if the KPI is closer to the limit than its error, or if the recording
    does not determine the KPI. A KPI without an error estimate is treated as exact.
    """
    by_name = {kpi.name: kpi for kpi in kpis}
    return tuple(verdict_of(limit, by_name[limit.figure]) for limit in limits)


def verdict_of(limit: Limit, kpi: Kpi) -> Verdict:
    """Return the verdict on a KPI with its limit (see `judge`)."""
    is_close = bool(limit.is_near(kpi.value, kpi.bound)) or math.isinf(kpi.bound)
    is_decided = not (is_close or kpi.is_open)
    met = is_decided and bool(limit.is_met(kpi.value))
    return Verdict(limit, kpi.value, met, kpi.note, kpi.bound, is_decided)


class Judged(Protocol):
    """Judged requirement: a `Verdict`, or a requirement over many cases."""

    @property
    def outcome(self) -> str:
        """``met``, ``missed`` or ``undecided``."""
        ...


def status_of(verdicts: Sequence[Judged]) -> str:
    """Return ``done`` without requirements, else ``failed``, ``undecided`` or ``passed``."""
    if not verdicts:
        return "done"
    outcomes = {verdict.outcome for verdict in verdicts}
    if "missed" in outcomes:
        return "failed"
    return "undecided" if "undecided" in outcomes else "passed"


def read_limits(
    requirements: Mapping[str, Any], units: Mapping[str, str], *, has_probabilities: bool = False
) -> dict[str, Limit]:
    """Return limits by KPI name.

    ``requirements``: texts by KPI name; ``units``: unit of every KPI of the experiment by name;
    ``has_probabilities``: see `read_limit`.

    Raises
    ------
    UnknownNameError
        When a requirement is for an unknown KPI.
    ParameterError
        When a limit or its probability cannot be read.
    UnitError
        When a limit's unit does not have the dimension of the KPI.
    """
    for name in requirements:
        if name not in units:
            raise unknown_name("KPI in [requirements]", name, units)
    return {
        name: read_limit(name, text, units[name], has_probability=has_probabilities)
        for name, text in requirements.items()
    }


def limit_like(unit: str) -> str:
    """Return an example of a limit for a key figure in a unit."""
    return "<= 15 %" if unit == "%" else f"<= {units.example(unit)}"


def read_limit(
    figure: str, text: Any, unit: str, what: str = "requirement", *, has_probability: bool = False
) -> Limit:
    """Return the limit of a figure in its unit.

    ``what``: noun for errors; ``has_probability``: whether the limit may end with a probability,
    such as ``with 99 %``, because it applies to the cases of a study.

    Raises
    ------
    ParameterError
        When the text is not a limit, or its probability is not valid.
    UnitError
        When its unit does not have the dimension of the figure.
    """
    subject = f"{what} {figure}"
    probability = None
    if isinstance(text, str):
        text, probability = split_probability(
            figure, text, subject, has_probability=has_probability
        )
    example = limit_like(unit)
    before, compare, bound = parted(text) if isinstance(text, str) else ("", None, "")
    if compare is None or before:
        raise not_valid(subject, quoted(text), f"a limit such as {example!r}")
    if unit != "%":
        return Limit(figure, compare, number(bound, unit, subject), unit, text, probability)
    if not bound.endswith("%"):  # a plain 15 would be 1500 %
        limit = f"a limit in percent such as {example!r}"
        raise not_valid(subject, quoted(text), limit, kind=UnitError)
    return Limit(figure, compare, 100.0 * units.parse(bound, "1", subject), unit, text, probability)


def split_probability(
    figure: str, text: str, subject: str, *, has_probability: bool
) -> tuple[str, float | None]:
    """Split a limit such as ``"<= 15 % with 99 %"`` into the limit and its probability.

    Parameters
    ----------
    figure, subject
        Name of the figure, and noun for errors.
    text
        The limit, possibly without a probability.
    has_probability
        See `read_limit`.

    Raises
    ------
    ParameterError
        If a probability is not allowed, or not valid.

    Examples
    --------
    >>> split_probability("overshoot", "<= 15 % with 99 %", "requirement", has_probability=True)
    ('<= 15 %', 0.99)
    """
    split = _WITH.fullmatch(text)
    if split is None:
        return text, None
    if not has_probability:
        raise ParameterError(
            f"{subject} = {quoted(text)}: only requirements of a study can have a "
            f"probability. Write {quoted(split[1])}",
            name=figure,
            value=quoted(text),
            valid=quoted(split[1]),
        )
    return split[1], _probability(figure, text, split[2])


_WITH = re.compile(r"(.*?)\s+with\b\s*(.*?)\s*", re.DOTALL)
_PERCENT = re.compile(r"[+-]?[\d.]+(?:[eE][+-]?\d+)?\s*%")
_SHARE = re.compile(r"0?\.\d+")
_DEMAND = "99 %"


def _probability(kpi: str, text: str, given: str) -> float:
    """Return the probability after "with" in the text of a requirement."""
    if not _PERCENT.fullmatch(given):  # 0.9 may mean a fraction, or 0.9 %
        example = f"{100.0 * float(given):.10g} %" if _SHARE.fullmatch(given) else _DEMAND
        raise ParameterError(
            f"requirement {kpi} = {quoted(text)}: the probability after 'with' must be in percent, "
            f"not {quoted(given)}. For example, write 'with {example}'",
            name=kpi,
            value=quoted(given),
            valid="in percent",
        )
    share = units.parse(given, "1", f"probability of requirement {kpi}")
    if not 0.0 < share < 1.0:
        raise ParameterError(
            f"requirement {kpi}: a probability of {given} is not valid: it must be between 0 and "
            "100 %, as in 'with 99.9 %'. Remove it if every case must meet the limit",
            name=kpi,
            value=given,
            valid="between 0 and 100 %",
        )
    return share


def parted(text: str) -> tuple[str, Comparison | None, str]:
    """Split a text at its first comparison: the part before, the comparison, and the rest.

    Examples
    --------
    >>> parted("lag >= -1 ms")
    ('lag', '>=', '-1 ms')
    """
    match = _SIGN.search(text)
    if match is None:
        return text.strip(), None, ""
    return text[: match.start()].strip(), cast(Comparison, match[0]), text[match.end() :].strip()
