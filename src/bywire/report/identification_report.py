"""Report page of an identification: parameters, checks, curves, residuals, correlations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from matplotlib.figure import Figure

from bywire.core.parameters import ParameterSet
from bywire.identification.estimate import Estimate
from bywire.identification.method import Identified, Method
from bywire.report.correlation_matrix import correlation_matrix
from bywire.report.document import (
    Banner,
    Block,
    Details,
    FigureBlock,
    Listing,
    Paragraph,
    Section,
    TableBlock,
)
from bywire.report.estimate_tables import check_table, estimate_table, figure_table
from bywire.report.files import save_figure
from bywire.report.method_curve import method_curve
from bywire.report.page import write_page
from bywire.report.parameter_rows import parameter_rows
from bywire.report.residual_figure import residual_figure
from bywire.report.subject import Subject
from bywire.report.tables import parameter_table


@dataclass(frozen=True)
class Identification:
    """An identification with all that went into it.

    Parameters
    ----------
    method, options, found
        How it was done, and what came out.
    source
        The measurement in one line.
    notes
        What was done to the measurement.
    subject
        The brake and its parameters; None for a method without an assembly.
    idle
        Options that had nothing to do: what only shapes simulated experiments.
    start
        Values from which the search began, by the estimates' labels, SI.
    put_in
        What a simulated measurement is made of, likewise; empty for a measured one.
    """

    method: Method
    options: ParameterSet
    found: Identified
    source: str
    notes: Sequence[str] = ()
    subject: Subject | None = None
    idle: Sequence[str] = ()
    start: Mapping[str, float] = field(default_factory=dict)
    put_in: Mapping[str, float] = field(default_factory=dict)

    @property
    def holds(self) -> bool:
        """Whether every check holds."""
        return all(check.holds for check in self.found.checks)


def write_identification(out: Path, one: Identification) -> list[Path]:
    """Write figures and page, and return their paths.

    Parameters
    ----------
    out
        Folder.
    one
        What is reported.

    Raises
    ------
    FileError
        When something cannot be written.
    """
    figures: dict[str, Figure] = {c.name: method_curve(c) for c in one.found.curves}
    sections = [
        Section("Parameters", _parameters(one)),
        *([Section("Curves", [FigureBlock(figures[c.name], c.caption) for c in one.found.curves])]
          if figures else []),
        Section("Residuals", _residuals(one, figures)),
        Section("Correlations", _correlations(one, figures)),
        Section("Data", [Paragraph(f"Measurement: {one.source}."),
                         *([Listing(one.notes)] if one.notes else [])]),
        _made(one),
    ]  # fmt: skip
    files = [save_figure(figure, out / f"{name}.png") for name, figure in figures.items()]
    page = write_page(
        out / "report.html",
        f"Identification {one.method.name}",
        one.method.summary if one.subject is None else one.subject.line,
        sections,
        banner=_banner(one),
    )
    return [*files, page]


def _banner(one: Identification) -> Banner:
    failed = [check.name for check in one.found.checks if not check.holds]
    untold = [k.unknown.label for e in one.found.estimates.values() for k in e.kept]
    if failed:
        return Banner(f"Do not use it as it is: {', '.join(failed)} failed.", "bad")
    if untold:
        return Banner(f"All checks hold; not told by the data: {', '.join(untold)}.", "none")
    return Banner("All checks hold.", "good")


def _parameters(one: Identification) -> list[Block]:
    blocks: list[Block] = []
    for name, estimate in one.found.estimates.items():
        table = estimate_table(estimate, one.start, one.put_in)
        blocks.append(TableBlock(table, f"{_capital(name)}."))
        said = [f"{k.unknown.label} is not told by the data: {k.reason}." for k in estimate.kept]
        said += [f"{_capital(text)}." for text in estimate.notes]
        blocks += [Listing(said)] if said else []
    if one.found.figures:
        blocks.append(TableBlock(figure_table(one.found), "Further results."))
    if one.found.checks:
        blocks.append(TableBlock(check_table(one.found.checks), "Whether to believe it."))
    if one.found.notes:
        blocks.append(Listing([f"{_capital(text)}." for text in one.found.notes]))
    return blocks


def _residuals(one: Identification, figures: dict[str, Figure]) -> list[Block]:
    blocks: list[Block] = []
    for key, (name, estimate) in _keyed("residuals", one.found.estimates).items():
        if estimate.residuals.size < 2:
            continue
        figures[key] = residual_figure(estimate)
        blocks.append(FigureBlock(figures[key], _residual_caption(name, estimate)))
    return blocks


def _residual_caption(name: str, estimate: Estimate) -> str:
    follows = (
        "Neighbors go together: what the model misses lasts longer than a sample, and the "
        "intervals allow for that"
        if estimate.colored
        else "Neighbors are independent, as noise is"
    )
    return (
        f"{_capital(name)}: residuals of {estimate.residuals.size} measured values, root mean "
        f"square {estimate.rms:.3g}. {follows}."
    )


def _correlations(one: Identification, figures: dict[str, Figure]) -> list[Block]:
    blocks: list[Block] = []
    for key, (name, estimate) in _keyed("correlation", one.found.estimates).items():
        if len(estimate.unknowns) < 2:
            continue
        figures[key] = correlation_matrix(estimate)
        caption = (
            f"{_capital(name)}: correlations of the estimates. Near 1 or -1 the data tells a "
            "combination of the two rather than either."
        )
        blocks.append(FigureBlock(figures[key], caption))
    return blocks or [Paragraph("One unknown alone has no correlations.")]


def _keyed(
    kind: str, estimates: Mapping[str, Estimate]
) -> dict[str, tuple[str, Estimate]]:
    """Return estimates by the file name of their figure."""
    several = len(estimates) > 1
    return {
        f"{kind}-{k}" if several else kind: (name, estimate)
        for k, (name, estimate) in enumerate(estimates.items(), 1)
    }


def _made(one: Identification) -> Section:
    rows = [r for r in parameter_rows(one.options) if r.name.split(".")[0] not in one.idle]
    chosen = Details(
        "Options of the method", [TableBlock(parameter_table(rows))]
    )
    if one.subject is None:
        return Section("How it was made", [Paragraph(one.method.summary), chosen])
    section = one.subject.made(f"Method {one.method.name}: {one.method.summary}.")
    return Section(section.title, [*section.blocks, chosen])


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
