"""Figures and report page of the linear model of a closed loop."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from bywire.analysis.crossings import bandwidth
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.rates import rates
from bywire.analysis.locus import Locus
from bywire.analysis.periodic.averaged_map import PeriodicModel
from bywire.report.bode import Response, bode
from bywire.report.document import (
    Banner,
    Block,
    FigureBlock,
    Listing,
    Paragraph,
    Section,
    TableBlock,
)
from bywire.report.files import save_figure
from bywire.report.page import write_page
from bywire.report.pole_map import pole_map
from bywire.report.rate_table import left_out, rate_table
from bywire.report.root_locus import border_text, root_locus
from bywire.report.subject import Subject
from bywire.report.wording import unit_text

_LOWEST = 1e-2  # lower end of what is searched for the bandwidth, Hz
_NYQUIST = 0.998  # of half the sampling frequency
_POINTS = 600
_DEPTH = 80.0  # of the closed loop's gain that is shown, dB


def own_bandwidth(model: LinearModel) -> float:
    """Return the -3 dB bandwidth of a closed loop [Hz]; NaN for an unstable one."""
    if not model.is_stable:
        return math.nan
    return bandwidth(lambda f: model.response(f)[:, 0, 0], (_LOWEST, _NYQUIST * model.nyquist))


def write_model(
    out: Path,
    subject: Subject,
    model: LinearModel,
    found: Locus | None,
    widest: float,
    shaken: tuple[PeriodicModel, str] | None = None,
) -> list[Path]:
    """Write the figures and one page, and return the files.

    Parameters
    ----------
    out
        Folder.
    subject, model
        The loop and its linear model, sampled.
    found
        Root locus; None where none is asked for.
    widest
        Largest bandwidth over the locus [Hz].
    shaken
        The loop about its motion under dither, and what is said of that; None for none.

    Raises
    ------
    FileError
        When a file cannot be written.
    """
    width = own_bandwidth(model)
    drawn: list[tuple[str, Figure, str]] = [
        ("poles", pole_map(rates(model), model.period, width),
         "Poles of the closed loop as rates; rays of equal damping ratio, circles of equal "
         "frequency, the unstable half shaded, f_s the sampling frequency. Pairs are shown by one "
         "of them."),
        ("closed-loop", _response(model, width, shaken),
         "Frequency response of the closed loop, down to 80 dB below its largest gain."),
    ]  # fmt: skip
    if found is not None:
        drawn.append(
            ("locus", root_locus(found, widest),
             f"Poles of the closed loop against {found.name}.")
        )  # fmt: skip
    files = [save_figure(figure, out / f"{subject.name}-{name}.png") for name, figure, _ in drawn]
    blocks: list[Block] = [TableBlock(rate_table(model), "Poles, slowest first.")]
    blocks += [Paragraph(text) for text in left_out(model)]
    if shaken is not None:
        caption = "Poles with friction and dither, averaged over a dither period, slowest first."
        own = shaken[0].averaged
        blocks += [Paragraph(shaken[1]), TableBlock(rate_table(own), caption)]
        blocks += [Paragraph(text) for text in left_out(own)]
    if found is not None:
        texts = locus_texts(found)
        blocks += [Paragraph(f"Stability over {found.name}:"), Listing(texts)]
    sections = [
        Section("Poles", blocks),
        Section("Figures", [FigureBlock(figure, text) for _, figure, text in drawn]),
        subject.made(f"Exact linear model, sampled with {model.period * 1e3:g} ms: plant, filters "
             "and controllers, dry friction left out."),
    ]  # fmt: skip
    banner = Banner("stable", "good") if model.is_stable else Banner("unstable", "bad")
    title = f"Linear model of closed loop {subject.name}"
    return [*files, write_page(out / "report.html", title, subject.line, sections, banner=banner)]


def locus_texts(found: Locus) -> list[str]:
    """Return where over its range a loop is stable, a text each."""
    if not found.borders:
        state = "stable" if found.stable.all() else "unstable"
        return [f"{state} at all {len(found.values)} values"]
    return [border_text(border, found.name, found.unit) for border in found.borders]


def _response(
    model: LinearModel, width: float, shaken: tuple[PeriodicModel, str] | None
) -> Figure:
    low = 0.01 * width if math.isfinite(width) else 1e-4 / model.period
    f = np.geomspace(low, _NYQUIST * model.nyquist, _POINTS)
    (taken,), (given,) = model.input_units, model.output_units
    unit = "1" if taken == given else f"{unit_text(given) or '1'}/{unit_text(taken) or '1'}"
    label = "closed loop" if shaken is None else "without friction"
    lines = [Response(label, f, model.response(f)[:, 0, 0])]
    if shaken is not None:
        lines.append(Response("with friction and dither", f, shaken[0].response(f)))
    marks = {f"bandwidth {width:.3g} Hz": width} if math.isfinite(width) else {}
    return bode(lines, gain_unit=unit, marks=marks, depth=_DEPTH)
