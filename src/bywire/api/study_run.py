"""What a study found, as it is shown: verdicts, spread, what drives it, worst cases."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.api.study_figures import study_figures
from bywire.api.study_rare import (
    failure_table,
    importance_tables,
    rare_data,
    rare_notes,
    state_texts,
)
from bywire.api.study_sensitivity import drivers_data, missing_indices, sensitivity_tables
from bywire.api.study_tables import (
    correlated,
    demand_table,
    influence_tables,
    spread_table,
    varied_table,
)
from bywire.bench import running
from bywire.bench.bench import Bench
from bywire.bench.bench_text import bench_text
from bywire.bench.result import Result
from bywire.core.errors import ParameterError
from bywire.report.answer import Answer
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
from bywire.studies.chunk import case_bench
from bywire.studies.findings import Findings, Judgment, Spread
from bywire.studies.plan import CHUNK, StudyPlan

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

_LISTED = 10  # cases without a result that are named


@dataclass(frozen=True)
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
        ``unfinished`` where cases are missing.
    """

    plan: StudyPlan
    folder: Path
    findings: Findings
    nominal: Result
    status: str

    @property
    def cases(self) -> pd.DataFrame:
        """Every case: what varied [SI], key figures, why there is none, what the run warned of."""
        return self.findings.cases

    @property
    def data(self) -> xr.Dataset:
        """The cases with their units, dimension ``case``."""
        import xarray as xr

        units = {**self.plan.units, **self.findings.units}
        columns = {
            name: ("case", np.asarray(self.cases[name]), {"units": units[name]} if name in units
                   else {})
            for name in self.cases if name != "case"
        }  # fmt: skip
        return xr.Dataset(columns, coords={"case": np.asarray(self.cases["case"])})

    @property
    def holds(self) -> bool:
        """Whether all cases are computed and every requirement is met as it is wanted."""
        return self.status in ("done", "passed")

    @property
    def warnings(self) -> list[str]:
        """What the runs warned of, cases without a result, and what is still to be computed."""
        said = [f"{text} ({count} of {len(self.cases)} cases)"
                for text, count in self.findings.warnings.items()]  # fmt: skip
        said += self.nominal.warnings if not said else []
        if failed := self.findings.failures:
            said.append(
                f"{len(failed)} of {len(self.cases)} cases have no result; they count as missing "
                "every requirement"
            )
        if self.findings.rare:
            said += state_texts(self.findings)
        if self.status == "unfinished":
            left = self.plan.total - len(self.cases)
            said.append(
                f"not all cases that it asks for are computed yet: bywire study resume "
                f"{self.folder}" if self.findings.rare else
                f"{left} of {self.plan.total} cases are not computed yet: bywire study resume "
                f"{self.folder}"
            )
        return said

    @property
    def notes(self) -> list[str]:
        """What was rounded, what the intervals stand for, and what nothing is said of."""
        return [*self._rounding(), *self._on_intervals(), *self._on_choices()]

    def _rounding(self) -> list[str]:
        plan = self.plan
        if plan.total == plan.cases or not (plan.is_sampled or plan.sensitivity is not None):
            return []
        what = "whole groups" if plan.sensitivity is not None else f"whole chunks of {CHUNK}"
        return [f"{plan.total} cases in place of {plan.cases}: they come in {what}"]

    def _on_choices(self) -> list[str]:
        choices = [v.name for v in self.plan.varied if not v.unit]
        if not choices or not self.plan.is_sampled:
            return []
        return [
            f"{', '.join(choices)}: a choice has no rank correlation; 'sobol-indices' tells what "
            "it does"
        ]

    def _on_intervals(self) -> list[str]:
        if self.plan.rare is not None:
            return rare_notes(self.findings)
        if self.plan.sensitivity is not None:
            return [
                f"{self.plan.design}: cases share values, so that shares of them are no "
                "probabilities",
                *(missing_indices(self.findings) if len(self.cases) else []),
            ]
        if not self.plan.is_sampled:
            return [f"{self.plan.design}: what may happen, and not how often"]
        if self.plan.design == "monte-carlo":
            return []
        return [
            f"{self.plan.design}: intervals are those of independent cases, which scatter more as "
            "a rule"
        ]

    def worst(self, kpi: str) -> Bench:
        """Return the bench of the case that comes worst of all by a requirement.

        Raises
        ------
        ParameterError
            When nothing is required of the key figure, or no case has it.
        """
        for each in self.findings.judgments:
            if each.demand.kpi == kpi and each.worst is not None:
                return self._bench_of(each)
        raise ParameterError(f"no worst case by {kpi!r}: nothing is required of it")

    def document(self) -> Document:
        """Return verdicts, the spread of key figures, what drives them, worst cases, figures."""
        plan, findings = self.plan, self.findings
        if not len(self.cases):
            return self._empty()
        subject = Subject(plan.name, plan.bench.definition.summary, plan.bench.parameters,
                          plan.bench.par)  # fmt: skip
        is_rare = bool(findings.rare)
        table = failure_table(findings) if is_rare else demand_table(findings)
        demands = TableBlock(table, width=120)
        spreads = TableBlock(spread_table(findings), width=140)
        is_indexed = plan.sensitivity is not None
        drivers = (
            importance_tables(findings) if is_rare
            else sensitivity_tables(findings) if is_indexed else influence_tables(findings)
        )  # fmt: skip
        unindexed = [Listing(texts)] if (texts := missing_indices(findings)) else []
        judged: list[Block] = [demands] if plan.demands else []
        most = "Most probable failing cases" if is_rare else "Worst cases"
        missing = self._failures()
        return Document(
            f"Study {plan.name}",
            f"{len(self.cases)} cases ({plan.design}, seed {plan.seed}) of {subject.line}",
            sections=lambda: [
                *([Section("Requirements", judged)] if judged else []),
                Section("Key figures", [spreads]),
                *([Section("What drives them", [*drivers, *unindexed])] if drivers or unindexed
                  else []),
                Section("Figures", study_figures(findings, self._recordings)),
                *([Section(most, [Listing(self._worst_texts())])] if judged else []),
                *([Section("Cases without a result", [Listing(missing)])] if missing else []),
                Section("What varies", [TableBlock(varied_table(plan)), *correlated(plan)]),
                subject.provenance(f"Chunks of the study: {self.folder}."),
            ],
            brief=spaced([
                *([demands] if judged else []), spreads, *drivers[:3],
                *([Listing(missing, "Cases without a result")] if missing else []),
            ]),
            data=self._data(),
            banner=self._banner(),
            attachments=[*self._worst_benches(), *self._worst_recordings()],
            record="report.json",
            remarks=[
                f"requirement {each.outcome}: {each.demand.text}"
                for each in findings.judgments if each.outcome != "met"
            ],
        )  # fmt: skip

    def _empty(self) -> Document:
        return Document(
            f"Study {self.plan.name}", "", sections=[], brief=["no case is computed yet"],
            data=self._data(), is_paged=False,
        )  # fmt: skip

    def _banner(self) -> Banner:
        outcomes = [each.outcome for each in self.findings.judgments]
        if not outcomes:
            return Banner(f"{len(self.cases)} cases done")
        text = f"{outcomes.count('met')} of {len(outcomes)} requirements met"
        if open_ := outcomes.count("undecided"):
            text += f", {open_} undecided"
        if self.holds:
            return Banner(text, "good")
        return Banner(text, "bad" if "missed" in outcomes else "none")

    def _failures(self) -> list[str]:
        """Return the first cases without a result, with their values."""
        failed = self.findings.failures
        texts = [f"case {self._named(row)}: {text}" for row, text in list(failed.items())[:_LISTED]]
        rest = len(failed) - len(texts)
        return texts + ([f"and {rest} more"] if rest else [])

    def _named(self, row: int) -> str:
        units = self.plan.units
        values = ", ".join(
            f"{name} = {value if isinstance(value, str) else amount(value, units[name])}"
            for name, value in self.findings.values(row).items()
        )
        return f"{self.findings.number(row)} ({values})"

    def _worst_texts(self) -> list[str]:
        return [
            f"{each.demand.kpi} = {self._at_worst(each)} in case {self._named(each.worst)}; "
            f"{self._kind}-{each.demand.kpi}.toml runs it"
            for each in self.findings.judgments if each.worst is not None
        ]  # fmt: skip

    @property
    def _kind(self) -> str:
        """What the shown case of a requirement is called."""
        return "failing" if self.findings.rare else "worst"

    def _at_worst(self, judgment: Judgment) -> str:
        assert judgment.worst is not None
        name = judgment.demand.kpi
        return amount(float(self.findings.figure(name)[judgment.worst]), self.findings.units[name])

    def _bench_of(self, judgment: Judgment) -> Bench:
        assert judgment.worst is not None
        values = self.findings.values(judgment.worst)
        made = case_bench(self.plan, self.findings.number(judgment.worst), values)
        return replace(made, name=f"{self._kind} {judgment.demand.kpi}")

    def _known(self) -> dict[str, Bench]:
        return {j.demand.kpi: self._bench_of(j) for j in self.findings.judgments
                if j.worst is not None}  # fmt: skip

    @cached_property
    def _results(self) -> dict[str, Result]:
        """The worst cases, run again, by their key figure."""
        return {kpi: running.run(bench) for kpi, bench in self._known().items()}

    def _recordings(self) -> dict[str, dict[str, xr.Dataset]]:
        """Return the recordings of the bench itself and of the worst cases, by run."""
        each = {"the bench itself": self.nominal} | {
            f"{self._kind} {kpi}": result for kpi, result in self._results.items()
        }
        return {
            label: {name: r.recordings[label] for name, r in each.items() if label in r.recordings}
            for label in self.nominal.recordings
        }

    def _worst_benches(self) -> list[Attachment]:
        def write(bench: Bench, path: Path) -> Path:
            what = "Most probable failing" if self.findings.rare else "Worst"
            path.write_text(bench_text(bench, f"{what} case of study {self.plan.name}"), "utf-8")
            return path

        return [Attachment(f"{self._kind}-{kpi}.toml", partial(write, bench))
                for kpi, bench in self._known().items()]  # fmt: skip

    def _worst_recordings(self) -> list[Attachment]:
        def write(kpi: str, label: str, path: Path) -> Path:
            return recording_file(path.name, self._results[kpi].recordings[label]).write(path)

        labels = list(self.nominal.recordings)
        return [
            Attachment(f"{self._kind}-{kpi}{'' if len(labels) == 1 else '-' + label}.nc",
                       partial(write, kpi, label))
            for kpi in self._known() for label in labels
        ]  # fmt: skip

    def _data(self) -> dict[str, Any]:
        findings = self.findings
        return {
            "study": self.plan.name,
            "status": self.status,
            "folder": str(self.folder),
            "design": self.plan.design,
            "seed": self.plan.seed,
            "cases": len(self.cases),
            "of": self.plan.total,
            "confidence": self.plan.confidence,
            "failed": len(findings.failures),
            "requirements": [
                self._judgment_data(each)
                for each in (findings.judgments if len(self.cases) else ())
            ],
            "kpis": {
                each.name: {
                    "unit": each.unit, "nominal": each.nominal, "least": each.least,
                    "largest": each.largest, "undefined": each.undefined,
                    **(_spread_data(each) if self.plan.is_sampled else {}),
                    **drivers_data(findings, each.name),
                }
                for each in (findings.spreads if len(self.cases) else ())
            },
            "warnings": self.warnings,
            "notes": self.notes,
        }  # fmt: skip

    def _judgment_data(self, judgment: Judgment) -> dict[str, Any]:
        """Return a requirement for JSON; of cases that were not drawn, without a probability."""
        demand, share = judgment.demand, judgment.share
        probability = {"probability": share.value, "low": share.low, "high": share.high}
        rare = {}
        if judgment.failure is not None:
            (of,) = [each for each in self.findings.rare if each.demand == demand]
            rare = rare_data(judgment.failure, of)
        return rare | {
            "kpi": demand.kpi, "limit": demand.limit, "wanted": demand.probability,
            "outcome": judgment.outcome, "met": share.count,
            **(probability if self.plan.is_sampled else {}),
            "undecided_cases": judgment.undecided,
            "worst_case": (
                None if judgment.worst is None else self.findings.number(judgment.worst)
            ),
        }  # fmt: skip


def _spread_data(spread: Spread) -> dict[str, Any]:
    """Return mean and quantiles of drawn cases for JSON."""
    return {
        "mean": spread.mean, "sd": spread.sd,
        "quantiles": [
            {"probability": q.probability, "value": q.value, "low": q.low, "high": q.high}
            for q in spread.quantiles
        ],
    }  # fmt: skip
