"""Figures and report pages of a plant: its linear model, or its poles over a range."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.locus import Locus
from bywire.report.document import Block, FigureBlock, Listing, Paragraph, Section, TableBlock
from bywire.report.files import save_figure
from bywire.report.linearize_report import locus_texts
from bywire.report.page import write_page as write
from bywire.report.plant_figures import plant_figures
from bywire.report.rate_table import left_out, rate_table
from bywire.report.root_locus import root_locus
from bywire.report.subject import Subject


def write_plant(
    out: Path,
    subject: Subject,
    models: Mapping[str, LinearModel],
    band: float,
    notes: Sequence[str],
) -> list[Path]:
    """Write a figure for every output and one page, and return the files.

    Parameters
    ----------
    out
        Folder.
    subject
        The plant.
    models
        Label -> model, of the same inputs and outputs.
    band
        End of the frequencies [Hz].
    notes
        What is said of the models, such as their errors.

    Raises
    ------
    FileError
        When a file cannot be written.
    """
    drawn = plant_figures(models, band)
    files = [save_figure(figure, out / f"{subject.name}-{name}.png") for name, figure in drawn]
    poles: list[Block] = []
    for label, model in models.items():
        poles.append(TableBlock(rate_table(model), f"Poles of {label}, slowest first."))
        poles += [Paragraph(text) for text in left_out(model)]
    figures = [FigureBlock(figure, f"Frequency response of {name}.") for name, figure in drawn]
    sections = [
        Section("Poles", [*([Listing(notes)] if notes else []), *poles]),
        Section("Figures", figures or [Paragraph("No output answers the first input.")]),
        subject.made("Exact linear model of the plant, sources in place of its controllers."),
    ]
    page = out / "report.html"
    return [*files, write(page, f"Linear model of {subject.name}", subject.line, sections)]


def write_plant_locus(out: Path, subject: Subject, found: Locus) -> list[Path]:
    """Write the root locus of a plant and its page, and return the files.

    Raises
    ------
    FileError
        When a file cannot be written.
    """
    figure = root_locus(found, math.nan)
    file = save_figure(figure, out / f"{subject.name}-locus.png")
    caption = f"Poles against {found.name}."
    sections = [
        Section(f"Stability over {found.name}", [Listing(locus_texts(found))]),
        Section("Figures", [FigureBlock(figure, caption)]),
        subject.made("Exact linear model of the plant, sources in place of its controllers."),
    ]
    title = f"Root locus of {subject.name}"
    return [file, write(out / "report.html", title, subject.line, sections)]
