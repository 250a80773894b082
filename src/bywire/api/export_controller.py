"""The ECU of a bench as C: laws, plant's side, parameters, test vectors, description."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.api.controller_check import ControllerCheck
from bywire.bench.bench import Bench
from bywire.report.answer import Answer
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
