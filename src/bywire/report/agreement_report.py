"""Tables, figure and report page of the agreement of nonlinear and linear responses."""

from __future__ import annotations

import math
from pathlib import Path

from bywire.analysis.agreement import EVERYTHING, GAIN, LIMITS, NOTHING, PHASE, Agreement
from bywire.report.differences import differences
from bywire.report.document import Banner, FigureBlock, Paragraph, Section, TableBlock
from bywire.report.files import save_figure
from bywire.report.page import write_page
from bywire.report.subject import Subject
from bywire.report.tables import Table, text_table
from bywire.report.wording import amount

LABELS = {NOTHING: "nothing, small amplitude", LIMITS: "limits", EVERYTHING: "everything"}
"""what a reader calls what is left on"""
STEP = "step (computed)"
"""what a reader calls the error of the simulation's step"""
LEGEND = (
    "Nonlinear response less the exact linear one, by what is left on; all rows but the first "
    "with the large amplitude, at which limits of currents, voltages and rates act too. "
    "-: the output sticks or does not settle. Largest: what has no number, else the cause that "
    "moves the response most, limits alone, others by what they add to the limits. "
    "Step: linear model of the simulation's midpoint rule less the exact one."
)
"""how to read the table"""


def verdict(found: Agreement) -> str:
    """Return whether the responses agree with everything off, as a text with the limits."""
    state = "agree" if found.holds else "DO NOT agree"
    gain = max(map(abs, found.gain[NOTHING].tolist()))
    phase = max(map(abs, found.phase[NOTHING].tolist()))
    return (
        f"with everything off both responses {state}: largest differences {gain:.2g} dB and "
        f"{phase:.2g}° (at most {GAIN:g} dB and {PHASE:g}°)"
    )


def agreement_table(found: Agreement) -> Table:
    """Return the differences, a row for what is left on, and the largest cause by frequency."""
    heading = ["left on", *(amount(float(f), "Hz", 3) for f in found.frequencies)]
    rows = [
        [LABELS.get(cause, cause), *map(_cell, found.gain[cause], found.phase[cause])]
        for cause in found.gain
    ]
    rows.append([STEP, *map(_cell, found.step_gain, found.step_phase)])
    return text_table(heading, [*rows, ["largest", *(one or "-" for one in found.largest)]])


def write_agreement(
    out: Path, subject: Subject, amplitudes: tuple[str, str], found: Agreement
) -> list[Path]:
    """Write the figure and the page, and return the files.

    Parameters
    ----------
    out
        Folder.
    subject
        The loop.
    amplitudes
        Small and large amplitude, as texts.
    found
        The differences.

    Raises
    ------
    FileError
        When a file cannot be written.
    """
    small, large = amplitudes
    sizes = {
        LABELS.get(cause, cause): (
            (found.gain[cause], found.phase[cause])
            if cause in LABELS
            else found.beyond_limits(cause)
        )
        for cause in found.gain
    }
    figure = differences(found.frequencies, sizes, (GAIN, PHASE))
    picture = save_figure(figure, out / f"{subject.name}-agreement.png")
    caption = (
        "Size of the differences from the exact linear response; of single causes, what they add "
        "to the limits. Smaller ones than shown lie at the lower edge."
    )
    text = verdict(found)
    sections = [
        Section("Differences", [FigureBlock(figure, caption), TableBlock(agreement_table(found)),
                                Paragraph(LEGEND)]),
        subject.made(f"Small amplitude {small}, large amplitude {large}."),
    ]  # fmt: skip
    page = write_page(
        out / "report.html", f"Agreement of loop {subject.name}", subject.line, sections,
        banner=Banner(text[0].upper() + text[1:], "good" if found.holds else "bad"),
    )  # fmt: skip
    return [picture, page]


def _cell(gain: float, phase: float) -> str:
    if not (math.isfinite(gain) and math.isfinite(phase)):
        return "-"
    return f"{round(gain, 3) + 0.0:+.3f} dB {round(phase, 2) + 0.0:+.2f}°"  # never -0
