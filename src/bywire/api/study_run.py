"""Results, verdicts and worst cases of a study with many cases.

A study of rare failures has most probable failing cases instead of worst cases.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.api.run_sections import (
    choice_data,
    tested_brief,
    tested_data,
    tested_line,
    tested_section,
)
from bywire.api.study_figures import load_drawing, study_figures
from bywire.api.study_tables import (
    correlated,
    demand_table,
    drivers_data,
    effect_tables,
    failure_table,
    figure_text,
    importance_tables,
    influence_tables,
    missing_indices,
    rare_data,
    rare_notes,
    search_notes,
    sensitivity_tables,
    shown_figures,
    spread_blocks,
    state_texts,
    unmoved,
    varied_table,
)
from bywire.bench import running
from bywire.bench.bench import Bench
from bywire.bench.bench_file import bench_text
from bywire.bench.requirements import status_of
from bywire.bench.running import Result
from bywire.core.brake import loaded_files
from bywire.core.callers import is_command_line
from bywire.core.errors import FileError, InputError, ParameterError, unknown_name
from bywire.core.parameters import field_notes
from bywire.core.typing import Progress, silent
from bywire.core.units import shown
from bywire.report.answer import Answer, Outcome
from bywire.report.document import (
    Attachment,
    Banner,
    Block,
    Document,
    Listing,
    Section,
    TableBlock,
    recording_file,
    spaced,
)
from bywire.report.subject import Subject
from bywire.report.wording import amount
from bywire.studies.designs import SPANNED, WORST
from bywire.studies.findings import Findings, Judgment
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.running import complete
from bywire.studies.sensitivity import VarianceShares
from bywire.studies.sought_cases import rare_failures, worst_cases
from bywire.studies.stated_error import ErrorCheck, error_check, with_step
from bywire.studies.statistics import Spread
from bywire.studies.store import Origin, StudyStore, case_bench
from bywire.studies.stored_cases import BLOCK, stored_cases
from bywire.studies.study_file import read_study

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr


@dataclass(frozen=True)
class ShownCases:
    """Worst case, or most probable failing case, of each requirement.

    Parameters
    ----------
    findings
        The study's cases with their verdicts.
    nominal
        Result of the nominal bench.
    """

    findings: Findings
    nominal: Result

    @property
    def kind(self) -> str:
        """Word for each case, which is also part of file names."""
        return "failing" if self.findings.rare else "worst"

    @property
    def title(self) -> str:
        """Heading of the cases."""
        return "Most probable failing cases" if self.findings.rare else "Worst cases"

    @cached_property
    def benches(self) -> Mapping[str, Bench]:
        """Bench of each case that has a result, by its key figure."""
        return {
            j.demand.figure: self._bench(j, row)
            for j in self.findings.judgments
            if (row := j.worst) is not None and self.findings.has_result(row)
        }

    @cached_property
    def results(self) -> Mapping[str, Result]:
        """Result of each case when rerun, by its key figure."""
        return {kpi: running.run(bench) for kpi, bench in self.benches.items()}

    def texts(self) -> list[str]:
        """Return a line about each case."""
        return [
            self._text(each, each.worst)
            for each in self.findings.judgments
            if each.worst is not None
        ]

    def _text(self, judgment: Judgment, row: int) -> str:
        kpi = judgment.demand.figure
        if not self.findings.has_result(row):
            return f"{kpi}: case {self.named(row)} has no result"
        if not math.isfinite(float(self.findings.row(row)[kpi])):
            (why,) = [each.note for each in self.results[kpi].kpis if each.name == kpi]
            return (
                f"{kpi} is not defined in case {self.named(row)}{why and f': {why}'}; "
                f"{self.kind}-{kpi}.toml runs it"
            )
        return (
            f"{kpi} = {self._figure(kpi, row)}{self._doubt(judgment, row)} in case "
            f"{self.named(row)}; {self.kind}-{kpi}.toml runs it"
        )

    def named(self, row: int) -> str:
        """Return a case's number and values, by its row."""
        units = self.findings.plan.units
        values = ", ".join(
            f"{name} = {value if isinstance(value, str) else amount(value, units[name])}"
            for name, value in self.findings.values(row).items()
        )
        return f"{self.findings.number(row)} ({values})"

    def recordings(self) -> dict[str, dict[str, xr.Dataset]]:
        """Return the recordings of the bench itself and of the cases, by run."""
        each = {"the bench itself": self.nominal} | {
            f"{self.kind} {kpi}": result for kpi, result in self.results.items()
        }
        return {
            label: {name: r.recordings[label] for name, r in each.items() if label in r.recordings}
            for label in self.nominal.recordings
        }

    def attachments(self) -> list[Attachment]:
        """Return bench files and recordings."""
        labels = list(self.nominal.recordings)
        return [
            *(
                Attachment(f"{self.kind}-{kpi}.toml", partial(self._write_bench, bench))
                for kpi, bench in self.benches.items()
            ),
            *(
                Attachment(
                    f"{self.kind}-{kpi}{'' if len(labels) == 1 else '-' + label}.nc",
                    partial(self._write_recording, kpi, label),
                )
                for kpi in self.benches
                for label in labels
            ),
        ]

    def _bench(self, judgment: Judgment, row: int) -> Bench:
        plan, findings = self.findings.plan, self.findings
        made = case_bench(plan, findings.number(row), findings.values(row))
        return replace(made, name=f"{self.kind} {judgment.demand.figure}")

    def _doubt(self, judgment: Judgment, row: int) -> str:
        """Return a remark if a case is too close to the limit to decide it."""
        is_close = self.findings.is_close(judgment.demand, row)
        return " (closer to the limit than its numerical error)" if is_close else ""

    def _figure(self, name: str, row: int) -> str:
        return figure_text(self.findings, name, float(self.findings.row(row)[name]))

    def _write_bench(self, bench: Bench, path: Path) -> Path:
        what = "Most probable failing" if self.findings.rare else "Worst"
        text = bench_text(bench, f"{what} case of study {self.findings.plan.name}")
        path.write_text(text, "utf-8")
        return path

    def _write_recording(self, kpi: str, label: str, path: Path) -> Path:
        return recording_file(path.name, self.results[kpi].recordings[label]).write(path)


