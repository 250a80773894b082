"""Result of a procedure: its stops with their conditions, key figures, limits and verdicts."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.bench.requirements import Verdict
from bywire.bench.result_folder import kpi_record, verdict_record
from bywire.core.errors import counted
from bywire.core.units import difference_unit, unit_text
from bywire.procedures.procedure_file import StopPlan
from bywire.procedures.sequence import NOT_SHOWN, NotShown, Procedure, Stop
from bywire.report.answer import Answer, FigureAt, Outcome, outcome_of
from bywire.report.document import (
    Banner,
    Block,
    Document,
    FigureBlock,
    Listing,
    Paragraph,
    Section,
    TableBlock,
    spaced,
)
from bywire.report.subject import Subject
from bywire.report.tables import OUTCOMES, Cell, Table, amount_cell, measured_cell, text_table
from bywire.report.wording import amount

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_VERDICTS = {"passed": "good", "failed": "bad", "undecided": "open", "incomplete": "open"}
_COLUMNS = (
    ("disc_before", "disc before"),
    ("disc_after", "disc after"),
    ("stopping_distance", "distance"),
    ("mfdd", "MFDD"),
    ("time_to_lift", "time to lift"),
)
_OF_STANDSTILL = ("stopping_distance", "time_to_lift")
_NAMED = 3  # limits in the banner


@dataclass(frozen=True, repr=False)
class ProcedureResult(Answer):
    """Result of a procedure.

    Parameters
    ----------
    procedure
        Its stops, with key figures and verdicts.
    """

    procedure: Procedure

    @property
    def status(self) -> str:
        """``passed``, ``failed``, ``undecided``, or ``incomplete`` if a limit has no verdict."""
        return self.procedure.status

    @property
    def holds(self) -> bool:
        """Whether every limit is met. A limit without a verdict is not met."""
        return self.status == "passed"

    @property
    def outcome(self) -> Outcome:
        """Worst verdict on the limits; ``not shown`` without any."""
        judged = [each.outcome for each in self.procedure.verdicts]
        return outcome_of([*judged, *(each.outcome for each in self.procedure.gaps)])

    @property
    def key_figures(self) -> list[FigureAt]:
        """Key figures of every stop."""
        return [
            FigureAt(kpi, f"{stop.plan.name} {_numbered(stop)}")
            for stop in self.stops
            for kpi in stop.kpis
        ]

    @property
    def stops(self) -> tuple[Stop, ...]:
        """The stops in order."""
        return self.procedure.stops

    @property
    def warnings(self) -> list[str]:
        """Warnings of the runs, each once, with the name of the stop."""
        counts = Counter(
            f"{stop.plan.name}: {text}" for stop in self.stops for text in stop.warnings
        )
        return [*counts]

    def document(self) -> Document:
        """Return the stops, the limits with their verdicts, and the numbers with their sources."""
        plan = self.procedure.plan
        count = sum(stop.count for stop in self.stops)
        summary = f"{counted(count, 'stop')} of {plan.bench.system} ({plan.bench.experiment})"
        subject = Subject.of_bench(plan.bench, plan.name, summary)
        stops, limits = TableBlock(self._stops()), TableBlock(self._limits())
        warned = [Listing([f"Warning: {text}." for text in self.warnings])] if self.warnings else []
        absent = [Listing(plan.missing, "Not included in this file:")] if plan.missing else []
        source = [Paragraph(f"Source: {plan.source}.")] if plan.source else []
        figures: list[Block] = []
        if any(self._groups()):
            figures.append(FigureBlock(self._drawn_heat, _HEAT_CAPTION, "temperatures"))
        if self._used():
            figures.append(FigureBlock(self._drawn_limits, _LIMIT_CAPTION, "limits"))
        numbers = [TableBlock(self._numbers())] if plan.numbers else []
        return Document(
            plan.title,
            subject.line,
            sections=lambda: [
                Section("Limits", [*source, *warned, limits, *absent]),
                Section("Stops", [stops, *figures]),
                *([Section("Numbers", numbers)] if numbers else []),
                subject.provenance(),
            ],
            brief=[f"procedure {plan.name}: {plan.title}", *spaced([stops, limits, *absent])],
            data=self._data(),
            banner=Banner(self._outcome(), _VERDICTS[self.status]),  # type: ignore[arg-type]
            record="procedure.json",
            remarks=[*self._remarks()],
            changes=subject.changes,
        )

    def _outcome(self) -> str:
        verdicts, gaps = self.procedure.verdicts, self.procedure.gaps
        met = sum(each.met for each in verdicts)
        text = f"{met} of {len(verdicts) + len(gaps)} limits met"
        if open_ := sum(not each.is_decided for each in verdicts):
            text += f", {open_} undecided"
        if gaps:
            text += f", {len(gaps)} not shown"
        missed = dict.fromkeys(
            f"{stop.plan.name} {each.kpi}"
            for stop in self.stops
            for each in stop.verdicts
            if each.outcome == "missed"
        )
        if missed:
            more = f" and {len(missed) - _NAMED} more" if len(missed) > _NAMED else ""
            text += f"; not met: {', '.join([*missed][:_NAMED])}{more}"
        return text

    def _remarks(self) -> list[str]:
        return [
            f"limit not met: {each.kpi} of {stop.plan.name} {_numbered(stop)} is "
            f"{amount(each.value, each.unit)}, and the limit is {each.limit}"
            for stop in self.stops
            for each in stop.verdicts
            if each.outcome == "missed"
        ]

    def _stops(self) -> Table:
        figures = self.procedure.plan.demand_figures.units
        columns = [
            (name, heading)
            for name, heading in (
                *_COLUMNS,
                *((name, name.replace("_", " ", 1)) for name in figures),
            )
            if any((kpi := stop.kpi(name)) and math.isfinite(kpi.value) for stop in self.stops)
        ]
        heading = ["stop", "number", "speed", "conditions", *(each for _, each in columns)]
        rows = [
            (
                stop.plan.name,
                _numbered(stop),
                _speed_cell(stop.plan),
                _conditions(stop) or "-",
                *(_kpi_cell(stop, name) for name, _ in columns),
            )
            for stop in self.stops
        ]
        table = text_table(heading, rows)
        marked = [replace(c, is_detail=c.heading == "conditions") for c in table.columns]
        return replace(table, columns=tuple(marked))

    def _limits(self) -> Table:
        heading = ("stop", "number", "figure", "value", "limit", "margin", "verdict", "paragraph")
        rows: list[tuple[object, ...]] = []
        for stop in self.stops:
            head, tail = (stop.plan.name, _numbered(stop)), stop.plan.source or "-"
            for each in stop.verdicts:
                value = measured_cell(each.value, each.unit, each.error)
                margin = _margin_cell(each)
                outcome = OUTCOMES[each.outcome]
                rows.append((*head, each.kpi, value, each.limit, margin, outcome, tail))
            for gap in stop.gaps:
                outcome = Cell(f"{NOT_SHOWN} ({gap.reason})", "open")
                rows.append((*head, gap.figure, "-", gap.limit, "-", outcome, tail))
        return text_table(heading, rows)

    def _numbers(self) -> Table:
        return text_table(
            ("number", "value", "source"),
            (
                (each.name, each.value or Cell("missing", "open"), each.source)
                for each in self.procedure.plan.numbers
            ),
        )

    def _groups(self) -> list[list[Stop]]:
        """Return groups of stops in which each stop begins with the heat of the previous one."""
        groups: list[list[Stop]] = []
        for stop in self.stops:
            discs = [name for name in stop.course if name.startswith("T_disc")]
            if not discs or stop.plan.interval is None:
                continue
            if stop.begin > 0.0 and groups:
                groups[-1].append(stop)
            else:
                groups.append([stop])
        return groups

    def _drawn_heat(self) -> Figure:
        from bywire.report.procedure_figures import HeatedStop, temperature_figure

        motion = next(stop.plan.motion for stop in self.stops if stop.plan.motion is not None)
        labels = {
            part.state_name("T_disc"): (part.which or name).strip(", ")
            for name, part in motion.brakes.items()
        }
        none = np.zeros(0)
        return temperature_figure(
            [
                [
                    HeatedStop(
                        stop.begin,
                        stop.course["time"],
                        {label: stop.course[name] for name, label in labels.items()},
                        np.asarray(stop.pause.get("time", ())),
                        {label: stop.pause.get(name, none) for name, label in labels.items()},
                    )
                    for stop in group
                ]
                for group in self._groups()
            ]
        )

    def _used(self) -> list[tuple[str, float, str]]:
        return [
            (
                f"{stop.plan.name} {_numbered(stop)}: {each.kpi}",
                100.0 * _used_part(each),
                each.outcome,
            )
            for stop in self.stops
            for each in stop.verdicts
            if each.unit != "K" and each.value > 0.0 and each.required.bound > 0.0
        ]

    def _drawn_limits(self) -> Figure:
        from bywire.report.procedure_figures import UsedLimit, limit_figure

        return limit_figure([UsedLimit(*each) for each in self._used()])

    def _data(self) -> dict[str, Any]:
        plan = self.procedure.plan
        return {
            "procedure": plan.name,
            "title": plan.title,
            "source": plan.source,
            "status": self.status,
            "experiment": plan.bench.experiment,
            "parameters": plan.bench.parameters,
            "v_max": plan.v_max,
            "stops": [_stop_record(stop) for stop in self.stops],
            "numbers": {
                each.name: {"value": each.value or None, "source": each.source}
                for each in plan.numbers
            },
            "missing": list(plan.missing),
            "warnings": self.warnings,
        }


_HEAT_CAPTION = (
    "Disc temperatures. Solid lines show the stops, and dotted lines show the intervals between "
    "them. Each panel shows a series of stops in which each stop begins with the heat of the "
    "previous one."
)
_LIMIT_CAPTION = (
    "Utilization of each limit: the ratio of the value to an upper limit, or of a lower limit to "
    "the value. Bars that extend past the dotted line miss their limit."
)


def _numbered(stop: Stop) -> str:
    last = stop.first + stop.count - 1
    return f"{stop.first}" if stop.count == 1 else f"{stop.first} to {last}"


def _speed_cell(plan: StopPlan) -> Cell:
    if plan.bench is None:
        return Cell("-")
    text = f"{3.6 * plan.v_0:.4g}"
    text += f" to {3.6 * plan.until:.4g}" if plan.until else ""
    return Cell(f"{text} {unit_text('km/h')}")


def _conditions(stop: Stop) -> str:
    """Return the conditions of a stop in addition to its speed."""
    plan = stop.plan
    if plan.bench is None:
        return f"missing: {', '.join(plan.lacking)}"
    texts = [f"{name} = {value}" for name, value in plan.changes]
    if plan.T_brake is not None and (stop.first == 1 or plan.interval is None):
        texts.insert(0, f"discs at {amount(plan.T_brake, 'K')}")
    elif plan.interval is not None and stop.begin > 0.0:
        texts.insert(0, f"{amount(plan.interval, 's')} after the start of the previous stop")
    if plan.deceleration is not None:
        texts.append(f"adjusted to {amount(plan.deceleration, 'm/s**2')}")
    return ", ".join(texts)


def _kpi_cell(stop: Stop, name: str) -> Cell:
    kpi, is_partial = stop.kpi(name), stop.plan.until > 0.0
    if kpi is None or not math.isfinite(kpi.value) or (is_partial and name in _OF_STANDSTILL):
        return Cell("-")
    return amount_cell(kpi.value, kpi.unit)


def _used_part(verdict: Verdict) -> float:
    """Return the ratio of the value to an upper limit, or of a lower limit to the value."""
    share = verdict.value / verdict.required.bound
    return share if verdict.required.is_upper else 1.0 / share


def _margin_cell(verdict: Verdict) -> Cell:
    """Return the distance to a limit; negative if the limit is missed."""
    limit = verdict.required
    if not math.isfinite(verdict.value):
        return Cell("-")
    distance = limit.bound - verdict.value if limit.is_upper else verdict.value - limit.bound
    return amount_cell(distance, difference_unit(verdict.unit))


def _stop_record(stop: Stop) -> dict[str, Any]:
    plan = stop.plan
    conditions = {
        "v_0": plan.v_0,
        "until": plan.until,
        "interval": plan.interval,
        "T_brake": plan.T_brake,
        "deceleration": plan.deceleration,
        "changes": dict(plan.changes),
    }
    return {
        "name": plan.name,
        "source": plan.source,
        "first": stop.first,
        "count": stop.count,
        "was_run": plan.bench is not None and bool(stop.kpis),
        "conditions": conditions if plan.bench is not None else None,
        "kpis": {kpi.name: kpi_record(kpi) for kpi in stop.kpis},
        "requirements": [
            *(verdict_record(each) for each in stop.verdicts),
            *(_gap_record(each) for each in stop.gaps),
        ],
    }


def _gap_record(gap: NotShown) -> dict[str, Any]:
    return {
        "kpi": gap.figure,
        "limit": gap.limit,
        "outcome": gap.outcome,
        "reason": gap.reason,
    }
