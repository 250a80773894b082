"""Surrogates of a study's key figures: what they tell of values in between, and how far off."""

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

_POOR = 0.5  # share of the variance below which a surrogate is no use


@dataclass(frozen=True)
class StudySurrogates(Answer):
    """Surrogates of a study's key figures.

    Parameters
    ----------
    study
        The study that they are made of.
    surrogates
        By key figure; each is called with values of what varies [SI].
    at
        Values that were asked for [SI]; empty where none were.
    refused
        Key figures that have none, and why.
    """

    study: StudyRun
    surrogates: Mapping[str, Surrogate]
    at: Mapping[str, float]
    refused: Mapping[str, str]

    @property
    def warnings(self) -> list[str]:
        """Surrogates that tell little, and the study's own warnings."""
        poor = [
            f"the surrogate of {each.kpi} tells {100.0 * each.explained:.0f} % of the variance of "
            "cases it has not seen: the rest is noise, or no polynomial"
            for each in self.surrogates.values()
            if each.explained < _POOR
        ]
        none = [f"no surrogate of {kpi}: {why}" for kpi, why in self.refused.items()]
        return [*poor, *none, *self.study.warnings]

    @property
    def notes(self) -> list[str]:
        """What quantities are taken for that were not given, where the bench alone does not say."""
        varied, first = self.study.plan.varied, next(iter(self.surrogates.values()))
        moved = [
            f"no case has {v.name} = {amount(v.nominal, v.unit)} as the bench has it: the nearest, "
            f"{amount(first.nominal[v.name], v.unit)}, is taken; choose another by {option('at')}"
            for v in varied
            if self.at and v.name not in self.at and first.nominal[v.name] != v.nominal
        ]
        pairs = [
            pair
            for pair in self.study.plan.correlations
            if (pair[0] in self.at) != (pair[1] in self.at)
        ]
        return moved + [
            f"{' and '.join(pair)} are correlated, and one of them stays as in the bench: give both"
            for pair in pairs
        ]

    def document(self) -> Document:
        """Return how good the surrogates are, and what they say of the values asked for."""
        plan = self.study.plan
        table = TableBlock(self._table())
        return Document(
            f"Surrogates of study {plan.name}",
            f"polynomials of {len(plan.varied)} quantities, from {len(self.study.cases)} cases",
            sections=[
                Section("Key figures", [table]),
                Section("What varies", [TableBlock(varied_table(plan))]),
            ],
            brief=spaced([table]),
            data=self._data(),
        )

    def _table(self) -> Table:
        heads = ["variance told", "rms error", "largest error", "degree", "terms", "cases"]
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