# --- The answer


def findings_data(findings: Findings) -> dict[str, Any]:
    """Return design, cases, requirements and key figures, with values in the figures' units."""
    plan = findings.plan
    count = findings.count
    return {
        "design": plan.design,
        "seed": plan.seed,
        "cases": count,
        "of": plan.total * (len(plan.judged_demands) if plan.sought else 1),
        "confidence": plan.confidence,
        "failed": findings.failed,
        "reasons": [
            {"why": each.text, "cases": each.cases, "first": findings.number(each.row)}
            for each in findings.reasons
        ],
        "requirements": [
            _judgment_data(findings, each) for each in (findings.judgments if count else ())
        ],
        "kpis": {
            each.name: {
                "unit": each.unit,
                "nominal": each.nominal,
                "least": each.least,
                "largest": each.largest,
                "undefined": each.undefined,
                **(_spread_data(each) if plan.is_sampled else {}),
                **drivers_data(findings, each.name),
            }
            for each in findings.spreads
        },
    }


def _judgment_data(findings: Findings, judgment: Judgment) -> dict[str, Any]:
    """Return a requirement, without a probability if the cases are not random."""
    demand, share = judgment.demand, judgment.share
    probability = {"probability": share.value, "low": share.low, "high": share.high}
    rare = {}
    if judgment.failure is not None:
        (of,) = [each for each in findings.rare if each.demand == demand]
        rare = rare_data(judgment.failure, of)
    return rare | {
        "kpi": demand.figure,
        "limit": demand.text,
        "wanted": demand.probability,
        "outcome": judgment.outcome,
        "met": share.count,
        **(probability if findings.plan.is_sampled else {}),
        "undecided_cases": judgment.undecided,
        "worst_case": None if judgment.worst is None else findings.number(judgment.worst),
    }


def _spread_data(spread: Spread) -> dict[str, Any]:
    """Return mean and quantiles of random cases."""
    return {
        "mean": spread.mean,
        "sd": spread.sd,
        "quantiles": [
            {"probability": q.probability, "value": q.value, "low": q.low, "high": q.high}
            for q in spread.quantiles
        ],
    }


# --- Warnings and notes

_REASONS = 10  # maximum number of listed reasons
_WIDE = 0.15  # half width above which the interval of a variance share is too wide


