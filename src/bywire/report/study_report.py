"""Report page of a sizing study: key figures, maps, tables, assumptions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from matplotlib.figure import Figure

from bywire.core.parameters import ParameterSet
from bywire.report.document import Details, FigureBlock, Listing, Section, TableBlock
from bywire.report.page import write_page
from bywire.report.parameter_rows import parameter_rows
from bywire.report.subject import Subject
from bywire.report.tables import KpiRow, Table, kpi_table, parameter_table, text_table
from bywire.report.wording import in_display_unit, unit_text
from bywire.synthesis.study import Cut, Found, Study


def write_study(
    out: Path,
    study: Study,
    subject: Subject,
    options: ParameterSet,
    found: Found,
    figures: Mapping[str, Figure],
) -> Path:
    """Write the page and return it.

    Parameters
    ----------
    out
        Folder.
    study, subject
        The study, and the brake that it was made of.
    options
        Options in use.
    found
        What it found.
    figures
        Figure by name of the map in ``found.maps``.

    Raises
    ------
    FileError
        When it cannot be written.
    """
    warned = [Listing([f"Warning: {text}." for text in found.warnings])] if found.warnings else []
    shown = [FigureBlock(figure, found.maps[name].caption) for name, figure in figures.items()]
    tables = [TableBlock(cut_table(cut), f"{cut.title}.") for cut in found.cuts]
    chosen = TableBlock(parameter_table(parameter_rows(options)))
    sections = [
        Section("Key figures", [*warned, TableBlock(kpi_table(kpi_rows(found)))]),
        *([Section("What limits the best design", [Listing(found.limits)])]
          if found.limits else []),
        *([Section("Maps", shown)] if shown else []),
        *([Section("Tables", tables)] if tables else []),
        Section(
            "Assumptions",
            [Listing(found.assumptions), Details("Options of the study", [chosen])],
        ),
        subject.made(),
    ]
    return write_page(out / "report.html", f"Study {study.name}", subject.line, sections)


def kpi_rows(found: Found) -> list[KpiRow]:
    """Return a study's key figures as rows of a table, each with its note."""
    return [
        KpiRow(one.name, one.value, one.unit,
               f"{one.definition} ({one.note})" if one.note else one.definition)
        for one in found.kpis
    ]  # fmt: skip


def cut_table(cut: Cut) -> Table:
    """Return a cut of a study's designs as a table in display units."""
    heading, columns = [], []
    for name in cut.columns:
        values = cut.data[name].values
        if values.dtype.kind in "UO":  # words
            heading.append(name)
            columns.append([str(value) for value in values])
            continue
        factor, unit = in_display_unit(1.0, str(cut.data[name].attrs["units"]))
        heading.append(f"{name} [{unit_text(unit) or '-'}]")
        columns.append([f"{factor * float(value):.4g}" for value in values])
    return text_table(heading, zip(*columns, strict=True))
