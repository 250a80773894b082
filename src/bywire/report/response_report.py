"""Report page of a measured frequency response."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from bywire.report.document import Block, FigureBlock, Listing, Section, TableBlock
from bywire.report.page import write_page
from bywire.report.subject import Subject
from bywire.report.tables import Table


def write_response(
    out: Path,
    subject: Subject,
    figure: Figure,
    table: Table,
    notes: Sequence[str],
    method: str,
    more: Sequence[Block] = (),
) -> Path:
    """Write the page and return it.

    Parameters
    ----------
    out
        Folder.
    subject
        The loop.
    figure
        Bode plot of the linear response and the measured ones.
    table
        Gain and phase by frequency and amplitude.
    notes
        What the reader should know: what stuck, what never repeated.
    method
        How it was measured, a sentence.
    more
        What is said of bandwidths.

    Raises
    ------
    FileError
        When it cannot be written.
    """
    heed = [Listing(notes)] if notes else []
    caption = "Closed loop: the exact linear response without friction, and the nonlinear ones."
    sections = [
        Section("Response", [*heed, FigureBlock(figure, caption)]),
        *([Section("Bandwidth by amplitude", more)] if more else []),
        Section("Numbers", [TableBlock(table, "Gain and phase by frequency and amplitude.")]),
        subject.made(method),
    ]
    return write_page(
        out / "report.html", f"Frequency response of loop {subject.name}", subject.line, sections
    )