def warned(findings: Findings, of_the_bench: list[str]) -> list[str]:
    """Return warnings about runs, undecided rare failures, and cases without a result."""
    count = findings.count
    texts = [f"{text} ({cases} of {count} cases)" for text, cases in findings.warnings.items()]
    texts += of_the_bench if not texts else []
    if failed := findings.failed:
        texts.append(
            f"{failed} of {count} cases have no result. They are treated as failing every "
            "requirement"
        )
    if findings.spreads:
        texts += _undefined(findings)
    elif count and not failed:
        texts.append("no key figure is defined in any case. Check the bench with 'bywire run'")
    return texts + (state_texts(findings) if findings.rare and count else [])


def _undefined(findings: Findings) -> list[str]:
    """Return the figures of requirements that are not defined in some cases."""
    cases: dict[int, list[str]] = {}
    for each in findings.judgments:
        if each.lacking:
            cases.setdefault(each.lacking, []).append(each.demand.figure)
    return [
        f"{', '.join(names)}: not defined in {number} of {findings.count} cases, which "
        "therefore fail the requirement"
        for number, names in cases.items()
    ]


def unfinished(plan: StudyPlan, cases: int, resume: str) -> str:
    """Return a text on missing cases, with the command that computes them."""
    if plan.sought is not None:
        return f"not all cases are computed yet. To continue, type '{resume}'"
    limit = f" (the study file limits each call to {shown(plan.time, 's')})"
    return (
        f"{plan.total - cases} of {plan.total} cases are not computed yet"
        f"{limit if math.isfinite(plan.time) else ''}. To continue, type '{resume}'"
    )


def noted(findings: Findings, damaged: int) -> list[str]:
    """Return notes on rounding and repair, and on the meaning of intervals."""
    repaired = ""
    if damaged:
        files = "1 damaged chunk is" if damaged == 1 else f"{damaged} damaged chunks are"
        repaired = f"{files} recomputed"
    return [
        *filter(None, [repaired]),
        *_rounding(findings.plan),
        *_on_intervals(findings),
        *_on_choices(findings.plan),
        *_on_first(findings),
    ]


def _failure_texts(findings: Findings, named: Callable[[int], str]) -> list[str]:
    """Return each reason why cases have no result, with the first such case.

    Parameters
    ----------
    named
        ``named(row)``: the case with its values.
    """
    reasons = findings.reasons
    texts = []
    for each in reasons[:_REASONS]:
        count = f"{each.cases} cases, " if each.cases > 1 else ""
        texts.append(f"{each.text} ({count}case {named(each.row)})")
    rest = len(reasons) - len(texts)
    return texts + ([f"and {rest} more reasons"] if rest else [])


def _rounding(plan: StudyPlan) -> list[str]:
    if plan.total == plan.cases or not (plan.is_sampled or plan.sensitivity is not None):
        return []
    what = "whole groups" if plan.sensitivity is not None else f"whole chunks of {CHUNK}"
    return [f"{plan.total} cases instead of {plan.cases}, because cases come in {what}"]


def _on_choices(plan: StudyPlan) -> list[str]:
    choices = [v.name for v in plan.varied if not v.unit]
    if not choices or not plan.is_sampled:
        return []
    return [
        f"{', '.join(choices)}: a choice has no rank correlation. Its correlation ratio, without "
        "sign or interval, ranks it among the quantities. Use 'sobol-indices' to find its "
        "contribution to the variance"
    ]


def _on_first(findings: Findings) -> list[str]:
    if not findings.plan.is_sampled or findings.count == len(findings.first):
        return []
    return [
        f"influences and their intervals use the first {len(findings.first)} of {findings.count} "
        "cases. All other figures use all cases"
    ]


def _on_intervals(findings: Findings) -> list[str]:
    plan = findings.plan
    if plan.design == WORST:
        return search_notes(findings)
    if plan.sought is not None:
        return rare_notes(findings)
    if plan.sensitivity is not None:
        return [
            f"{plan.design}: cases share values, so the fraction of cases is not a probability",
            *((missing_indices(findings) + _wide_shares(findings)) if findings.count else []),
        ]
    if not plan.is_sampled:
        return [f"{plan.design}: the cases show possible outcomes, but not their probability"]
    if plan.design == "monte-carlo":
        return []
    return [f"{plan.design}: intervals assume independent cases, so they are usually conservative"]


