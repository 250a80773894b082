"""Sizing study: brake designs compared under the same demands, the best design and its limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.api.parameter_choice import set_for
from bywire.bench.changes import settled
from bywire.core.errors import unknown_name
from bywire.core.parameters import ParameterSet
from bywire.core.values import parsed
from bywire.report.answer import Answer
from bywire.report.document import (
    Banner,
    Details,
    Document,
    FigureBlock,
    Flat,
    Listing,
    Section,
    TableBlock,
    recording_file,
)
from bywire.report.subject import Subject, defaults_of, parameter_rows, value_changes
from bywire.report.tables import Cell, KpiRow, Table, kpi_table, parameter_table, text_table
from bywire.report.wording import in_display_unit, measured_amount, unit_text
from bywire.synthesis.study import STUDIES, Cut, Findings, Map, Study

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_MOST_IN_BANNER = 3  # key figures; a study's first ones describe its best design


@dataclass(frozen=True)
class StudyResult(Answer):
    """Results of a sizing study.

    Parameters
    ----------
    definition
        The study.
    name, par
        Name of the parameter set, and the values in use.
    options
        Options in use.
    findings
        All designs as an xarray dataset, key figures, maps and tables.
    """

    definition: Study
    name: str
    par: ParameterSet
    options: ParameterSet
    findings: Findings

    @property
    def warnings(self) -> list[str]:
        """Warnings about the designs."""
        return list(self.findings.warnings)

    def document(self) -> Document:
        """Return key figures, limits, maps, tables and assumptions."""
        study, findings = self.definition, self.findings
        defaults = study.defaults.flat()
        subject = Subject(
            study.name,
            study.summary,
            self.name,
            self.par,
            further=value_changes(self.options, defaults, defaults_of(study.name)),
        )
        kpis = TableBlock(kpi_table(self._rows()))
        tables = [TableBlock(_cut_table(cut), f"{cut.title}.") for cut in findings.cuts]
        maps = [
            FigureBlock(
                partial(_drawn, findings.data, shown), shown.caption, f"{study.name}-{kind}"
            )
            for kind, shown in findings.maps.items()
        ]
        warned = [Listing([f"Warning: {text}." for text in findings.warnings])]
        limits = Listing(findings.limits)
        options = TableBlock(parameter_table(parameter_rows(self.options)))
        chosen = Details("Study options", [options])
        brief_limits: list[str | Flat] = (
            ["limits of the best design", limits, ""] if findings.limits else []
        )
        brief_tables: list[str | Flat] = [
            each for table in tables for each in (table.caption.rstrip("."), table, "")
        ]
        return Document(
            f"Study {study.name}",
            subject.line,
            sections=lambda: [
                Section("Key figures", [*(warned if findings.warnings else []), kpis]),
                *([Section("Limits of the best design", [limits])] if findings.limits else []),
                *([Section("Maps", maps)] if maps else []),
                *([Section("Tables", tables)] if tables else []),
                Section("Assumptions", [Listing(findings.assumptions), chosen]),
                subject.provenance(),
            ],
            brief=[
                f"study {study.name} of {self.name}: {study.summary}",
                "",
                kpis,
                "",
                *brief_limits,
                *brief_tables,
                Listing(findings.assumptions, "assumptions"),
            ],
            data=self._data(),
            banner=self._banner(),
            attachments=[recording_file(f"{study.name}.nc", findings.data)],
            changes=subject.changes,
        )

    def _banner(self) -> Banner:
        """Return the warnings and the first key figures as text."""
        texts = [f"{text[:1].upper()}{text[1:]}" for text in self.findings.warnings]
        texts += [
            f"{row.definition.rstrip('.')}: {measured_amount(row.value, row.unit, row.error)}"
            for row in self._rows()[:_MOST_IN_BANNER]
        ]
        return Banner(". ".join(texts))

    def _rows(self) -> list[KpiRow]:
        """Return the key figures as rows of a table, each with its note."""
        return [
            KpiRow(
                kpi.name,
                kpi.value,
                kpi.unit,
                f"{kpi.definition} ({kpi.note})" if kpi.note else kpi.definition,
            )
            for kpi in self.findings.kpis
        ]

    def _data(self) -> dict[str, Any]:
        findings = self.findings
        return {
            "study": self.definition.name,
            "parameters": self.name,
            "options": self.options.model_dump(mode="json"),
            "assumptions": list(findings.assumptions),
            "limits": list(findings.limits),
            "kpis": {
                kpi.name: {
                    "value": kpi.value,
                    "unit": kpi.unit,
                    "definition": kpi.definition,
                    "note": kpi.note,
                }
                for kpi in findings.kpis
            },
            "designs": {
                str(name): {
                    "dims": [str(dim) for dim in values.dims],
                    "unit": values.attrs["units"],
                    "values": np.asarray(values.values, dtype=float).tolist(),
                }
                for name, values in findings.data.variables.items()
            },
            "figures": {name: shown.caption for name, shown in findings.maps.items()},
            "warnings": list(findings.warnings),
        }


AskedStudy = tuple[Study, str, ParameterSet, ParameterSet]


def asked_study(name: str, parameters: str, overrides: Mapping[str, Any]) -> AskedStudy:
    """Return a study, the name of its parameter set, and its changed parameters and options.

    Raises
    ------
    InputError
        See `bywire.study`.
    """
    definition = STUDIES.find(name)
    cited = set_for(f"study {definition.name!r}", (definition.assembly,), parameters)
    return definition, cited.name, *_changed(definition, cited.parameters(), overrides)


def _changed(
    definition: Study, par: ParameterSet, overrides: Mapping[str, Any]
) -> tuple[ParameterSet, ParameterSet]:
    """Return parameters and options. Names with a dot are the brake's, others the study's."""
    of_study = {name: value for name, value in overrides.items() if "." not in name}
    options = definition.defaults.flat()
    for name in of_study:
        if name not in options:
            raise unknown_name("option", name, (*options, *par.flat()))
    of_brake = settled(par, {n: value for n, value in overrides.items() if "." in n})
    definition.require_effect(of_brake)
    return (
        par.replace(parsed(type(par), of_brake, "parameter")),
        definition.defaults.replace(parsed(definition.options, of_study, "option")),
    )


def _cut_table(cut: Cut) -> Table:
    """Return a cut of a study's designs as a table in display units."""
    heading: list[str] = []
    columns: list[list[object]] = []
    for name in cut.columns:
        values = cut.data[name].values
        if values.dtype.kind in "UO":  # words
            heading.append(name)
            columns.append([str(value) for value in values])
            continue
        shown, unit = in_display_unit(values, str(cut.data[name].attrs["units"]))
        heading.append(f"{name} [{unit_text(unit) or '-'}]")
        columns.append([Cell(f"{value:.4g}", value=value, unit=unit) for value in shown.tolist()])
    return text_table(heading, zip(*columns, strict=True))


def _drawn(data: xr.Dataset, shown: Map) -> Figure:
    from bywire.report.range_figures import contour

    return contour(data, shown)
