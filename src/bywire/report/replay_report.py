"""Report page of a replay: how well the model meets a measurement, stretch by stretch."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from matplotlib.figure import Figure

from bywire.bench.bench import Bench
from bywire.bench.kpis.kpi import Kpi
from bywire.identification.replaying.bench_replay import Replayed
from bywire.identification.replaying.fit import SegmentFit, undefined
from bywire.report.document import Banner, FigureBlock, Listing, Section, TableBlock
from bywire.report.files import save_figure
from bywire.report.page import write_page
from bywire.report.replay_figure import replay_figure
from bywire.report.subject import Subject
from bywire.report.tables import Cell, Column, Table
from bywire.report.wording import amount, clean, duration

_SHOWN = ("nrmse", "vaf", "max_error", "bias", "lag")


@dataclass(frozen=True)
class Replay:
    """A replay with what was made of it.

    Parameters
    ----------
    bench, source
        The model, and the measurement in one line.
    found, fits
        The replay and its figures.
    notes
        What was done to the measurement.
    tracked
        Figures of tracked parameters: file name -> figure and caption.
    """

    bench: Bench
    source: str
    found: Replayed
    fits: Sequence[SegmentFit]
    notes: Sequence[str] = ()
    tracked: Mapping[str, tuple[Figure, str]] = field(default_factory=dict)

    @property
    def holds(self) -> bool:
        """Whether every tolerance is met."""
        return all(v.met for fit in self.fits for v in fit.verdicts)

    @property
    def undefined(self) -> tuple[str, ...]:
        """Why figures are not defined."""
        return undefined(self.fits)

    @property
    def said(self) -> tuple[str, ...]:
        """All notes."""
        return (*self.notes, *self.found.notes, *self.undefined)


def fit_table(fits: Sequence[SegmentFit]) -> Table:
    """Return the figures of every signal and stretch, with the tolerances that are missed."""
    rows = []
    for fit in fits:
        by_name = {k.name: k for k in fit.kpis}
        missed = [
            f"{v.kpi} {v.limit}{' (not defined)' if math.isnan(v.value) else ''}"
            for v in fit.verdicts if not v.met
        ]  # fmt: skip
        verdict = Cell("-")
        if fit.verdicts:
            verdict = Cell(f"missed: {', '.join(missed)}", "bad") if missed else Cell("ok", "good")
        rows.append(
            (Cell(clean(fit.segment.name)), Cell(clean(fit.signal)),
             *(Cell(_figure(by_name[n])) for n in _SHOWN), verdict)
        )  # fmt: skip
    numbers = (Column(name.replace("_", " "), numeric=True) for name in _SHOWN)
    return Table(
        (Column("segment"), Column("signal"), *numbers, Column("tolerances")), tuple(rows)
    )


def _figure(kpi: Kpi) -> str:
    if kpi.unit == "s" and math.isfinite(kpi.value):
        return duration(kpi.value)
    return amount(kpi.value, kpi.unit, 3)


def write_replay(out: Path, one: Replay) -> list[Path]:
    """Write figures and page, and return their paths.

    Raises
    ------
    FileError
        When something cannot be written.
    """
    figures = {
        name: replay_figure(name, pair, one.found.inputs, [f for f in one.fits if f.signal == name])
        for name, pair in one.found.outputs.items()
    }
    judged = any(fit.verdicts for fit in one.fits)
    missed = sum(not v.met for fit in one.fits for v in fit.verdicts)
    banner = None
    if judged:
        text = f"{missed} tolerances are missed." if missed else "All tolerances are met."
        banner = Banner(text, "bad" if missed else "good")
    subject = Subject(
        one.bench.name or one.bench.experiment, one.bench.definition.summary,
        one.bench.parameters, one.found.run.par,
    )  # fmt: skip
    definitions = [f"{k.name}: {k.definition}" for k in one.fits[0].kpis] if one.fits else []
    sections = [
        Section("How well it fits", [TableBlock(fit_table(one.fits)), Listing(definitions)]),
        Section("Measured and simulated", [
            FigureBlock(figure, f"{name}: measured (solid), simulated (dashed), and their "
                                "difference; the demand above.")
            for name, figure in figures.items()
        ]),
        *([Section("Tracked parameters", [FigureBlock(f, c) for f, c in one.tracked.values()])]
          if one.tracked else []),
        subject.made(f"Measurement: {one.source}.",
             *(f"{note[:1].upper()}{note[1:]}." for note in one.said)),
    ]  # fmt: skip
    files = [save_figure(figure, out / f"{name}.png") for name, figure in figures.items()]
    files += [save_figure(f, out / f"{name}.png") for name, (f, _) in one.tracked.items()]
    title = f"Replay of {one.source}"
    return [*files, write_page(out / "report.html", title, subject.line, sections, banner=banner)]