def _wide_shares(findings: Findings) -> list[str]:
    """Return the key figures whose shares of the variance have wide intervals."""
    design = findings.plan.sensitivity
    assert design is not None
    wide = [
        name
        for name in shown_figures(findings)
        if any(
            isinstance(each, VarianceShares) and max(each.first.reach, each.total.reach) > _WIDE
            for each in findings.sensitivity(name).drivers
        )
    ]
    if not wide:
        return []
    return [
        f"{', '.join(wide)}: {design.base} groups are too few to determine variance shares to "
        f"within +-{_WIDE:g}. Request more cases in the study file, and run it in another folder"
    ]


# --- The answer

_BRIEF = 3  # tables of drivers that a terminal shows
_DRIVERS = 3  # rows of each without --verbose


@dataclass(frozen=True, repr=False)
class StudyRun(Answer):
    """Results of a study so far.

    Parameters
    ----------
    plan
        The study.
    folder
        Folder of the study's chunks.
    findings
        The cases with their verdicts.
    nominal
        Result of the nominal bench.
    status
        ``passed``, ``failed`` or ``undecided`` according to the requirements, or ``done`` without
        requirements. Also ``failed`` if no case has a key figure, and ``unfinished`` if cases are
        missing.
    damaged
        Number of chunks that bywire recomputed because their files were unreadable.
    check
        Numerical errors of some cases, if the bench states an error.
    """

    plan: StudyPlan
    folder: Path
    findings: Findings
    nominal: Result
    status: str
    damaged: int = 0
    check: ErrorCheck | None = None

    @cached_property
    def _shown(self) -> ShownCases:
        return ShownCases(self.findings, self.nominal)

    @property
    def cases(self) -> pd.DataFrame:
        """All cases: varied quantities [SI], key figures, reasons for missing results, warnings.

        ``.attrs["units"]`` contains the unit of each column. A study with more than 65,536 cases
        loads them when this property is first used, which needs up to 1 kB of memory per case.
        `blocks` needs less.
        """
        cases = self.findings.cases
        cases.attrs["units"] = dict(self.plan.column_units)
        return cases

    def blocks(self, columns: Sequence[str] | None = None) -> Iterator[pd.DataFrame]:
        """Yield the cases in order, in frames of about 65,536 cases, with the columns of `cases`.

        Parameters
        ----------
        columns
            Names of the columns to load, for example ``["case", "overshoot"]``. Default: all.

        Raises
        ------
        UnknownNameError
            For a column that the study does not have.
        """
        import pandas as pd

        names = self.findings.columns
        for name in columns or ():
            if name not in names:
                raise unknown_name("column", str(name), names)
        for block in self.findings.blocks(names if columns is None else columns):
            yield pd.DataFrame(block)

    @property
    def data(self) -> xr.Dataset:
        """The cases with their units, over dimension ``case``."""
        import xarray as xr

        units = {**self.plan.units, **self.findings.units}
        columns = {
            name: (
                "case",
                np.asarray(self.cases[name]),
                {"units": units[name]} if name in units else {},
            )
            for name in self.cases
            if name != "case"
        }
        return xr.Dataset(columns, coords={"case": np.asarray(self.cases["case"])})

    @property
    def holds(self) -> bool:
        """Whether all cases are computed and every requirement is met."""
        return self.status in ("done", "passed")

    @property
    def outcome(self) -> Outcome:
        """Verdict on the requirements; ``undecided`` if cases are missing."""
        words: dict[str, Outcome] = {"passed": "met", "failed": "missed", "done": "not shown"}
        return words.get(self.status, "undecided")

    @property
    def warnings(self) -> list[str]:
        """Warnings of the runs, cases without a result, and missing cases."""
        return list(self._warnings)

    @cached_property
    def _warnings(self) -> list[str]:
        """The warnings, cached because computing them takes a pass over all cases."""
        texts = [*self.nominal.bench.outdated, *warned(self.findings, self.nominal.warnings)]
        texts += filter(None, [self.check.warning if self.check else ""])
        if self.status == "unfinished":
            resume = StudyStore(self.folder).resume_command
            texts.append(unfinished(self.plan, self.findings.count, resume))
        return texts

    @property
    def notes(self) -> list[str]:
        """Notes on rounding and repair, and on the meaning of intervals."""
        checked = [self.check.note] if self.check and self.check.note else []
        return [*noted(self.findings, self.damaged), *checked]

    def worst(self, kpi: str) -> Bench:
        """Return the bench of the worst case for a requirement.

        For a rare failure, return the bench of the most probable failing case.

        Raises
        ------
        UnknownNameError
            If the key figure has no requirement.
        ParameterError
            If no case has a result, or all are equal.
        """
        required = [each.demand.figure for each in self.findings.judgments]
        if kpi not in required:
            raise unknown_name("key figure of a requirement", str(kpi), required)
        if kpi not in self._shown.benches:
            raise ParameterError(
                f"{kpi} has no {self._shown.kind} case, because no case has a result or all are "
                "equal",
                name=kpi,
            )
        return self._shown.benches[kpi]

    def __repr__(self) -> str:
        return f"<StudyRun {self.plan.name}: {self.findings.count} cases, {self.status}>"

    def document(self) -> Document:
        """Return verdicts, the spread of key figures, influences, worst cases and figures."""
        plan, findings = self.plan, self.findings
        if not findings.count:
            return self._empty()
        subject = Subject.of_bench(
            plan.bench, plan.name, tested_line(plan), [each.name for each in plan.varied]
        )
        is_rare = bool(findings.rare)
        table = failure_table(findings) if is_rare else demand_table(findings)
        demands = TableBlock(table)
        is_indexed = plan.sensitivity is not None
        drivers = (
            importance_tables(findings)
            if is_rare
            else sensitivity_tables(findings)
            if is_indexed
            else influence_tables(findings) + effect_tables(findings)
        )
        more = len(drivers) - _BRIEF
        said = [*missing_indices(findings), *unmoved(findings)]
        unexplained = [Listing(said)] if said else []
        judged: list[Block] = [demands] if plan.demands else []
        figures = spread_blocks(findings)
        texts = self._shown.texts()
        remarks = [*(f"Warning: {text}." for text in self.warnings), *self.notes]
        missing = _failure_texts(findings, self._shown.named)
        return Document(
            f"Study {plan.name}",
            f"{findings.count} cases ({plan.design}, seed {plan.seed}) of {subject.line}",
            sections=lambda: [
                *([Section("Requirements", judged)] if judged else []),
                tested_section(self.nominal, plan.tested, subject),
                *([Section("Notes", [Listing(remarks)])] if remarks else []),
                *([Section("Key figures", figures)] if figures else []),
                *(
                    [Section("Main influences", [*drivers, *unexplained])]
                    if drivers or unexplained
                    else []
                ),
                *(
                    [Section("Figures", drawn)]
                    if (drawn := study_figures(findings, self._shown.recordings))
                    else []
                ),
                *([Section(self._shown.title, [Listing(texts)])] if judged and texts else []),
                *([Section("Cases without a result", [Listing(missing)])] if missing else []),
                Section("Varied quantities", [TableBlock(varied_table(plan)), *correlated(plan)]),
                subject.provenance(f"Chunks of the study: {self.folder}.", has_changes=False),
            ],
            brief=spaced(
                [
                    *tested_brief(self.nominal, plan),
                    *([demands] if judged else []),
                    *figures,
                    *[replace(each, most=_DRIVERS) for each in drivers[:_BRIEF]],
                    *(unexplained if findings.plan.sensitivity is None else []),
                    *([f"{more} more of these tables are in the report"] if more > 0 else []),
                    *([Listing(missing, "Cases without a result")] if missing else []),
                ]
            ),
            data=self._data,
            banner=self._banner(),
            attachments=self._shown.attachments(),
            record="report.json",
            remarks=[
                f"requirement {each.outcome}: {each.demand}"
                for each in findings.judgments
                if each.outcome != "met"
            ],
            changes=subject.changes,
        )

    def _empty(self) -> Document:
        return Document(
            f"Study {self.plan.name}",
            "",
            sections=[],
            brief=["no case is computed yet"],
            data=self._data(),
            is_paged=False,
        )

    def _banner(self) -> Banner:
        if not self.findings.spreads:
            return Banner("no case has a key figure", "bad")
        outcomes = [each.outcome for each in self.findings.judgments]
        if not outcomes:
            return Banner(f"{self.findings.count} cases done")
        text = f"{outcomes.count('met')} of {len(outcomes)} requirements met"
        if open_ := outcomes.count("undecided"):
            text += f", {open_} undecided"
        if self.holds:
            return Banner(text, "good")
        return Banner(text, "bad" if "missed" in outcomes else "open")

    def _data(self) -> dict[str, Any]:
        return {
            "study": self.plan.name,
            "status": self.status,
            "folder": str(self.folder),
            "bench": tested_data(self.plan.bench, self.plan.tested),
            **findings_data(self.findings),
            **choice_data(self.plan.bench),
            **({} if self.check is None else {"error_check": _check_data(self.check)}),
            "warnings": self.warnings,
            "notes": self.notes,
        }


