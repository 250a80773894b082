"""A campaign of faults, run and judged: what each one does, when it is seen, what is covered."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.api.study_tested import varied_texts
from bywire.bench.running import Progress
from bywire.campaigns.campaign_file import read_campaign
from bywire.campaigns.findings import CampaignFindings, FaultFinding
from bywire.campaigns.residual import NEVER
from bywire.campaigns.running import CampaignStore, complete
from bywire.core.quantities import display_unit
from bywire.core.signals import signals_of
from bywire.core.typing import Array, silent
from bywire.core.units import difference_unit, display_factor
from bywire.report.answer import Answer, use_case
from bywire.report.document import Banner, Document, FigureBlock, Listing, Section, TableBlock
from bywire.report.subject import Subject
from bywire.report.tables import Table, text_table
from bywire.report.wording import amount

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CLASSES = ((0.99, "high"), (0.90, "medium"), (0.60, "low"))
"""diagnostic coverage: ISO 26262-5:2018, annex D"""


@dataclass(frozen=True, repr=False)
class FaultCampaign(Answer):
    """What a campaign of faults found.

    Parameters
    ----------
    findings
        Of every fault: what it does, when it is too much, when it is seen; times in s.
    folder
        Where its outcomes lie; None where they are not kept.
    """

    findings: CampaignFindings
    folder: Path | None = None

    def __repr__(self) -> str:
        plan = self.findings.plan
        return f"<FaultCampaign {plan.name}: {len(plan.faults)} faults, {plan.total} runs>"

    @property
    def warnings(self) -> list[str]:
        """What the reaction makes worse."""
        return list(self.findings.harm_of_reaction())

    @property
    def notes(self) -> list[str]:
        """What the figures stand for."""
        plan, findings = self.findings.plan, self.findings
        alarms, cases = findings.false_alarms, findings.coverage_of_cases
        weight = "failure rates of [rates]" if findings.is_weighted else "unweighted"
        said = [
            f"thresholds were tuned on {plan.tuning} healthy runs, alarms and faults judged on "
            f"{plan.healthy - plan.tuning} others: {alarms.count} of these alarm "
            f"({100 * alarms.low:.2g} to {100 * alarms.high:.2g} %)",
            f"coverage is the share of dangerous runs in which a fault is seen before its fault "
            f"tolerant time is over, that of its worst run ({weight}); of {cases.cases} runs "
            f"{cases.count} are ({100 * cases.low:.3g} to {100 * cases.high:.3g} %)",
        ]
        if not plan.varied:
            said.append("nothing varies: thresholds of one healthy run say little, give [vary]")
        if plan.reaction is not None:
            said.append(
                f"the reaction, {plan.reaction.failing.name} {_milliseconds(plan.reaction.delay)} "
                "after a fault is seen, is put in where the fault leaves it possible"
            )
            said.append(findings.benefit_of_reaction())
        return said

    def document(self) -> Document:
        """Return the table of faults, coverage, and when each is too much and seen."""
        plan, bench, findings = self.findings.plan, self.findings.plan.bench, self.findings
        subject = Subject.of_bench(bench, plan.name, varied=[each.name for each in plan.varied])
        table = TableBlock(self._table(), width=0)
        residuals = TableBlock(self._residual_table(), width=120)
        kinds = ", ".join(f"{n} {kind}" for kind, n in findings.kinds().most_common())
        known = Listing([kinds, *varied_texts(plan.varied), *self.notes])
        return Document(
            f"Faults: {plan.name}",
            f"{len(plan.faults)} faults, {plan.total} runs of {subject.line}",
            sections=lambda: [
                Section("Faults", [table]),
                Section("What else to know", [known]),
                Section("Figures", self._figures()),
                Section("Residuals", [residuals]),
                Section("Criteria", [TableBlock(self._criteria_table())]),
                subject.provenance("" if self.folder is None else f"Outcomes: {self.folder}."),
            ],
            brief=[table, "", residuals, "", known],
            data=self._data(),
            banner=self._banner(),
            record="report.json",
            changes=subject.changes,
            headline=_sentences(self.warnings),
        )

    def _banner(self) -> Banner:
        coverage, harm = self.findings.coverage, self.warnings
        text = (
            "no fault is dangerous in this maneuver"
            if math.isnan(coverage)
            else f"diagnostic coverage {100 * coverage:.3g} % ({coverage_class(coverage)})"
        )
        return Banner(_sentences([*harm, text]) if harm else text, "bad" if harm else "none")

    def _table(self) -> Table:
        plan = self.findings.plan
        signals = signals_of(plan.case(0).model.Output)
        heads = [
            "fault",
            "off the healthy run",
            "violates",
            "within",
            "seen within",
            "first by",
            "class",
            *self._further,
        ]
        rows = []
        for each in self.findings.faults:
            effects = [
                f"{name} {_range(sides[0], sides[1], signals[name].unit)}"
                for name, sides in each.extremes.items()
            ]
            violated = ", ".join(f"{name} ({n}/{each.cases})" for name, n in each.criteria.items())
            further = {"severity": each.severity(plan) or "-", "with reaction": self._reacted(each)}
            rows.append(
                [
                    self._name(each),
                    "; ".join(effects),
                    violated or "-",
                    _milliseconds(each.tolerance),
                    _worst(each.seen),
                    each.first_seen_by or "-",
                    each.kind,
                    *(further[name] for name in self._further),
                ]
            )
        return text_table(heads, rows)

    @property
    def _further(self) -> list[str]:
        """Columns that not every campaign has."""
        plan = self.findings.plan
        rated = any(criterion.severity for criterion in plan.criteria)
        return [*(["severity"] if rated else []), *(["with reaction"] if plan.reaction else [])]

    def _name(self, each: FaultFinding) -> str:
        mode, value = each.failing.mode, each.failing.value
        size = f" {amount(value, mode.unit)}" if mode.unit else ""
        beside = f" after {each.failing.latent.mode.name}" if each.failing.latent else ""
        start = " (there from the start)" if each.failing.is_present else ""
        return f"{mode.name}{size}{beside}{start}"

    def _reacted(self, each: FaultFinding) -> str:
        """Return what is still violated where the fault is answered."""
        if not each.reacted:
            return "-"
        counts = {name: (int(np.sum(~np.isnan(t))), t.size) for name, t in each.reacted.items()}
        said = [f"{name} ({n}/{m})" for name, (n, m) in counts.items() if n]
        worse = "worse: " if each.only_with_reaction else ""
        return worse + ", ".join(said) if said else "nothing"

    def _residual_table(self) -> Table:
        findings = self.findings
        dangerous = sum(each.dangerous for each in findings.faults)
        rows = []
        for residual in findings.plan.watched:
            _, alarms, delay, seen = findings.curve(residual.name)[_at_threshold()]
            limit = findings.healthy.thresholds[residual.name]
            said = "never looked at" if limit <= NEVER else amount(limit, residual.unit, 3)
            rows.append(
                [
                    residual.name,
                    residual.summary,
                    said,
                    str(alarms),
                    f"{seen} of {dangerous}",
                    _milliseconds(delay),
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
                    amount(c.level, unit),
                    amount(c.lasting, "s"),
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
            return fault_times([FaultTimes(self._name(f), f.violated, f.seen) for f in dangerous])

        def curves() -> Figure:
            rows = {r.name: findings.curve(r.name) for r in plan.watched}
            return alarm_curves(rows, plan.healthy - plan.tuning)

        return [
            FigureBlock(
                times,
                "Dangerous faults: time from onset until a criterion is violated, "
                "and until a residual sees it, of every run.",
                "fault-times",
            ),
            FigureBlock(
                curves,
                "Median delay of detection in dangerous runs over healthy runs "
                "that alarm, for multiples of each threshold; rings are those in use.",
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
            "coverage_class": coverage_class(findings.coverage),
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
            "faults": [self._fault_data(each) for each in findings.faults],
            "warnings": self.warnings,
            "notes": self.notes,
        }

    def _fault_data(self, each: FaultFinding) -> dict[str, Any]:
        return {
            "fault": each.failing.mode.name,
            "summary": each.failing.mode.summary,
            "value": each.failing.value if each.failing.mode.unit else None,
            "unit": each.failing.mode.unit,
            "present": each.failing.is_present,
            "after": each.failing.latent.mode.name if each.failing.latent else None,
            "class": each.kind,
            "severity": each.severity(self.findings.plan),
            "runs": each.cases,
            "violated": each.criteria,
            "tolerated_for": each.tolerance,
            "violated_after": each.violated.tolist(),
            "seen_after": each.seen.tolist(),
            "first_by": each.first_seen_by,
            "with_reaction": None
            if not each.reacted
            else {
                "runs": len(each.answered),
                "violated_after": {n: times.tolist() for n, times in each.reacted.items()},
                "violated_only_with_it": each.only_with_reaction,
                "violated_sooner_with_it": each.sooner_with_reaction,
            },
            "extremes": {
                name: {
                    "least": float(sides[0].min()),
                    "largest": float(sides[1].max()),
                    "end": float(sides[2].mean()),
                }
                for name, sides in each.extremes.items()
            },
        }


@use_case
def run_faults(
    campaign: str | Path,
    out: str | Path | None = None,
    overrides: Mapping[str, str] = MappingProxyType({}),
    *,
    progress: Progress | None = None,
) -> FaultCampaign:
    """Run a campaign: every fault of a brake in a maneuver, at several onsets.

    Parameters
    ----------
    campaign
        Campaign file, see ``docs/faults.md``; or the name of one that comes with a brake.
    out
        Folder in which outcomes are kept, so that the same call goes on after an interrupt;
        nothing is kept by default.
    overrides
        Changes of the bench, as texts with units.
    progress
        Called with a label and the finished share, 0 to 1.

    Returns
    -------
    FaultCampaign
        Of every fault its effect, fault tolerant time, time to detection [s] and class;
        diagnostic coverage, false alarms.

    Raises
    ------
    InputError
        For a campaign that does not fit, and a folder that holds another one.
    RunError
        When a run fails.
    KeyboardInterrupt
        When interrupted; finished faults stay in the folder.
    """
    plan = read_campaign(campaign, overrides)
    store = CampaignStore(None if out is None else Path(out))
    try:
        return FaultCampaign(complete(plan, store, progress or silent), store.folder)
    except KeyboardInterrupt:
        if store.folder is None:
            raise
        kept = sum(store.kept(number) is not None for number in range(len(plan.faults)))
        raise KeyboardInterrupt(
            f"{kept} of {len(plan.faults)} faults are kept: the same command goes on"
        ) from None


def _sentences(texts: Sequence[str]) -> str:
    """Return texts as sentences."""
    return " ".join(f"{text[:1].upper()}{text[1:]}." for text in texts)


def coverage_class(coverage: float) -> str:
    """Return the class of a diagnostic coverage.

    Examples
    --------
    >>> coverage_class(0.993), coverage_class(0.61), coverage_class(0.2)
    ('high', 'low', 'none')
    """
    return next((name for least, name in _CLASSES if coverage >= least), "none")


def _at_threshold() -> int:
    from bywire.campaigns.judging import FACTORS

    return FACTORS.index(1.0)


def _range(low: Array, high: Array, unit: str) -> str:
    """Return how far runs come off, least and largest of all."""
    scale, shown = display_factor(unit), display_unit(difference_unit(unit))
    text = f"{scale * low.min():.3g} to {scale * high.max():.3g}"
    return text if unit == "1" else f"{text} {shown}"


def _milliseconds(time: float) -> str:
    if math.isnan(time):
        return "-"
    return f"{time:.3g} s" if time >= 1.0 else f"{1e3 * time:.3g} ms"


def _worst(times: Array) -> str:
    """Return the latest time, and in how many runs there is none."""
    seen = times[~np.isnan(times)]
    if not seen.size:
        return "never"
    text = _milliseconds(float(seen.max()))
    return text if seen.size == times.size else f"{text}, {times.size - seen.size} never"
