"""Surrogates of a study's key figures: what they tell of values in between, and how far off."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from bywire.api.run_study import kept_study
from bywire.api.study_run import StudyRun
from bywire.api.study_tables import figure_text, shown_figures, varied_table
from bywire.bench.relative_changes import share_of
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.values import number
from bywire.report.answer import Answer, use_case
from bywire.report.document import Document, Section, TableBlock, spaced
from bywire.report.tables import Cell, Column, Table
from bywire.report.wording import amount, clean
from bywire.studies.surrogate import Surrogate, require_fittable, surrogate_of

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
            f"{amount(first.nominal[v.name], v.unit)}, is taken; choose another by --at"
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
        table = TableBlock(self._table(), width=140)
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


@use_case
def study_surrogates(
    folder: str | Path,
    kpis: str | Sequence[str] = (),
    at: Mapping[str, Any] = MappingProxyType({}),
) -> StudySurrogates:
    """Return polynomials that tell key figures of a study between its cases; nothing is run.

    Parameters
    ----------
    folder
        Folder of the study.
    kpis
        Key figure, or several; by default those that something is required of, or all.
    at
        Values of what varies at which to tell them: SI numbers, texts with units, or changes such
        as ``"+5 %"`` of what the bench has; the others as in the bench.

    Returns
    -------
    StudySurrogates
        Each surrogate with its error in the key figure's unit; ``.surrogates["overshoot"]`` is
        called with values or arrays [SI].

    Raises
    ------
    InputError
        When the folder holds no study, for names that are unknown, values beyond what the cases
        have shown, or between those of a quantity that has single ones, too few cases, designs that
        do not show what lies between their points, and structural choices among what varies.
    """
    report = kept_study(folder)
    require_fittable(report.plan)  # before values are read: those of a choice are no numbers
    findings = report.findings
    quantities = {v.name: v for v in report.plan.varied}
    values: dict[str, float] = {}
    for name, text in at.items():
        if name not in quantities:
            raise unknown_name("quantity of the study", name, quantities)
        share = share_of(text)
        change = (1.0 + share) * quantities[name].nominal if share is not None else text
        values[name] = number(change, quantities[name].unit or "1", name)
    surrogates: dict[str, Surrogate] = {}
    refused: dict[str, str] = {}
    wanted = [kpis] if isinstance(kpis, str) else kpis
    required = [each.figure for each in report.plan.demands]
    for kpi in wanted or shown_figures(findings) or required:
        try:
            surrogates[kpi] = surrogate_of(findings, kpi)
        except ParameterError as error:
            refused[kpi] = str(error)
    if not surrogates:
        why = "; ".join(dict.fromkeys(refused.values()))
        raise ParameterError(why or f"{folder}: no case is computed yet")
    return StudySurrogates(report, surrogates, values, refused)
