"""Reproduction of a source: its parts, their shared runs, tables and report."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bywire.bench.bench import Bench
from bywire.bench.running import Progress, Result, run
from bywire.core.arguments import checked
from bywire.core.interrupts import raise_if_stopped, thread_pool
from bywire.core.machine import worker_count
from bywire.core.registry import Kind, instances
from bywire.report.answer import Answer
from bywire.report.document import (
    Banner,
    Block,
    Details,
    Document,
    FigureBlock,
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
from bywire.reproduction.item import SHARE, Allowance, Item, RootCause

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


class Runs:
    """Bench results, each computed once; threads that need the same result wait for it.

    Parameters
    ----------
    progress
        Called with the label of a piece of work and its finished share, 0 to 1.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress
        self._known: dict[str, Future[Result]] = {}
        self._lock = threading.Lock()

    def report(self, label: str, share: float) -> None:
        """Report the progress of a piece of work."""
        if self._progress is not None:
            self._progress(label, share)

    def bench(
        self,
        experiment: str,
        name: str,
        overrides: Mapping[str, Any] | None = None,
        options: Mapping[str, Any] | None = None,
        stimulus: Mapping[str, Any] | None = None,
    ) -> Result:
        """Return the result of an experiment with a parameter set.

        Parameters
        ----------
        experiment, name
            Names of experiment and parameter set.
        overrides, options, stimulus
            As in `Bench`.

        Raises
        ------
        RunError
            When a run fails.
        KeyboardInterrupt
            When the user stopped a run, or another part failed.
        """
        bench = Bench(experiment, name, overrides or {}, options or {}, stimulus or {})
        values = (bench.par.flat(), bench.chosen_options.flat(), bench.chosen_stimuli)
        key = repr((experiment, name, *values))  # a default that is stated is the same run
        with self._lock:
            is_first = key not in self._known
            result = self._known.setdefault(key, Future())
        if is_first:
            try:
                result.set_result(self._run(bench))
            except BaseException as error:
                result.set_exception(error)
        return result.result()

    def _run(self, bench: Bench) -> Result:
        raise_if_stopped()
        result = run(bench)
        if result.status == "interrupted":
            raise KeyboardInterrupt
        return result


@checked
def kpis(result: Result) -> dict[str, float]:
    """Return the KPIs of a result by name, SI."""
    return {kpi.name: kpi.value for kpi in result.kpis}


def selected(recording: xr.Dataset, *names: str) -> xr.Dataset:
    """Return a recording with only the listed variables that it has."""
    return recording[[name for name in names if name in recording]]


def peak(recording: xr.Dataset, name: str) -> float:
    """Return the maximum of a signal."""
    return float(np.max(recording[name].values))


# --- Published values as tables

_KINDS = (
    "Kinds of values: 'printed' is in the source's text, tables or equations, or follows from "
    "printed numbers by an equation in the note. 'reading' is a sentence of the source that we "
    "interpret as a number (see its note). 'axis' is the end of a figure's axis, beyond which the "
    "source shows nothing. 'requirement' is a design requirement. 'physical bound' is a limit "
    "that we derive. 'ours' is a number without a counterpart in the source. A value has no "
    "verdict if the source publishes none, if it is an input or was tuned to match the source, or "
    "if the verdict belongs to another value."
)


def statements(items: Sequence[Item]) -> Table:
    """Return statements as one table."""
    return reproduction_table(map(_reproduction_row, items))


def _reproduction_row(item: Item) -> ReproductionRow:
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
    return verdict_table(map(_reproduction_row, items))


def tolerances(allowances: Sequence[Allowance]) -> Table:
    """Return the tolerances with their reasons."""
    return text_table(
        ("compared", "tolerance", "reason"),
        [(a.what, _size(a), a.reason) for a in allowances],
    )


def _size(allowance: Allowance) -> str:
    if allowance.unit == SHARE:
        return f"{100.0 * allowance.size:g} % of the stated value"
    return amount(allowance.size, allowance.unit)


