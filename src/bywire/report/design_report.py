"""Figures and report page of a loop's design."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bywire.report.design_curves import DesignCurve, loop_gains, sensitivities, steps
from bywire.report.document import Banner, FigureBlock, Flat, Listing, Section, TableBlock
from bywire.report.files import save_figure
from bywire.report.page import write_page
from bywire.report.subject import Subject
from bywire.report.tables import Table
from bywire.synthesis.requirement import Requirement


@dataclass(frozen=True)
class Outcome:
    """What became of the requirements, in words, and whether all are met."""

    text: str
    met: bool


def write_design(
    out: Path,
    subject: Subject,
    requirements: Sequence[Requirement],
    outcome: Outcome,
    curves: Sequence[DesignCurve],
    parts: Sequence[str | Table],
) -> list[Path]:
    """Write the figures and one page, and return the files.

    Parameters
    ----------
    out
        Folder.
    subject
        The loop with the parameters before the design.
    requirements
        What was required.
    outcome
        What became of it.
    curves
        Gains before and after on the nominal linear model, at most three.
    parts
        Tables and sentences of the result, in their order.

    Raises
    ------
    FileError
        When a file cannot be written.
    """
    limits = {(one.figure, one.sense): one.limit for one in requirements}
    drawn = (
        ("loop-gain", loop_gains(curves, limits.get(("phase_margin", 1))),
         "Loop gain of the nominal linear model; phase margins as the spans in which they are "
         "read."),
        ("sensitivity", sensitivities(curves),
         "Sensitivity S = 1/(1 + L) and complementary sensitivity T = L/(1 + L), with the limits "
         "that are usually asked for (Skogestad and Postlethwaite, section 2.4.3)."),
        ("step", steps(curves, limits.get(("overshoot", -1))),
         "Unit step of the nominal linear model, at the sampling instants."),
    )  # fmt: skip
    files = [
        save_figure(figure, out / f"{subject.name}-design-{name}.png") for name, figure, _ in drawn
    ]
    sections = [
        Section("Requirements", [Listing([one.text for one in requirements])]),
        Section("Result", _blocks(parts)),
        Section("Figures", [FigureBlock(figure, text) for _, figure, text in drawn]),
        subject.made("Parameters as they were before the design."),
    ]
    banner = Banner(outcome.text, "good" if outcome.met else "bad")
    title = f"Design of loop {subject.name}"
    page = write_page(out / "report.html", title, subject.line, sections, banner=banner)
    return [*files, page]


def _blocks(parts: Sequence[str | Table]) -> list[Flat]:
    """Return tables, and the sentences between them as lists."""
    blocks: list[Flat] = []
    lines: list[str] = []
    for one in [*parts, None]:
        if isinstance(one, str):
            lines.append(one.strip())
            continue
        if lines:
            blocks.append(Listing(lines))
            lines = []
        if one is not None:
            blocks.append(TableBlock(one))
    return blocks
