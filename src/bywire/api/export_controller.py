"""The ECU of a bench as C: laws, plant's side, parameters, test vectors, description."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.api.controller_check import ControllerCheck, check_controller
from bywire.api.export_folder import export_folder
from bywire.bench.bench import Bench
from bywire.bench.bench_file import read
from bywire.core.arguments import whole_number
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import unknown_name
from bywire.core.scratch import scratch_folder
from bywire.export.controller.c_text import PRECISIONS, checked_name
from bywire.export.controller.files import files
from bywire.export.controller.program import program
from bywire.export.controller.vectors import vectors as test_vectors
from bywire.report.answer import Answer, use_case
from bywire.report.document import Document, Flat, Listing, Paragraph, Section
from bywire.report.subject import bench_changes

if TYPE_CHECKING:
    from bywire.export.controller.program import Program

VECTORS = 200


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


@use_case
def export_controller(
    bench: Bench | str | Path,
    out: str | Path,
    *,
    precision: str = "double",
    vectors: int = VECTORS,
    check: bool = False,
    dbc: bool = False,
    name: str = "",
) -> ControllerExport:
    """Write the ECU of a bench's model as readable C99, with all that is needed to try it.

    Parameters
    ----------
    bench
        Bench, bench file, or name of an experiment: its parameters and choices are those of the
        ECU; of several cases the first one's. Faults of the bench are left out.
    out
        Folder, made where it is missing; files of an earlier export in it are replaced.
    precision
        ``"double"``, equal to Python in every bit, or ``"single"``.
    vectors
        Test vectors of each task.
    check
        Whether the C is compiled in both precisions, for this machine and, where
        arm-none-eabi-gcc and qemu-system-arm are installed, for Cortex-M3, M4F and M7; run there
        on the vectors, compared bit by bit, and measured.
    dbc
        Whether the memory is described as signals of a CAN bus, with the C that fills messages.
    name
        What files and symbols begin with, an identifier of C; the model's name by default. ECUs of
        different names link into one program.

    Returns
    -------
    ControllerExport
        Files, functions and parameters.

    Raises
    ------
    ParameterError
        When the name is no identifier of C.
    ModelError
        With file, line and operation of what cannot be translated.
    FileError
        When the folder cannot be written.
    CompilerError
        When a check finds no compiler, or one fails.
    """
    if precision not in PRECISIONS:
        raise unknown_name("precision", precision, PRECISIONS)
    whole_number("vectors", vectors, 1, 100_000)
    if name:
        checked_name(name)
    chosen = bench if isinstance(bench, Bench) else read(bench, {})
    case = replace(chosen, faults=()).cases()[0]
    made = program(case.model, case.par, precision, name)
    cited = PARAMETER_SETS.find(chosen.parameters).values
    every = test_vectors(made, case.memory, vectors)
    texts = files(made, case.memory, cited, every, bus=dbc)
    with export_folder(out) as folder, scratch_folder(folder) as scratch:  # all, or none
        for name, text in texts.items():
            (scratch / name).write_text(text, encoding="utf-8")
        for name in texts:
            os.replace(scratch / name, folder / name)
    checked = check_controller(case, cited, vectors) if check else None
    return ControllerExport(folder, tuple(texts), made, vectors, chosen, checked)