def _check_data(check: ErrorCheck) -> dict[str, Any]:
    return {
        "cases": check.cases,
        "kpis": {
            name: {"largest": largest, "exceeding": check.exceeding.get(name, 0)}
            for name, largest in check.largest.items()
        },
    }


# --- Studies computed, or read from their folders


def completed(
    origin: Origin,
    plan: StudyPlan,
    store: StudyStore,
    workers: int | None,
    cluster: str,
    progress: Progress | None,
) -> StudyRun:
    """Compute a study's missing cases, and return the study with all cases."""

    def ready() -> None:
        if is_command_line():  # the report needs these next, but a program may not
            load_drawing()
            field_notes(type(plan.bench.par))

    try:
        completed = complete(
            plan,
            store,
            origin,
            workers=workers,
            cluster=cluster,
            progress=progress or silent,
            meanwhile=ready,
        )
    except KeyboardInterrupt:
        of = "" if plan.sought is not None else f" of {plan.chunks}"
        raise KeyboardInterrupt(
            f"{len(store.finished())}{of} chunks are saved. To continue, type "
            f"'{store.resume_command}'"
        ) from None
    return replace(_run_of(plan, store, completed.nominal), damaged=completed.damaged)


def kept_study(folder: str | Path) -> StudyRun:
    """Return the results in a study folder, like `study_report` but without emitting warnings."""
    store = StudyStore(Path(folder))
    plan, _ = kept_plan(store)
    store.require(plan)
    return _run_of(plan, store, running.run(plan.bench, estimate_error=True))


