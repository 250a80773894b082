"""Results of a fault campaign: each fault's effect, the residual that detects it, coverage."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from bywire.api.run_sections import choice_data, choice_texts, varied_texts
from bywire.bench.kpis.kpi import Kpi
from bywire.campaigns.residual import NEVER
from bywire.campaigns.running import CampaignFindings, FaultFinding
from bywire.core.signals import signals_of
from bywire.core.typing import Array
from bywire.core.units import difference_unit
from bywire.report.answer import Answer, FigureAt, Outcome
from bywire.report.document import (
    Banner,
    Details,
    Document,
    FigureBlock,
    Listing,
    Paragraph,
    Section,
    TableBlock,
)
from bywire.report.subject import Subject
from bywire.report.tables import Cell, Column, Table, amount_cell, text_table
from bywire.report.wording import amount, clean
from bywire.studies.statistics import Share

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bywire.bench.running import Result

R = TypeVar("R")


@dataclass(frozen=True)
class Quantity(Generic[R]):
    """A quantity of every row.

    Parameters
    ----------
    value
        Value for a row, as in JSON.
    key
        Name in JSON. Empty if JSON does not contain it.
    heading
        Heading of its column. Empty if tables do not show it.
    unit
        SI unit of a number, ``"1"`` for a pure number. Empty for anything else.
    text
        Text in a row. Default: a number with its unit, or the text itself.
    number
        Number in frames if it is neither the value nor the text, in the same unit.
    """

    value: Callable[[R], Any]
    key: str = ""
    heading: str = ""
    unit: str = ""
    text: Callable[[R], str] | None = None
    number: Callable[[R], float] | None = None

    def cell(self, row: R) -> Cell:
        """Return the cell of a row."""
        if not self.unit:
            text = str(self.value(row) or "") if self.text is None else self.text(row)
            return Cell(clean(text) or "-")
        number = (self.number or self.value)(row)
        if self.text is None:
            return amount_cell(number, self.unit)
        return Cell(clean(self.text(row)), "none", number, self.unit)


def record_table(rows: Iterable[R], columns: Sequence[Quantity[R]]) -> Table:
    """Return the table of rows, with the columns of those quantities that have a heading."""
    shown = [each for each in columns if each.heading]
    cells = tuple(tuple(each.cell(row) for each in shown) for row in rows)
    return Table(tuple(Column(each.heading) for each in shown), cells)


def record_data(row: R, quantities: Iterable[Quantity[R]]) -> dict[str, Any]:
    """Return the JSON object of a row."""
    return {each.key: each.value(row) for each in quantities if each.key}


# --- The campaign

_CLASSES = ((0.99, "high"), (0.90, "medium"), (0.60, "low"))
"""diagnostic coverage: ISO 26262-5:2018, annex D"""
_COLUMNS = (
    "fault",
    "off the healthy run",
    "violates",
    "within",
    "seen within",
    "first by",
    "class",
    "severity",
    "with reaction",
)

_SHORT = ("fault", "class", "severity", "violates", "within", "seen within", "with reaction")
"""columns of a terminal"""
_RANK = ("undetected", "too late", "covered", "latent", "harmless, seen")
"""classes of faults, the most dangerous first"""
_MEANING = (
    "Undetected, too late and covered faults violate a criterion (8/8: in 8 of 8 runs). Covered "
    "faults are detected in time in every such run. Latent faults are harmless in this maneuver, "
    "but not always detected."
)
_MOST = 12
_NOTHING = 1e-4  # fraction of the maximum deviation below which a table shows no number


@dataclass(frozen=True, repr=False)
class FaultCampaign(Answer):
    """Results of a campaign of faults.

    Parameters
    ----------
    findings
        Effect, fault-tolerant time and time to detection of every fault; times in s.
    folder
        Folder of the outcomes. None if they are not saved.
    nominal
        Result of the bench without faults, or None.
    """

    findings: CampaignFindings
    folder: Path | None = None
    nominal: Result | None = None

    def __repr__(self) -> str:
        plan = self.findings.plan
        return f"<FaultCampaign {plan.name}: {len(plan.faults)} faults, {plan.total} runs>"

    @property
    def key_figures(self) -> list[FigureAt]:
        """Coverage and false alarms, and the times of each dangerous fault."""
        findings = self.findings
        alarms, coverage = findings.false_alarms, findings.coverage_of_cases
        missed = sum(each.kind in _RANK[:2] for each in findings.faults)
        figures = [
            FigureAt(_of_share("coverage", findings.coverage, coverage)),
            FigureAt(_of_share("false_alarms", alarms.value, alarms)),
            FigureAt(
                Kpi("missed_faults", float(missed), "1", CAMPAIGN_FIGURES["missed_faults"][1])
            ),
        ]
        for fault in findings.faults:
            if not fault.dangerous:
                continue
            seen = math.inf if np.isnan(fault.seen).any() else _latest(fault.seen)
            for name, value in (("fault_tolerant_time", fault.tolerance), ("detection_time", seen)):
                kpi = Kpi(name, value, *CAMPAIGN_FIGURES[name])
                figures.append(FigureAt(kpi, f"fault {_name(fault)}"))
        return figures

    @property
    def outcome(self) -> Outcome:
        """``met`` if every dangerous fault is detected in time and the reaction does no harm."""
        findings = self.findings
        is_missed = any(each.kind in _RANK[:2] for each in findings.faults)
        return "missed" if is_missed or findings.harm_of_reaction() else "met"

    @property
    def warnings(self) -> list[str]:
        """Harm done by the reaction, and warnings of the fault-free run and the solver."""
        healthy = [] if self.nominal is None else self.nominal.warnings
        return [
            *self.findings.harm_of_reaction(),
            *self.findings.plan.bench.outdated,
            *(f"fault-free run: {text}" for text in healthy),
            *self.findings.doubts,
        ]

    @property
    def notes(self) -> list[str]:
        """Meaning of the figures."""
        plan, findings = self.findings.plan, self.findings
        alarms, cases = findings.false_alarms, findings.coverage_of_cases
        weight = "failure rates of [rates]" if findings.is_weighted else "unweighted"
        notes = [
            f"thresholds were tuned on {plan.tuning} fault-free runs. Alarms and faults were "
            f"evaluated on {plan.healthy - plan.tuning} other fault-free runs, of which "
            f"{alarms.count} raise an alarm (95 % confidence interval: {100 * alarms.low:.2g} to "
            f"{100 * alarms.high:.2g} %)",
            "coverage is the fraction of dangerous runs in which a monitor detects the fault "
            f"within its fault-tolerant time ({weight}). Monitors detect it in time in "
            f"{cases.count} of {cases.cases} runs (95 % confidence interval: "
            f"{100 * cases.low:.3g} to {100 * cases.high:.3g} %)",
        ]
        if plan.bench.choice is not None:
            notes += [
                *choice_texts(plan.bench),
                "the stated error applies to the key figures of fault-free runs, not to the times "
                "and effects of faults",
            ]
        if not plan.varied:
            notes.append(
                "nothing varies, so thresholds come from a single fault-free run. Add a [vary] "
                "section"
            )
        if plan.reaction is not None:
            notes.append(
                f"the reaction, {plan.reaction.failing.name} {amount(plan.reaction.delay, 's', 3)} "
                "after detection, is simulated for each fault that permits it"
            )
            notes.append(findings.benefit_of_reaction())
        return notes

    def document(self) -> Document:
        """Return the table of faults, coverage, fault-tolerant times and detection times."""
        plan, bench, findings = self.findings.plan, self.findings.plan.bench, self.findings
        subject = Subject.of_bench(bench, plan.name, varied=[each.name for each in plan.varied])
        table = TableBlock(self._table())
        residuals = TableBlock(self._residual_table())
        uncovered = sum(f.kind in _RANK[:2] for f in findings.faults)
        counts = findings.kinds()
        order = sorted(counts, key=lambda kind: _RANK.index(kind) if kind in _RANK else len(_RANK))
        kinds = ", ".join(f"{counts[kind]} {kind}" for kind in order)
        first = f"{len(plan.faults)} faults: {kinds}"
        known = Listing([kinds, *varied_texts(plan.varied), *self.notes])
        return Document(
            f"Faults: {plan.name}",
            f"{len(plan.faults)} faults, {plan.total} simulated runs of {subject.line}",
            sections=lambda: [
                Section(
                    "Faults",
                    [
                        Paragraph(f"{first}. The most dangerous are listed first. {_MEANING}"),
                        table,
                    ],
                ),
                Section("Notes", [known]),
                Section("Figures", self._figures()),
                Section("Residuals", [residuals]),
                Section("Criteria", [TableBlock(self._criteria_table())]),
                subject.provenance("" if self.folder is None else f"Outcomes: {self.folder}."),
            ],
            brief=[
                f"{first}{self._worst_fault()}",
                "",
                TableBlock(self._worst_first(), most=max(_MOST, uncovered)),
                Details("", [table, residuals, known]),
            ],
            data=self._data(),
            banner=self._banner(),
            record="report.json",
            changes=subject.changes,
            headline=_sentences(self.findings.harm_of_reaction()),
        )

    def _banner(self) -> Banner:
        coverage, harm = self.findings.coverage, self.findings.harm_of_reaction()
        if math.isnan(coverage):
            texts = ["no fault is dangerous in this maneuver"]
        else:
            faults = self.findings.faults
            missed = sum(each.kind in _RANK[:2] for each in faults)
            texts = [
                f"{missed} of {sum(each.dangerous > 0 for each in faults)} dangerous faults are "
                "undetected or detected too late",
                f"diagnostic coverage {100 * coverage:.3g} % ({_coverage_class(coverage)})",
            ]
        return Banner(_sentences([*texts, *harm]), "bad" if harm else "none")

    @cached_property
    def _quantities(self) -> dict[str, Quantity[FaultFinding]]:
        """Quantities of a fault, by heading or key, in the order of the JSON object."""
        plan = self.findings.plan
        is_rated = any(criterion.severity for criterion in plan.criteria)
        every: list[Quantity[FaultFinding]] = [
            Quantity(lambda f: f.failing.mode.name, "fault", "fault", text=_name),
            Quantity(lambda f: f.failing.mode.summary, "summary"),
            Quantity(lambda f: f.failing.value if f.failing.mode.unit else None, "value"),
            Quantity(lambda f: f.failing.mode.unit, "unit"),
            Quantity(lambda f: f.failing.is_present, "present"),
            Quantity(lambda f: f.failing.latent and f.failing.latent.mode.name, "after"),
            Quantity(lambda f: f.kind, "class", "class"),
            Quantity(lambda f: f.severity(plan), "severity", "severity" if is_rated else ""),
            Quantity(lambda f: f.cases, "runs"),
            Quantity(lambda f: f.criteria, "violated", "violates", text=_violated),
            Quantity(
                lambda f: f.tolerance,
                "tolerated_for",
                "within",
                "s",
                lambda f: _time(f.tolerance),
            ),
            Quantity(lambda f: f.violated.tolist(), "violated_after"),
            Quantity(
                lambda f: f.seen.tolist(),
                "seen_after",
                "seen within",
                "s",
                lambda f: _worst(f.seen),
                lambda f: _latest(f.seen),
            ),
            Quantity(lambda f: f.first_seen_by, "first_by", "first by"),
            Quantity(
                _with_reaction,
                "with_reaction",
                "with reaction" if plan.reaction else "",
                text=_reacted,
            ),
            Quantity(_extremes, "extremes", "off the healthy run", text=self._off_healthy),
        ]
        return {each.heading or each.key: each for each in every}

    def _table(self) -> Table:
        columns = [self._quantities[name] for name in _COLUMNS if name in self._quantities]
        return record_table(self._ranked, columns)

    @cached_property
    def _ranked(self) -> list[FaultFinding]:
        """Faults, the most dangerous first."""
        return sorted(
            self.findings.faults,
            key=lambda f: (_RANK.index(f.kind), f.tolerance if f.dangerous else math.inf),
        )

    def _worst_fault(self) -> str:
        """Return the most dangerous fault that no monitor detects in time, if there is one."""
        worst = self._ranked[0] if self._ranked else None
        if worst is None or worst.kind not in _RANK[:2]:
            return ""
        return f". The worst is {_name(worst)}, {worst.kind}, {_violated(worst)}"

    def _worst_first(self) -> Table:
        """Return the table for a terminal."""
        columns = [self._quantities[name] for name in _SHORT if name in self._quantities]
        return record_table(self._ranked, columns)

    def _off_healthy(self, each: FaultFinding) -> str:
        signals = signals_of(self.findings.plan.case(0).model.Output)
        return "; ".join(
            f"{name} {_range(low, high, signals[name].unit)}"
            for name, (low, high, _) in each.extremes.items()
        )

    def _residual_table(self) -> Table:
        findings = self.findings
        dangerous = sum(each.dangerous for each in findings.faults)
        rows = []
        for residual in findings.plan.watched:
            _, alarms, delay, seen = findings.curve(residual.name)[_at_threshold()]
            limit = findings.healthy.thresholds[residual.name]
            rows.append(
                [
                    residual.name,
                    residual.summary,
                    "never checked" if limit <= NEVER else amount_cell(limit, residual.unit, 3),
                    Cell(str(alarms), value=alarms, unit="1"),
                    Cell(f"{seen} of {dangerous}", value=seen, unit="1"),
                    Cell(amount(delay, "s", 3), value=delay, unit="s"),
                ]
            )
        heads = ["residual", "compares", "threshold", "false alarms", "sees", "median delay"]
        return text_table(heads, rows)

    def _criteria_table(self) -> Table:
        plan = self.findings.plan
        signals = signals_of(plan.case(0).model.Output)
        rows = []
        for c in plan.criteria:
            unit = "1" if c.sense == "below_share" else signals[c.signal].unit
            rows.append(
                [
                    c.name,
                    c.signal,
                    c.sense.replace("_", " "),
                    amount_cell(c.level, unit),
                    amount_cell(c.lasting, "s"),
                    c.severity or "-",
                ]
            )
        return text_table(["criterion", "signal", "sense", "level", "lasting", "severity"], rows)

    def _figures(self) -> list[FigureBlock]:
        from bywire.report.fault_times import FaultTimes, alarm_curves, fault_times

        findings, plan = self.findings, self.findings.plan
        dangerous = [each for each in findings.faults if each.dangerous]
        if not dangerous:
            return []

        def times() -> Figure:
            return fault_times([FaultTimes(_name(f), f.violated, f.seen) for f in dangerous])

        def curves() -> Figure:
            rows = {r.name: findings.curve(r.name) for r in plan.watched}
            return alarm_curves(rows, plan.healthy - plan.tuning)

        return [
            FigureBlock(
                times,
                "Dangerous faults: time from the fault's onset until a criterion is violated, and "
                "until a residual detects the fault, for each run.",
                "fault-times",
            ),
            FigureBlock(
                curves,
                "Median detection delay in dangerous runs versus the number of fault-free runs "
                "with an alarm, for multiples of each threshold. Rings mark the thresholds in use.",
                "alarm-curves",
            ),
        ]

    def _data(self) -> dict[str, Any]:
        findings, plan = self.findings, self.findings.plan
        alarms, cases = findings.false_alarms, findings.coverage_of_cases
        return {
            "campaign": plan.name,
            "folder": None if self.folder is None else str(self.folder),
            "runs": plan.total,
            "coverage": findings.coverage,
            "coverage_class": _coverage_class(findings.coverage),
            "weighted": findings.is_weighted,
            "dangerous_runs": cases.cases,
            "seen_in_time": cases.count,
            "false_alarms": {
                "runs": alarms.count,
                "of": alarms.cases,
                "low": alarms.low,
                "high": alarms.high,
            },
            "thresholds": dict(findings.healthy.thresholds),
            "faults": [record_data(each, self._quantities.values()) for each in findings.faults],
            "warnings": self.warnings,
            **choice_data(findings.plan.bench),
            "notes": self.notes,
        }


CAMPAIGN_FIGURES: Mapping[str, tuple[str, str]] = {
    "coverage": ("1", "Fraction of dangerous runs that a monitor detects in time."),
    "false_alarms": ("1", "Fraction of fault-free runs with an alarm."),
    "missed_faults": ("1", "Number of dangerous faults that are detected too late or not at all."),
    "fault_tolerant_time": ("s", "Time from a fault's onset until it violates a criterion."),
    "detection_time": ("s", "Time from a fault's onset until a monitor detects it."),
}
"""unit and definition of the figures that requirements can limit, by name"""


def _of_share(name: str, value: float, counted: Share) -> Kpi:
    """Return a fraction of runs with half of its confidence interval as its error."""
    if math.isnan(value):
        note = "no fault is dangerous in this maneuver"
        return Kpi(name, value, *CAMPAIGN_FIGURES[name], note, is_open=True)
    error = max(counted.high - value, value - counted.low)
    return Kpi(name, value, *CAMPAIGN_FIGURES[name], error=error)


def _sentences(texts: Sequence[str]) -> str:
    """Return texts as sentences."""
    return " ".join(f"{text[:1].upper()}{text[1:]}." for text in texts)


def _coverage_class(coverage: float) -> str:
    """Return the class of a diagnostic coverage.

    Examples
    --------
    >>> _coverage_class(0.993), _coverage_class(0.61), _coverage_class(0.2)
    ('high', 'low', 'none')
    """
    return next((name for least, name in _CLASSES if coverage >= least), "none")


def _name(each: FaultFinding) -> str:
    mode, value = each.failing.mode, each.failing.value
    size = f" {amount(value, mode.unit)}" if mode.unit else ""
    beside = f" after {each.failing.latent.mode.name}" if each.failing.latent else ""
    start = " (present from the start)" if each.failing.is_present else ""
    return f"{mode.name}{size}{beside}{start}"


def _violated(each: FaultFinding) -> str:
    return ", ".join(f"{name} ({n}/{each.cases})" for name, n in each.criteria.items())


def _extremes(each: FaultFinding) -> dict[str, dict[str, float]]:
    return {
        name: {"least": float(low.min()), "largest": float(high.max()), "end": float(end.mean())}
        for name, (low, high, end) in each.extremes.items()
    }


def _with_reaction(each: FaultFinding) -> dict[str, Any] | None:
    if not each.reacted:
        return None
    return {
        "runs": len(each.answered),
        "violated_after": {name: times.tolist() for name, times in each.reacted.items()},
        "violated_only_with_it": each.only_with_reaction,
        "violated_sooner_with_it": each.sooner_with_reaction,
    }


def _reacted(each: FaultFinding) -> str:
    """Return the criteria that are violated despite the reaction."""
    if not each.reacted:
        return "-"
    counts = {name: (int(np.sum(~np.isnan(t))), t.size) for name, t in each.reacted.items()}
    said = [f"{name} ({n}/{m})" for name, (n, m) in counts.items() if n]
    worse = "worse: " if each.only_with_reaction else ""
    return worse + ", ".join(said) if said else "nothing"


def _at_threshold() -> int:
    from bywire.campaigns.judging import FACTORS

    return FACTORS.index(1.0)


def _range(low: Array, high: Array, unit: str) -> str:
    """Return the range of deviations over all runs."""
    lowest, highest = float(low.min()), float(high.max())
    largest = max(abs(lowest), abs(highest))
    of = difference_unit(unit)
    ends = [each if abs(each) > _NOTHING * largest else 0.0 for each in (lowest, highest)]
    first, last = (amount(each, of, 3, like=largest) for each in ends)
    return f"{first.split()[0]} to {last}"


def _time(time: float) -> str:
    return "-" if math.isnan(time) else amount(time, "s", 3)


def _latest(times: Array) -> float:
    """Return the latest time [s], or NaN if there is none."""
    return float(np.nanmax(times, initial=-math.inf)) if not np.isnan(times).all() else math.nan


def _worst(times: Array) -> str:
    """Return the latest time, and the number of runs without one."""
    never = int(np.isnan(times).sum())
    if never == times.size:
        return "never"
    text = _time(_latest(times))
    return f"{text}, {never} never" if never else text
