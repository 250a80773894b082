"""A bench's brake, its plant or its ECU as a functional mock-up unit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.core.units import shown
from bywire.export.interface import Causality
from bywire.report.answer import Answer
from bywire.report.document import Document, Paragraph, Section, TableBlock
from bywire.report.subject import bench_changes
from bywire.report.tables import Table, text_table

if TYPE_CHECKING:
    from bywire.export.fmu.archive import Unit

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