def kept_plan(store: StudyStore) -> tuple[StudyPlan, Origin]:
    """Return the study of a folder, with its requested number of cases, and its origin."""
    record = store.record()
    origin = Origin(Path(record["source"]), record["set"])
    if not origin.file.is_file():
        raise FileError(
            f"the study file {origin.file} for {store.folder} no longer exists. If you moved it, "
            f"type 'bywire study run FILE --out {store.folder}'",
            name=str(origin.file),
        )
    try:
        plan = read_study(origin.file, origin.overrides)
    except InputError as error:
        unloaded = [path for path in record["systems"] if path not in loaded_files()]
        if not unloaded:
            raise
        raise error.reworded(
            f"{error}. This study needs {' '.join(map(_loaded_by, unloaded))}"
        ) from None
    plan = with_step(plan, store)
    is_listed = plan.design in SPANNED
    return (plan if is_listed else replace(plan, cases=int(record["cases"]))), origin


def with_engine(engine: str, plan: StudyPlan) -> StudyPlan:
    """Return the plan with an engine. The cases do not depend on the engine."""
    return plan if engine == "auto" else replace(plan, bench=replace(plan.bench, engine=engine))


def _run_of(plan: StudyPlan, store: StudyStore, nominal: Result) -> StudyRun:
    if plan.design == WORST:
        searches, cases = worst_cases(plan, store)
        findings = Findings(plan, cases, nominal.kpis, searches=searches)
        is_whole = all(each.state != "unfinished" for each in searches)
    elif plan.sought is not None:
        rare, cases = rare_failures(plan, store)
        findings = Findings(plan, cases, nominal.kpis, rare)
        is_whole = all(each.failure.state != "unfinished" for each in rare)
    else:
        stored = stored_cases(plan, store)
        is_large = stored.count > BLOCK
        findings = Findings(plan, stored if is_large else stored.frame(), nominal.kpis)
        is_whole = findings.count == plan.total
    judged = status_of(findings.judgments) if findings.spreads else "failed"
    status = judged if is_whole else "unfinished"
    check = error_check(findings, nominal)
    return StudyRun(plan, store.folder, findings, nominal, status, check=check)


def _loaded_by(path: str) -> str:
    """Return the flag or call with which a user loads a brake from a file."""
    return f"--system {path}" if is_command_line() else f'bywire.load_system("{path}")'
