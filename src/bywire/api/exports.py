"""Exports of a bench: the C of its ECU, functional mock-up units, WebAssembly, a page."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.bench.bench import Bench
from bywire.bench.experiment import Case
from bywire.core.catalog import Cited
from bywire.core.errors import CompilerError, FileError, ModelError
from bywire.core.scratch import made_folder
from bywire.core.units import shown
from bywire.report.answer import Answer
from bywire.report.document import Document, Flat, Listing, Paragraph, Section, TableBlock
from bywire.report.subject import bench_changes
from bywire.report.tables import Cell, Column, Table, Verdict, text_table
from bywire.simulation.compiler import find_compiler

if TYPE_CHECKING:
    from bywire.export.controller.program import Program
    from bywire.export.controller.target.trial import Trial
    from bywire.export.exported import Causality, Exported
    from bywire.export.fmu.archive import Unit


@contextmanager
def export_folder(out: str | Path) -> Iterator[Path]:
    """Yield the folder of an export; what was made of it is removed where nothing is written.

    Raises
    ------
    FileError
        When it cannot be made, or files in it cannot be written.
    """
    folder = Path(out).expanduser()
    try:
        with made_folder(folder):
            yield folder
    except OSError as error:
        raise FileError(
            f"{folder} cannot be written: {error.strerror or error}; make room there, or name "
            "another folder",
            name=str(folder),
        ) from None


# --- The ECU as C

GOALS: Mapping[tuple[str, str], Mapping[str, int]] = {
    ("Cortex-M4F", "single"): {"rom": 2048, "ram": 128, "stack": 128, "instructions": 400},
    ("Cortex-M4F", "double"): {"instructions": 10_000},
}
"""what a tick of an ECU should take at most, by processor and precision: bytes, instructions"""
_HEADINGS = {
    "rom": "ROM [B]",
    "ram": "RAM [B]",
    "stack": "stack [B]",
    "instructions": "instructions",
}


@dataclass(frozen=True)
class ControllerCheck:
    """How an exported ECU did.

    Parameters
    ----------
    trials
        One for every processor and precision that was tried, this machine first.
    vectors
        Test vectors of all tasks.
    skipped
        What was not tried, why, and what to install.
    inexact
        Precisions in which functions of the C library are called whose last digit is free.
    """

    trials: tuple[Trial, ...]
    vectors: int
    skipped: tuple[str, ...]
    inexact: tuple[str, ...] = ()

    def is_identical(self, trial: Trial) -> bool:
        """Return whether a processor gave what the first one gave, in every bit."""
        first = next(each for each in self.trials if each.precision == trial.precision)
        return trial.bits == first.bits

    @property
    def holds(self) -> bool:
        """Whether values are Python's, bits the same but for free digits, and contracts kept."""
        return all(
            each.differing == each.breaches == 0
            and (self.is_identical(each) or each.precision in self.inexact)
            for each in self.trials
        )

    def table(self) -> TableBlock:
        """Return a row for every trial."""
        figures = (Column(each, True) for each in _HEADINGS.values())
        columns = [
            Column("processor"),
            Column("precision"),
            Column("differing", True),
            Column("breaches", True),
            Column("bits"),
            *figures,
        ]
        rows = tuple(self._row(each) for each in self.trials)
        caption = (
            f"{self.vectors} vectors: values that differ from Python's, breaches of the contract "
            "in README.txt, bits beside those of the first row; instructions and stack of the task "
            "that takes most, calls included."
        )
        return TableBlock(Table(tuple(columns), rows), caption)

    def _row(self, trial: Trial) -> tuple[Cell, ...]:
        identical = self.is_identical(trial)
        same = Cell("the same" if identical else "others", "good" if identical else "bad")
        figures, goals = figures_of(trial), GOALS.get((trial.target, trial.precision), {})
        cells = [_measured(figures.get(name), goals.get(name)) for name in _HEADINGS]
        counts = [
            Cell(str(each), "bad" if each else "good", each)
            for each in (trial.differing, trial.breaches)
        ]
        return (Cell(trial.target), Cell(trial.precision), *counts, same, *cells)

    def as_object(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "vectors": self.vectors,
            "holds": self.holds,
            "skipped": list(self.skipped),
            "trials": [
                {
                    "processor": each.target,
                    "precision": each.precision,
                    "differing": each.differing,
                    "breaches": each.breaches,
                    "identical": self.is_identical(each),
                    **figures_of(each),
                    "goals": dict(GOALS.get((each.target, each.precision), {})),
                    "tasks": {name: vars(task) for name, task in (each.tasks or {}).items()},
                }
                for each in self.trials
            ],
        }


def figures_of(trial: Trial) -> dict[str, int]:
    """Return the figures of a trial that goals are about; none on the host."""
    if trial.rom is None or trial.ram is None or not trial.tasks:
        return {}
    return {
        "rom": trial.rom,
        "ram": trial.ram,
        "stack": max(each.stack for each in trial.tasks.values()),
        "instructions": max(each.instructions for each in trial.tasks.values()),
    }


