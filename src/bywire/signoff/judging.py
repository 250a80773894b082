"""Verdicts on limits, evidence and requirements."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from bywire.bench.requirements import Limit, verdict_of
from bywire.core.undefined import EqualWhereUndefined
from bywire.report.answer import OUTCOMES, FigureAt, Outcome, outcome_of


@dataclass(frozen=True, eq=False)
class Judged(EqualWhereUndefined):
    """Verdict on one limit, or on a result without a limit.

    Parameters
    ----------
    outcome
        The verdict.
    limit
        Text of the limit; empty without one.
    value, unit
        Worst value of the figure, in its unit; NaN if it is undefined, or without a limit.
    error
        Bound of its numerical or statistical error, in its unit; NaN if it is unknown.
    room
        Distance between the value and the limit, in the figure's unit; negative beyond the limit.
    at
        Where the worst value occurs; empty without a range.
    note
        Reason for a verdict other than ``met``, or a probability with its interval.
    """

    outcome: Outcome
    limit: str = ""
    value: float = math.nan
    unit: str = ""
    error: float = math.nan
    room: float = math.nan
    at: str = ""
    note: str = ""

    def as_object(self) -> dict[str, Any]:
        """Return the fields by name."""
        return asdict(self)


def judged_from(fields: Mapping[str, Any]) -> Judged:
    """Return a verdict from its stored fields, where null means undefined.

    Raises
    ------
    TypeError, ValueError
        If a field is missing or has another type.
    """
    outcome = fields["outcome"]
    if outcome not in OUTCOMES:
        raise ValueError("not a verdict")
    return Judged(
        outcome,
        limit=_text(fields["limit"]),
        value=_number(fields["value"]),
        unit=_text(fields["unit"]),
        error=_number(fields["error"]),
        room=_number(fields["room"]),
        at=_text(fields["at"]),
        note=_text(fields["note"]),
    )


def _number(value: Any) -> float:
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError("not a number")
    return float(value)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError("not a text")
    return value


def judge_limit(limit: Limit, figures: Sequence[FigureAt]) -> Judged:
    """Judge a limit on a figure, at its worst value if there are several.

    The limit is met if every value certainly meets it, and missed if one certainly misses it.
    """
    rows = [each for each in figures if each.kpi.name == limit.figure]
    text = str(limit)
    if not rows:
        return Judged("not shown", text, note=f"the result does not contain {limit.figure}")
    verdicts = [(verdict_of(limit, each.kpi), each) for each in rows]
    outcome = outcome_of([verdict.outcome for verdict, _ in verdicts])
    verdict, worst = min(
        (pair for pair in verdicts if pair[0].outcome == outcome),
        key=lambda pair: _room(limit, pair[0].value),
    )
    note = worst.kpi.note if math.isnan(verdict.value) else ""
    if outcome == "undecided" and not note:
        note = "the difference from the limit is smaller than the error"
    return Judged(
        outcome,
        text,
        verdict.value,
        limit.unit,
        verdict.error,
        _room(limit, verdict.value, undefined=math.nan),
        worst.at,
        note,
    )


def _room(limit: Limit, value: float, undefined: float = -math.inf) -> float:
    if math.isnan(value):
        return undefined
    size = abs(value) if limit.of_magnitude else value
    return limit.bound - size if limit.is_upper else size - limit.bound
