"""What a study found, as it is shown: verdicts, spread, what drives it, worst cases."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.api.study_cases import ShownCases
from bywire.api.study_data import findings_data
from bywire.api.study_figures import study_figures
from bywire.api.study_rare import failure_table, importance_tables
from bywire.api.study_remarks import failure_texts, noted, unfinished, warned
from bywire.api.study_sensitivity import missing_indices, sensitivity_tables
from bywire.api.study_tables import (
    correlated,
    demand_table,
    effect_tables,
    influence_tables,
    spread_blocks,
    unmoved,
    varied_table,
)
from bywire.api.study_tested import tested_brief, tested_data, tested_line, tested_section
from bywire.bench.bench import Bench
from bywire.bench.result import Result
from bywire.core.errors import ParameterError, unknown_name
from bywire.report.answer import Answer
from bywire.report.document import (
    Banner,
    Block,
    Document,
    Listing,
    Section,
    TableBlock,
    spaced,
)
from bywire.report.subject import Subject
from bywire.studies.findings import Findings
from bywire.studies.plan import StudyPlan
from bywire.studies.store import StudyStore

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

_BRIEF = 3  # tables of drivers that a terminal shows


@dataclass(frozen=True, repr=False)
class StudyRun(Answer):
    """What a study found; as far as it is computed.

    Parameters
    ----------
    plan
        The study.
    folder
        Where its chunks lie.
    findings
        Its cases, judged.
    nominal
        The bench itself.
    status
        ``passed``, ``failed`` or ``undecided`` by the requirements, ``done`` where there are none,
        ``failed``, too, where no case has a key figure, and ``unfinished`` where cases are missing.
    damaged
        Chunks whose files could not be read, and that were computed again.
    """

    plan: StudyPlan
    folder: Path
    findings: Findings
    nominal: Result
    status: str
    damaged: int = 0

    @cached_property
    def _shown(self) -> ShownCases:
        return ShownCases(self.findings, self.nominal)

    @property
    def cases(self) -> pd.DataFrame:
        """Every case: what varied [SI], key figures, why there is none, what the run warned of.

        ``.attrs["units"]`` has the unit of each column.
        """
        cases = self.findings.cases
        cases.attrs["units"] = dict(self.plan.column_units)
        return cases

    @property
    def data(self) -> xr.Dataset:
        """The cases with their units, dimension ``case``."""
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
        """Whether all cases are computed and every requirement is met as it is wanted."""
        return self.status in ("done", "passed")

    @property
    def warnings(self) -> list[str]:
        """What the runs warned of, cases without a result, and what is still to be computed."""
        return list(self._warnings)

    @cached_property
    def _warnings(self) -> list[str]:
        """The warnings, for which all cases are gone through once."""
        said = [*self.nominal.bench.outdated, *warned(self.findings, self.nominal.warnings)]
        if self.status == "unfinished":
            resume = StudyStore(self.folder).resume_command
            said.append(unfinished(self.plan, len(self.cases), resume))
        return said

    @property
    def notes(self) -> list[str]:
        """What was rounded or repaired, what intervals stand for, what nothing is said of."""
        return noted(self.findings, self.damaged)

    def worst(self, kpi: str) -> Bench:
        """Return the bench of the case that comes worst of all by a requirement.

        Of a rare failure, that of the most probable failing case.

        Raises
        ------
        UnknownNameError
            When nothing is required of the key figure.
        ParameterError
            When no case has it, or all have the same.
        """
        required = [each.demand.figure for each in self.findings.judgments]
        if kpi not in required:
            raise unknown_name("key figure of a requirement", str(kpi), required)
        if kpi not in self._shown.benches:
            raise ParameterError(
                f"there is no {self._shown.kind} case by {kpi}: none has a result, or all are alike"
            )
        return self._shown.benches[kpi]

    def __repr__(self) -> str:
        return f"<StudyRun {self.plan.name}: {len(self.cases)} cases, {self.status}>"

    def document(self) -> Document:
        """Return verdicts, the spread of key figures, what drives them, worst cases, figures."""
        plan, findings = self.plan, self.findings
        if not len(self.cases):
            return self._empty()
        subject = Subject.of_bench(
            plan.bench, plan.name, tested_line(plan), [each.name for each in plan.varied]
        )
        is_rare = bool(findings.rare)
        table = failure_table(findings) if is_rare else demand_table(findings)
        demands = TableBlock(table, width=120)
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
        missing = failure_texts(findings, self._shown.named)
        return Document(
            f"Study {plan.name}",
            f"{len(self.cases)} cases ({plan.design}, seed {plan.seed}) of {subject.line}",
            sections=lambda: [
                *([Section("Requirements", judged)] if judged else []),
                tested_section(self.nominal, plan.tested, subject),
                *([Section("What else to know", [Listing(remarks)])] if remarks else []),
                *([Section("Key figures", figures)] if figures else []),
                *(
                    [Section("What drives them", [*drivers, *unexplained])]
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
                Section("What varies", [TableBlock(varied_table(plan)), *correlated(plan)]),
                subject.provenance(f"Chunks of the study: {self.folder}.", has_changes=False),
            ],
            brief=spaced(
                [
                    *tested_brief(self.nominal, plan),
                    *([demands] if judged else []),
                    *figures,
                    *drivers[:_BRIEF],
                    *(unexplained if findings.plan.sensitivity is None else []),
                    *([f"and {more} more such tables in the report"] if more > 0 else []),
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
            return Banner(f"{len(self.cases)} cases done")
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
            "warnings": self.warnings,
            "notes": self.notes,
        }
