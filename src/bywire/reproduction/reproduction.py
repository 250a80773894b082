"""What the reproduction of a source consists of, and its statements as tables."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import xarray as xr

from bywire.bench.running import Progress
from bywire.core.interrupts import thread_pool
from bywire.core.machine import worker_count
from bywire.core.registry import Kind, instances
from bywire.report.answer import Answer
from bywire.report.document import (
    Banner,
    Block,
    Details,
    Document,
    FigureBlock,
    Flat,
    Listing,
    Paragraph,
    Section,
    TableBlock,
    recording_file,
)
from bywire.report.tables import (
    ReproductionRow,
    Table,
    reproduction_table,
    text_table,
    verdict_table,
)
from bywire.report.wording import amount
from bywire.reproduction.item import SHARE, Allowance, Item
from bywire.reproduction.root_cause import RootCause
from bywire.reproduction.runs import Runs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = (
    "Kinds of statements: 'printed' stands in the source's text, tables or equations, or follows "
    "from printed numbers by an equation that the note names; 'reading' is a sentence of the "
    "source that we put as a number, as its note says; 'axis' is the end of a figure's axis, "
    "beyond which the source shows nothing; 'requirement' is one on the design; 'physical "
    "bound' is a limit that we derive; 'ours' is a number without a counterpart. No verdict is "
    "given where nothing is stated, where a value was tuned to the statement, where it went in "
    "as an input, or where another statement is judged instead."
)


def statements(items: Sequence[Item]) -> Table:
    """Return statements as one table."""
    return reproduction_table(map(reproduction_row, items))


def reproduction_row(item: Item) -> ReproductionRow:
    """Return a statement as the row of a table."""
    return ReproductionRow(
        id=item.id,
        stated=item.stated,
        computed=item.computed,
        unit=item.unit,
        tolerance=item.tolerance,
        agrees=item.agrees,
        note=item.note,
        kind=item.kind,
    )


def verdicts(items: Sequence[Item]) -> Table:
    """Return statements as one table for terminals: numbers and verdicts without notes."""
    return verdict_table(map(reproduction_row, items))


def tolerances(allowances: Sequence[Allowance]) -> Table:
    """Return the tolerances in use with their reasons."""
    return text_table(
        ("compared", "tolerance", "reason"),
        [(a.what, _size(a), a.reason) for a in allowances],
    )


def _size(allowance: Allowance) -> str:
    if allowance.unit == SHARE:
        return f"{100.0 * allowance.size:g} % of what is stated"
    return amount(allowance.size, allowance.unit)


@dataclass(frozen=True)
class Tally:
    """Numbers of verdicts."""

    agree: int
    disagree: int
    silent: int

    def __str__(self) -> str:
        return f"{self.agree} agree, {self.disagree} disagree, {self.silent} without verdict"


def tally(items: Iterable[Item]) -> Tally:
    """Count the verdicts."""
    verdicts = [item.agrees for item in items]
    return Tally(verdicts.count(True), verdicts.count(False), verdicts.count(None))


def tallies(items: Iterable[Item]) -> dict[str, Tally]:
    """Count the verdicts of each parameter set, by what follows ``@`` in the ids."""
    listed = list(items)
    names = dict.fromkeys(item.parameter_set for item in listed)
    return {name: tally(i for i in listed if i.parameter_set == name) for name in names}


# --- Reproductions

_THREADS = 4  # more would wait for each other's Python


@dataclass(frozen=True, eq=False)
class Exhibit:
    """A figure, or what draws it once it is shown, with a name for its file and a caption."""

    name: str
    figure: Figure | Callable[[], Figure]
    caption: str


@dataclass(frozen=True, eq=False)
class Part:
    """A table or a figure of the source, reproduced.

    Parameters
    ----------
    title
        Heading in the report.
    text
        What was done and what came out, for the report.
    items
        Statements beside computed numbers.
    exhibits
        Figures.
    recordings
        Runs worth keeping, by the name of their file.
    appendix
        Tables that stay folded in the report, by title.
    tables
        Tables that report and terminal show, by title: there in place of the items' verdicts.
    """

    title: str
    text: str
    items: tuple[Item, ...]
    exhibits: tuple[Exhibit, ...] = ()
    recordings: Mapping[str, xr.Dataset] = field(default_factory=dict)
    appendix: Mapping[str, Table] = field(default_factory=dict)
    tables: Mapping[str, Table] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Reproduction(Answer):
    """A source, reproduced.

    Parameters
    ----------
    source
        Name of the source.
    citation
        Full citation.
    parts
        Its tables and figures.
    causes
        Why statements disagree, the gravest cause first.
    allowances
        The tolerances in use, with their reasons.
    sets
        What to call the parameter sets, by what follows ``@`` in an item's id.
    """

    source: str
    citation: str
    parts: tuple[Part, ...] = ()
    causes: tuple[RootCause, ...] = ()
    allowances: tuple[Allowance, ...] = ()
    sets: Mapping[str, str] = field(default_factory=dict)

    @property
    def items(self) -> tuple[Item, ...]:
        """All statements, in the order of the source."""
        return tuple(item for part in self.parts for item in part.items)

    @property
    def figures(self) -> tuple[Exhibit, ...]:
        """All figures."""
        return tuple(exhibit for part in self.parts for exhibit in part.exhibits)

    @property
    def recordings(self) -> dict[str, xr.Dataset]:
        """All recordings by name."""
        return {name: kept for part in self.parts for name, kept in part.recordings.items()}

    @property
    def in_short(self) -> list[str]:
        """Why it disagrees, a sentence each, then how often, for each parameter set."""
        lines = []
        for cause in self.causes:
            number = len(cause.explained(self.items))
            plural = "" if number == 1 else "s"
            lines.append(f"{cause.text} [{number} disagreement{plural}]")
        return lines + [
            f"{self.sets.get(name, f'@{name}' if name else 'Main set')}: {counted}."
            for name, counted in tallies(self.items).items()
        ]

    def document(self) -> Document:
        """Return statements beside computed numbers, part by part, and what disagrees."""
        short = Listing(self.in_short)
        hint = f"bywire reproduce {self.source} --out FOLDER"
        return Document(
            f"Reproduction of {self.source}",
            self.citation,
            sections=lambda: self._sections(short),
            brief=[
                *self._tables(),
                "In short",
                short,
                "",
                f"Report with notes, tolerances and figures: {hint}",
            ],
            data=self._data(),
            banner=Banner(f"All statements together: {tally(self.items)}"),
            attachments=[
                recording_file(f"{_stem(name)}.nc", recording)
                for name, recording in self.recordings.items()
            ],
            record="results.json",
        )

    def _tables(self) -> list[str | Flat]:
        """Return what a terminal shows: parts' own tables, and the verdicts of all others."""
        rest = [item for part in self.parts if not part.tables for item in part.items]
        lines: list[str | Flat] = [TableBlock(verdicts(rest)), ""] if rest else []
        for title, table in (pair for part in self.parts for pair in part.tables.items()):
            lines += [title, TableBlock(table), ""]
        return lines

    def _sections(self, short: Listing) -> list[Section]:
        apart = [item for item in self.items if item.agrees is False]
        sections = [Section("In short", [short, Paragraph(KINDS)])]
        sections += [Section("Disagreements", [TableBlock(statements(apart))])] if apart else []
        for part in self.parts:
            blocks: list[Block] = [Paragraph(part.text)]
            blocks += [FigureBlock(e.figure, e.caption, _stem(e.name)) for e in part.exhibits]
            blocks += [TableBlock(table, f"{title}.") for title, table in part.tables.items()]
            blocks += [TableBlock(statements(part.items))] if part.items else []
            blocks += [Details(title, [TableBlock(t)]) for title, t in part.appendix.items()]
            sections.append(Section(part.title, blocks))
        if self.allowances:
            sections.append(Section("Tolerances", [TableBlock(tolerances(self.allowances))]))
        return sections

    def _data(self) -> dict[str, Any]:
        """Return the JSON object.

        What is not stated, not computed or not defined is None; a tolerance is a number in the
        item's unit, or ``"<="`` or ``">="`` where the statement is a bound. The note ends with the
        kind of statement.
        """
        return {
            "source": self.source,
            "items": [
                {
                    "id": item.id,
                    "unit": item.unit,
                    "stated": item.stated,
                    "computed": item.computed,
                    "tolerance": item.tolerance,
                    "agrees": item.agrees,
                    "note": f"{item.note}; " * bool(item.note) + f"kind: {item.kind}",
                }
                for item in self.items
            ],
            "in_short": self.in_short,
        }


