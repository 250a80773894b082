"""Surrogates of a study's key figures: estimates between cases, and their errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bywire.api.study_run import StudyRun
from bywire.api.study_tables import figure_text, varied_table
from bywire.core.callers import option
from bywire.report.answer import Answer
from bywire.report.document import Document, Section, TableBlock, spaced
from bywire.report.tables import Cell, Column, Table
from bywire.report.wording import amount, clean
from bywire.studies.surrogate import Surrogate

_POOR = 0.5  # explained fraction of the variance below which a surrogate is useless


@dataclass(frozen=True)
class StudySurrogates(Answer):
    """Surrogates of a study's key figures.

    Parameters
    ----------
    study
        The study from which they are fitted.
    surrogates
        Surrogates by key figure, functions of the varied quantities [SI].
    at
        Values at which to estimate [SI]. May be empty.
    refused
        Key figures without a surrogate, with the reason.
    """

    study: StudyRun
    surrogates: Mapping[str, Surrogate]
    at: Mapping[str, float]
    refused: Mapping[str, str]

    @property
    def warnings(self) -> list[str]:
        """Warnings about poor surrogates, and the study's warnings."""
        poor = [
            f"the surrogate of {each.kpi} explains {100.0 * each.explained:.0f} % of the variance "
            "in cases not used for its fit. The rest is noise, or a dependence that is not "
            "polynomial"
            for each in self.surrogates.values()
            if each.explained < _POOR
        ]
        none = [f"no surrogate of {kpi}: {why}" for kpi, why in self.refused.items()]
        return [*poor, *none, *self.study.warnings]

    @property
    def notes(self) -> list[str]:
        """Notes on the values of quantities that the user did not specify."""
        varied, first = self.study.plan.varied, next(iter(self.surrogates.values()))
        moved = [
            f"no case has the bench's {v.name} = {amount(v.nominal, v.unit)}. bywire uses the "
            "nearest "
            f"value, {amount(first.nominal[v.name], v.unit)}. To use another value, add "
            f"{option('at')}"
            for v in varied
            if self.at and v.name not in self.at and first.nominal[v.name] != v.nominal
        ]
        pairs = [
            pair
            for pair in self.study.plan.correlations
            if (pair[0] in self.at) != (pair[1] in self.at)
        ]
        return moved + [
            f"{' and '.join(pair)} are correlated, but you changed only one of them. Specify both"
            for pair in pairs
        ]

    def document(self) -> Document:
        """Return the accuracy of the surrogates, and their estimates."""
        plan = self.study.plan
        table = TableBlock(self._table())
        return Document(
            f"Surrogates of study {plan.name}",
            f"polynomials of {len(plan.varied)} quantities, from "
            f"{len(self.study.findings.first)} cases",
            sections=[
                Section("Key figures", [table]),
                Section("Varied quantities", [TableBlock(varied_table(plan))]),
            ],
            brief=spaced([table]),
            data=self._data(),
        )

    def _table(self) -> Table:
        heads = ["variance explained", "rms error", "maximum error", "degree", "terms", "cases"]
        at = ["at these values"] if self.at else []
        rows = []
        for s in self.surrogates.values():
            told = [figure_text(self.study.findings, s.kpi, float(s(self.at)))] if self.at else []
            texts = [
                *told,
                f"{100.0 * s.explained:.2f} %",
                *(
                    figure_text(self.study.findings, s.kpi, error, is_difference=True)
                    for error in (s.rms, s.largest)
                ),
                str(s.degree),
                str(s.terms),
                str(s.cases),
            ]
            rows.append((Cell(clean(s.kpi)), *map(Cell, texts)))
        columns = (Column("name"), *(Column(head, numeric=True) for head in (*at, *heads)))
        return Table(columns, tuple(rows))

    def _data(self) -> dict[str, Any]:
        return {
            "study": self.study.plan.name,
            "at": dict(self.at),
            "surrogates": {
                s.kpi: {
                    "unit": s.unit,
                    "variance_told": s.explained,
                    "rms_error": s.rms,
                    "largest_error": s.largest,
                    "degree": s.degree,
                    "terms": s.terms,
                    "cases": s.cases,
                    **({"value": float(s(self.at))} if self.at else {}),
                }
                for s in self.surrogates.values()
            },
            "warnings": self.warnings,
        }