@dataclass(frozen=True)
class Tally:
    """Counts of verdicts."""

    agree: int
    disagree: int
    silent: int

    def __str__(self) -> str:
        return f"{self.agree} agree, {self.disagree} disagree, {self.silent} without verdict"


def _tally(items: Iterable[Item]) -> Tally:
    """Count the verdicts."""
    verdicts = [item.agrees for item in items]
    return Tally(verdicts.count(True), verdicts.count(False), verdicts.count(None))


def tallies(items: Iterable[Item]) -> dict[str, Tally]:
    """Count the verdicts of each parameter set, by the text after ``@`` in the ids."""
    listed = list(items)
    names = dict.fromkeys(item.parameter_set for item in listed)
    return {name: _tally(i for i in listed if i.parameter_set == name) for name in names}


# --- Reproductions

_ADVICE = "For your own work"
_THREADS = 4  # more would only wait for the Python interpreter


@dataclass(frozen=True, eq=False)
class Exhibit:
    """A figure, or a function that draws it on demand, with a file name and a caption."""

    name: str
    figure: Figure | Callable[[], Figure]
    caption: str


@dataclass(frozen=True, eq=False)
class Part:
    """Reproduction of a table or a figure of the source.

    Parameters
    ----------
    title
        Heading in the report.
    text
        Procedure and result, for the report.
    items
        Statements with computed numbers.
    exhibits
        Figures.
    recordings
        Recordings to save, by the name of their file.
    appendix
        Tables that the report shows collapsed, by title.
    tables
        Tables that replace the items' verdicts in the report and the terminal, by title.
    """

    title: str
    text: str
    items: tuple[Item, ...]
    exhibits: tuple[Exhibit, ...] = ()
    recordings: Mapping[str, xr.Dataset] = field(default_factory=dict)
    appendix: Mapping[str, Table] = field(default_factory=dict)
    tables: Mapping[str, Table] = field(default_factory=dict)


@dataclass(frozen=True)
class Contradiction:
    """Disagreements of one kind, with their causes.

    Parameters
    ----------
    title
        Title, such as ``"bywire contradicts the paper"``.
    causes
        Causes, the most serious first.
    items
        Statements that disagree.
    """

    title: str
    causes: Sequence[RootCause]
    items: Sequence[Item]

    def counted(self, judged: int) -> str:
        """Return the number of values that disagree, out of all that have a verdict."""
        return f"{len(self.items)} of {judged} judged values"

    @property
    def lines(self) -> list[str]:
        """The causes; a sentence if disagreements have no known cause."""
        explained = {i.id for cause in self.causes for i in cause.explained(self.items)}
        rest = [item.id for item in self.items if item.id not in explained]
        unknown = [f"Without a known cause: {', '.join(rest)}."] if rest else []
        return [*_cause_lines(self.causes, self.items), *unknown]

    @property
    def listing(self) -> Listing:
        """Title and causes for a terminal."""
        return Listing(self.lines or ["No published value."], self.title)

    @property
    def blocks(self) -> list[Block]:
        """Causes for a page."""
        return [Listing(self.lines)] if self.lines else [Paragraph("No published value.")]


def _cause_lines(causes: Iterable[RootCause], items: Sequence[Item]) -> list[str]:
    lines = []
    for cause in causes:
        number = len(cause.explained(items))
        plural = "" if number == 1 else "s"
        lines.append(f"{cause.text} [{number} disagreement{plural}]")
    return lines