def _measured(value: int | None, goal: int | None) -> Cell:
    if value is None:
        return Cell("")
    if goal is None:
        return Cell(str(value), value=value)
    verdict: Verdict = "good" if value <= goal else "bad"
    return Cell(f"{value} ({'<=' if value <= goal else '>'} {goal})", verdict, value)


def check_controller(case: Case, cited: Mapping[str, Cited], count: int) -> ControllerCheck:
    """Compile the ECU of a case in both precisions, and run it wherever the tools are there.

    Parameters
    ----------
    cited
        Values of the parameter set with their provenance.
    count
        Test vectors of each task.

    Raises
    ------
    CompilerError
        When nothing can be compiled, or a compiler fails.
    """
    from bywire.export.controller.c_text import PRECISIONS
    from bywire.export.controller.files import files
    from bywire.export.controller.program import program
    from bywire.export.controller.target.trial import (
        TARGETS,
        host_trial,
        missing_tools,
        target_trial,
    )
    from bywire.export.controller.vectors import vectors

    compiler, missing = find_compiler(), missing_tools()
    if compiler is None and missing:
        raise CompilerError(
            f"nothing can be checked: there is no C compiler, and {missing}; "
            "the extra bywire[compiler] brings one"
        )
    skipped = [f"Cortex-M3, M4F and M7 were skipped: {missing}"] if missing else []
    if compiler is None:
        skipped.append("this machine was skipped: there is no C compiler (extra bywire[compiler])")
    trials: list[Trial] = []
    inexact, tried = [], 0
    for precision in PRECISIONS:
        try:
            made = program(case.model, case.par, precision)
            every = vectors(made, case.memory, count)
            texts = files(made, case.memory, cited, every)
        except ModelError as error:
            if precision == "double":
                raise
            skipped.append(f"{precision} precision was skipped: {error}")
            continue
        tried = count * len(made.steps)
        inexact += [precision] if made.inexact else []
        with tempfile.TemporaryDirectory(prefix="bywire-ecu-") as place:
            folder, scratch = Path(place) / "ecu", Path(place) / "made"
            folder.mkdir()
            scratch.mkdir()
            for name, text in texts.items():
                (folder / name).write_text(text, encoding="utf-8")
            if compiler is not None:
                trials.append(host_trial(made, folder, compiler, scratch))
            if not missing:
                trials += [target_trial(made, every, folder, t, scratch) for t in TARGETS]
    return ControllerCheck(tuple(trials), tried, tuple(skipped), tuple(inexact))


@dataclass(frozen=True)
class ControllerExport(Answer):
    """An ECU that was written as C.

    Parameters
    ----------
    folder
        Where it stands.
    files
        Names of its files.
    program
        What was translated.
    vectors
        Test vectors of each task.
    bench
        Whose ECU it is.
    check
        How it did on processors; None where that was not asked for.
    """

    folder: Path
    files: tuple[str, ...]
    program: Program
    vectors: int
    bench: Bench
    check: ControllerCheck | None = None

    @property
    def holds(self) -> bool:
        """Whether all processors gave what Python gives; so, too, where none was asked."""
        return self.check is None or self.check.holds

    @property
    def notes(self) -> list[str]:
        """What was skipped of a check, and how to install what it wants."""
        return [] if self.check is None else list(self.check.skipped)

    def document(self) -> Document:
        """Return what was written, and how it is tried."""
        tasks = ", ".join(f"{s.task.name} ({s.task.period:.9g} s)" for s in self.program.steps)
        what = Paragraph(
            f"{self.program.name}_ecu.c: {len(self.program.functions)} functions, "
            f"{len(self.program.parameters())} parameters, tasks {tasks}, "
            f"{self.program.precision.name} precision"
        )
        following = Listing([f"make -C {self.folder} check"], "Next, with a C compiler:")
        written = Paragraph(f"written: {self.folder}")
        checked: list[Flat] = [] if self.check is None else [self.check.table()]
        return Document(
            f"The ECU of {self.program.model.name} in C",
            f"written to {self.folder}",
            sections=[
                Section("Files", [what, Listing(list(self.files)), following]),
                *([Section("Check", checked)] if checked else []),
            ],
            brief=[what, written, *(checked or [following])],
            data=self._data(),
            is_paged=False,
            changes=bench_changes(self.bench),
        )

    def _data(self) -> dict[str, Any]:
        made = self.program
        return {
            "folder": str(self.folder),
            "files": list(self.files),
            "model": made.model.name,
            "precision": made.precision.name,
            "tasks": {step.task.name: step.task.period for step in made.steps},
            "parameters": [name for name, _ in made.parameters()],
            "memory": [each.name for each in made.members(made.model.Memory)],
            "library": list(made.libraries),
            "vectors": self.vectors,
            **({} if self.check is None else {"check": self.check.as_object()}),
        }


# --- Functional mock-up units