@dataclass(frozen=True)
class Source:
    """A source that can be reproduced.

    Parameters
    ----------
    name
        What the command line calls it.
    summary
        One line for listings.
    reproduce
        ``reproduce(progress) -> Reproduction``; ``progress`` is called with the label of a piece
        of work and its finished share, 0 to 1, or is None.
    """

    name: str
    summary: str
    reproduce: Callable[[Progress | None], Reproduction]


def reproduced(
    source: Reproduction,
    runs: Runs,
    parts: Mapping[str, Callable[[Any], Part]],
    causes: Callable[[tuple[Item, ...]], tuple[RootCause, ...]],
) -> Reproduction:
    """Return a source with its parts, made in threads, and why they disagree.

    Parts wait for kernels half of their time, which other parts use.

    Parameters
    ----------
    source
        The source, without parts.
    runs
        Bench results that the parts share; told of the progress.
    parts
        ``part(runs)`` by the label of its table, figure or test.
    causes
        ``causes(items)``.

    Raises
    ------
    RunError
        When a run fails.
    KeyboardInterrupt
        When interrupted.
    """

    def made(label: str) -> Part:
        runs.report(label, 0.0)
        part = parts[label](runs)
        runs.report(label, 1.0)
        return part

    with thread_pool(worker_count(most=_THREADS)) as pool:
        jobs = [pool.submit(made, label) for label in parts]
        finished = tuple(job.result() for job in jobs)
    whole = replace(source, parts=finished)
    return replace(whole, causes=causes(whole.items))


SOURCES = Kind("source", ("paper",), instances(Source), declared="a Source")
"""every source that can be reproduced"""


def _stem(name: str) -> str:
    """Return the name of a file, without what file systems dislike."""
    return re.sub(r"[^A-Za-z0-9.-]+", "-", name)