@dataclass(frozen=True, eq=False)
class Reproduction(Answer):
    """Reproduction of a source.

    Parameters
    ----------
    source
        Name of the source.
    citation
        Full citation.
    parts
        Its tables and figures.
    causes
        Causes of disagreements, the most serious first.
    allowances
        The tolerances with their reasons.
    sets
        Titles of the parameter sets, by the text after ``@`` in an item's id.
    advice
        What the agreements and disagreements mean for users of the model.
    """

    source: str
    citation: str
    parts: tuple[Part, ...] = ()
    causes: tuple[RootCause, ...] = ()
    allowances: tuple[Allowance, ...] = ()
    sets: Mapping[str, str] = field(default_factory=dict)
    advice: str = ""

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
        """Root causes, then counts of verdicts for each parameter set, as lines."""
        return [*_cause_lines(self.causes, self.items), *self._counts()]

    def _counts(self) -> list[str]:
        return [
            f"{self.sets.get(name, f'@{name}' if name else 'Main set')}: {counted}."
            for name, counted in tallies(self.items).items()
        ]

    @property
    def contradictions(self) -> tuple[Contradiction, Contradiction]:
        """Disagreements with bywire, and disagreements within the source."""
        within = [cause for cause in self.causes if cause.is_within_source]
        others = [cause for cause in self.causes if not cause.is_within_source]
        apart = [item for item in self.items if item.agrees is False]
        explained = {item.id for cause in within for item in cause.explained(apart)}
        return (
            Contradiction(
                "bywire contradicts the paper",
                others,
                [item for item in apart if item.id not in explained],
            ),
            Contradiction(
                "The paper contradicts itself",
                within,
                [item for item in apart if item.id in explained],
            ),
        )

    def document(self) -> Document:
        """Return a document of contradictions, then statements with computed numbers by part."""
        hint = f"bywire reproduce {self.source} --out FOLDER"
        counts = Listing(self._counts(), "Verdicts by parameter set")
        advice: list[str | Block] = [Listing([self.advice], _ADVICE), ""] if self.advice else []
        contradictions = self.contradictions
        return Document(
            f"Reproduction of {self.source}",
            self.citation,
            sections=lambda: self._sections(counts),
            brief=[
                *(f"{each.title}: {each.counted(self._judged)}" for each in contradictions),
                *(text for each in contradictions for text in ("", each.listing)),
                "",
                counts,
                "",
                *advice,
                *self._tables(),
                f"Report with notes, tolerances and figures: {hint}",
            ],
            data=self._data(),
            banner=Banner(self._verdict()),
            attachments=[
                recording_file(f"{_stem(name)}.nc", recording)
                for name, recording in self.recordings.items()
            ],
            record="results.json",
        )

    @property
    def _judged(self) -> int:
        return sum(item.agrees is not None for item in self.items)

    def _verdict(self) -> str:
        ours, theirs = (len(each.items) for each in self.contradictions)
        agree = _tally(self.items).agree
        return (
            f"bywire contradicts the paper in {ours} of {self._judged} judged values, the "
            f"paper contradicts itself in {theirs}, and {agree} agree"
        )

    def _tables(self) -> list[str | Block]:
        """Return the tables for a terminal: other verdicts, collapsed, and the parts' tables."""
        rest = [item for part in self.parts if not part.tables for item in part.items]
        lines: list[str | Block] = []
        lines += [Details("All published values", [TableBlock(verdicts(rest))]), ""] if rest else []
        for title, table in (pair for part in self.parts for pair in part.tables.items()):
            lines += [title, TableBlock(table), ""]
        return lines

    def _sections(self, counts: Listing) -> list[Section]:
        sections = [Section(_ADVICE, [Paragraph(self.advice)])] if self.advice else []
        for each in self.contradictions:
            table = [TableBlock(statements(each.items))] if each.items else []
            title = f"{each.title}: {each.counted(self._judged)}"
            sections.append(Section(title, [*each.blocks, *table]))
        sections.append(Section("Verdicts", [replace(counts, title=""), Paragraph(_KINDS)]))
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

        Numbers that are not stated, computed or defined are None. A tolerance is a number in the
        item's unit, or ``"<="`` or ``">="`` if the statement is a bound. Each note ends with the
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
        Name on the command line.
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
    """Return a reproduction with its parts, computed in threads, and its root causes.

    Parts wait for kernels half of the time, which threads let other parts use.

    Parameters
    ----------
    source
        The source, without parts.
    runs
        Bench results that the parts share.
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
    """Return a file name without characters that file systems reject."""
    return re.sub(r"[^A-Za-z0-9.-]+", "-", name)