_KINDS: dict[Causality, str] = {
    "input": "inputs",
    "output": "outputs",
    "parameter": "parameters",
    "local": "others",
}
_NO_START = (
    "the start at rest of this experiment is not known for other parameters: with changed "
    "parameters the unit begins where the exported ones rest, and settles"
)
_EXCHANGED = (
    "a solver integrates its states and meets its events; between them contacts and frictions keep "
    "their modes"
)


@dataclass(frozen=True)
class ExportedFmu(Answer):
    """An FMU that was written.

    Parameters
    ----------
    path
        Its file.
    unit
        What it holds: run, variables, sources.
    targets
        Systems that it has binaries for.
    compilers
        What made each of them.
    """

    path: Path
    unit: Unit
    targets: tuple[str, ...]
    compilers: tuple[str, ...]

    @property
    def notes(self) -> list[str]:
        """What else to know of it."""
        return [] if self.unit.begins_anywhere else [_NO_START]

    def document(self) -> Document:
        """Return what was written, and how it steps."""
        unit = self.unit
        schedule = unit.made.schedule
        table = TableBlock(self._table())
        steps = Paragraph(
            _EXCHANGED
            if unit.faces.kind == "model-exchange"
            else (
                f"internal step {shown(schedule.step, 's')}, communication steps are multiples of "
                f"{shown(schedule.frame, 's')}; the start time is "
                f"{shown(unit.made.case.settle, 's')} before time zero of the bench"
            )
        )
        written = f"written: {self.path}"
        return Document(
            f"FMU {unit.identifier}",
            written,
            sections=[Section("What it holds", [table, steps])],
            brief=[table, steps, written],
            data=self._data(),
            is_paged=False,
            changes=bench_changes(unit.made.bench),
        )

    def _table(self) -> Table:
        faces = self.unit.faces
        rows = [
            (name, str(len(faces.of(kind))), _some([each.name for each in faces.of(kind)]))
            for kind, name in _KINDS.items()
            if faces.of(kind)
        ]
        return text_table(("of", "count", "names"), rows)

    def _data(self) -> dict[str, Any]:
        unit = self.unit
        return {
            "file": str(self.path),
            "fmi": unit.version,
            "part": unit.faces.part,
            "kind": unit.faces.kind,
            "identifier": unit.identifier,
            "token": unit.token,
            "case": unit.made.case.label,
            "step": unit.made.schedule.step,
            "communication_step": unit.made.schedule.frame,
            "begins_at_rest": unit.begins_anywhere,
            "targets": dict(zip(self.targets, self.compilers, strict=True)),
            "variables": [
                {"name": v.name, "causality": v.causality, "unit": v.unit, "start": v.start}
                for v in unit.faces.variables
            ],
            "files": [str(self.path)],
        }


def _some(names: list[str], most: int = 6) -> str:
    """Return the first of some names."""
    return ", ".join(names[:most]) + (" ..." if len(names) > most else "")


# --- WebAssembly


@dataclass(frozen=True)
class ExportedWasm(Answer):
    """A module that was written.

    Parameters
    ----------
    files
        Module, description (JSON), loader and types.
    made
        The run that it is of.
    size
        Bytes of the module.
    """

    files: tuple[Path, ...]
    made: Exported
    size: int

    def document(self) -> Document:
        """Return what was written."""
        run = f"{self.made.bench.experiment}, run {self.made.case.label!r}"
        listing = Listing([str(path) for path in self.files], f"{run}: {self.size / 1e3:.1f} kB")
        return Document(
            f"WebAssembly of {self.made.bench.name or self.made.bench.experiment}",
            f"written: {self.files[0]}",
            sections=[Section("Files", [listing])],
            brief=[listing],
            data=self._data(),
            is_paged=False,
            changes=bench_changes(self.made.bench),
        )

    def _data(self) -> dict[str, Any]:
        return {
            "case": self.made.case.label,
            "bytes": self.size,
            "files": [str(p) for p in self.files],
        }


# --- A page that anybody can open


@dataclass(frozen=True)
class BenchPage(Answer):
    """A page that was written.

    Parameters
    ----------
    file
        The page.
    made
        The run that it computes.
    size, compressed
        Bytes of the file, and of what a server sends of it (gzip).
    """

    file: Path
    made: Exported
    size: int
    compressed: int

    def document(self) -> Document:
        """Return what was written."""
        run = f"{self.made.bench.experiment}, run {self.made.case.label!r}"
        sizes = f"{self.size / 1e3:.0f} kB, {self.compressed / 1e3:.0f} kB compressed"
        listing = Listing([str(self.file)], f"{run}: {sizes}")
        return Document(
            f"Page of {self.made.bench.name or self.made.bench.experiment}",
            f"written: {self.file}",
            sections=[Section("File", [listing])],
            brief=[listing],
            data={
                "file": str(self.file),
                "case": self.made.case.label,
                "bytes": self.size,
                "compressed": self.compressed,
            },
            is_paged=False,
            changes=bench_changes(self.made.bench),
        )
