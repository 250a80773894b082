"""Figures and report page of the margins of a loop."""

from __future__ import annotations

from pathlib import Path

from bywire.analysis.loop_curves import Family
from bywire.report.files import save_figure
from bywire.report.loop_gain import loop_gain
from bywire.report.margins_table import LEGEND, margins_table, worst_texts
from bywire.report.nichols import nichols
from bywire.report.nyquist import nyquist
from bywire.report.page import Banner, FigureBlock, Listing, Paragraph, Section, TableBlock
from bywire.report.page import write_page as write
from bywire.report.sensitivity import sensitivity
from bywire.report.subject import Subject, made

_FIGURES = {
    "loop-gain": (
        loop_gain,
        "Loop gain as it is sampled; phase and gain margin as the spans in which they are read.",
    ),
    "nyquist": (
        nyquist,
        "Nyquist plot near -1; the shaded disk is what the disk margin keeps free.",
    ),
    "nichols": (
        nichols,
        "Nichols chart with contours of |T|; shaded, what the disk margin keeps free.",
    ),
    "sensitivity": (
        sensitivity,
        "Sensitivity S = 1/(1 + L) and complementary sensitivity T = L/(1 + L), with the limits "
        "that are usually asked for (Skogestad and Postlethwaite, section 2.4.3).",
    ),
}


def write_margins(out: Path, subject: Subject, cut: str, family: Family) -> list[Path]:
    """Write the figures and one page, and return the files.

    Parameters
    ----------
    out
        Folder.
    subject
        The loop.
    cut
        Where it is cut open.
    family
        Loop gains with their margins.

    Raises
    ------
    FileError
        When a file cannot be written.
    """
    found = [curve.margins for curve in family.curves]
    drawn = [(name, draw(family), text + _worst(family)) for name, (draw, text) in _FIGURES.items()]
    files = [save_figure(fig, out / f"{subject.name}-{name}.png") for name, fig, _ in drawn]
    table = margins_table(found, family.name, family.unit, family.values)
    numbers = Section("Margins", [TableBlock(table), Paragraph(LEGEND)])
    if family.name:
        texts = worst_texts(found, family.name, family.unit, family.values)
        numbers = Section(
            "Margins", [Paragraph("Worst of each:"), Listing(texts), *numbers.blocks]
        )  # fmt: skip
    sections = [
        numbers,
        Section("Figures", [FigureBlock(figure, text) for _, figure, text in drawn]),
        made(subject, f"Exact linear model of the sampled loop, cut at {cut}."),
    ]
    page = out / "report.html"
    title = f"Margins of loop {subject.name}"
    files.append(write(page, title, subject.line, sections, banner=_banner(family)))
    return files


def _worst(family: Family) -> str:
    if not family.name:
        return ""
    return " Emphasized: the least disk margin, or what is unstable. Dashed: unstable loops."


def _banner(family: Family) -> Banner:
    unstable = sum(not curve.margins.stable for curve in family.curves)
    if unstable:
        count = f"{unstable} of {len(family.curves)} loops unstable" if family.name else "unstable"
        return Banner(count, "bad")
    return Banner("stable over the whole range" if family.name else "stable", "good")
