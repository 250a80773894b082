"""Exports of a bench: C code of its ECU, functional mock-up units, WebAssembly, web page."""

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
from bywire.report.answer import Answer, Outcome
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
    """Yield the folder of an export, and remove new folders if nothing is written.

    Raises
    ------
    FileError
        If the folder cannot be created, or its files cannot be written.
    """
    folder = Path(out).expanduser()
    try:
        with made_folder(folder):
            yield folder
    except OSError as error:
        raise FileError(
            f"cannot write to {folder}: {error.strerror or error}. Free some space, or choose "
            "another folder",
            name=str(folder),
        ) from None


# --- The ECU as C

GOALS: Mapping[tuple[str, str], Mapping[str, int]] = {
    ("Cortex-M4F", "single"): {"rom": 2048, "ram": 128, "stack": 128, "instructions": 400},
    ("Cortex-M4F", "double"): {"instructions": 10_000},
}
"""limits of an ECU's tick in bytes and instructions, by processor and precision"""
_HEADINGS = {
    "rom": "ROM [B]",
    "ram": "RAM [B]",
    "stack": "stack [B]",
    "instructions": "instructions",
}


@dataclass(frozen=True)
class ControllerCheck:
    """Check of an ECU's exported code.

    Parameters
    ----------
    trials
        One trial for each processor and precision, starting with this machine.
    vectors
        Number of test vectors of all tasks.
    skipped
        Skipped trials, each with the reason and the missing tool.
    inexact
        Precisions that call functions of the C library whose last digit may differ.
    """

    trials: tuple[Trial, ...]
    vectors: int
    skipped: tuple[str, ...]
    inexact: tuple[str, ...] = ()

    def is_identical(self, trial: Trial) -> bool:
        """Return whether a processor's results are bit-identical to the first processor's."""
        first = next(each for each in self.trials if each.precision == trial.precision)
        return trial.bits == first.bits

    @property
    def holds(self) -> bool:
        """Whether values equal Python's, bits agree where they must, and contracts are met."""
        return all(
            each.differing == each.breaches == 0
            and (self.is_identical(each) or each.precision in self.inexact)
            for each in self.trials
        )

    def table(self) -> TableBlock:
        """Return a table with one trial per row."""
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
            "in "
            "README.txt, and bits compared with the first row. Instructions and stack are those "
            "of the most expensive task, including its calls."
        )
        return TableBlock(Table(tuple(columns), rows), caption)

    def _row(self, trial: Trial) -> tuple[Cell, ...]:
        identical = self.is_identical(trial)
        same = Cell("the same" if identical else "different", "good" if identical else "bad")
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
    """Return a trial's figures that have limits. On the host there are none."""
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
    """Compile a case's ECU in both precisions, and run it on every processor with installed tools.

    Parameters
    ----------
    cited
        Values of the parameter set with their sources.
    count
        Number of test vectors per task.

    Raises
    ------
    CompilerError
        If there is no compiler, or a compiler fails.
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
            f"bywire cannot check the export: there is no C compiler, and {missing}. Install a "
            "compiler with the extra bywire[compiler]",
            name="check",
            valid="bywire[compiler]",
        )
    skipped = [f"Cortex-M3, M4F and M7 were skipped: {missing}"] if missing else []
    if compiler is None:
        skipped.append(
            "this machine was skipped: it has no C compiler. Install the extra bywire[compiler]"
        )
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
    """ECU exported as C.

    Parameters
    ----------
    folder
        Folder of the export.
    files
        Names of the files.
    program
        Translated program.
    vectors
        Number of test vectors per task.
    bench
        Bench of the ECU.
    check
        Check on processors, or None if it was not requested.
    """

    folder: Path
    files: tuple[str, ...]
    program: Program
    vectors: int
    bench: Bench
    check: ControllerCheck | None = None

    @property
    def holds(self) -> bool:
        """Whether all processors in the check agree with Python."""
        return self.check is None or self.check.holds

    @property
    def outcome(self) -> Outcome:
        """Verdict of the check; ``not shown`` without one."""
        return "not shown" if self.check is None else "met" if self.holds else "missed"

    @property
    def notes(self) -> list[str]:
        """Skipped parts of the check, each with the missing tool."""
        return [] if self.check is None else list(self.check.skipped)

    def document(self) -> Document:
        """Return the files, and the command that tests them."""
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
    "this experiment's rest state is unknown for other parameters. With changed parameters, the "
    "FMU starts from the exported rest state and settles"
)
_EXCHANGED = (
    "the importing tool's solver integrates the states and locates the events. Between events, "
    "contacts "
    "and dry friction keep their modes"
)


@dataclass(frozen=True)
class ExportedFmu(Answer):
    """Exported FMU.

    Parameters
    ----------
    path
        File of the unit.
    unit
        Contents of the unit: run, variables, source files.
    targets
        Platforms of the binaries.
    compilers
        Compiler that built each binary.
    """

    path: Path
    unit: Unit
    targets: tuple[str, ...]
    compilers: tuple[str, ...]

    @property
    def notes(self) -> list[str]:
        """Note on the FMU's start."""
        return [] if self.unit.begins_anywhere else [_NO_START]

    def document(self) -> Document:
        """Return the unit's contents and steps."""
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
            sections=[Section("Contents", [table, steps])],
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
    """Return some of the names."""
    return ", ".join(names[:most]) + (" ..." if len(names) > most else "")


# --- WebAssembly


@dataclass(frozen=True)
class ExportedWasm(Answer):
    """Exported WebAssembly module.

    Parameters
    ----------
    files
        Module, its description (JSON), loader and types.
    made
        Run that is computed.
    size
        Size of the module in bytes.
    """

    files: tuple[Path, ...]
    made: Exported
    size: int

    def document(self) -> Document:
        """Return the written files."""
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


# --- A page that anyone can open


@dataclass(frozen=True)
class BenchPage(Answer):
    """Exported page.

    Parameters
    ----------
    file
        File of the page.
        made
    Run that the page computes.
    size, compressed
        Size of the file in bytes, uncompressed and compressed (gzip).
    """

    file: Path
    made: Exported
    size: int
    compressed: int

    def document(self) -> Document:
        """Return the written files."""
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
