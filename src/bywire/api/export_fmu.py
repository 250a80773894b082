"""A bench's brake, its plant or its ECU as a functional mock-up unit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from bywire.api.export_folder import export_folder
from bywire.bench import bench_file
from bywire.bench.bench import Bench
from bywire.core.errors import ParameterError, quoted, unknown_name
from bywire.core.typing import silent
from bywire.core.units import shown
from bywire.export.fmu.archive import unit_of, write_unit
from bywire.export.fmu.binaries import PLATFORMS, this_platform
from bywire.export.interface import KINDS, PARTS, Causality
from bywire.report.answer import Answer, use_case
from bywire.report.document import Document, Paragraph, Section, TableBlock
from bywire.report.subject import bench_changes
from bywire.report.tables import Table, text_table

if TYPE_CHECKING:
    from bywire.bench.running import Progress
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


@use_case
def export_fmu(
    bench: Bench | str | Path,
    out: str | Path,
    overrides: Mapping[str, str] = MappingProxyType({}),
    *,
    part: str = "",
    kind: str = "co-simulation",
    fmi: int = 2,
    case: str = "",
    targets: Sequence[str] = (),
    progress: Progress | None = None,
) -> ExportedFmu:
    """Write a bench's model as a functional mock-up unit.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or the name of an experiment.
    out
        Folder in which the file ``NAME_PART.fmu`` is written; one that is there is replaced.
    overrides
        Changes of a bench file or experiment, as ``--set`` takes them.
    part
        ``"brake"``: all; ``"plant"``: what the ECU holds are inputs, its readings outputs;
        ``"ecu"``: the reverse. The brake by default; the plant where that is exchanged.
    kind
        ``"co-simulation"``: it steps by itself, as the bench does; ``"model-exchange"``: the plant
        for a client's solver, with derivatives, event indicators and modes.
    fmi
        Version of the interface: 2 for 2.0, 3 for 3.0 (tasks are clocks, tables arrays).
    case
        Which run of the experiment is exported; may be left out where there is but one.
    targets
        Systems that binaries are made for: ``linux64``, ``win64``, ``darwin64``,
        ``aarch64-linux``, ``aarch64-darwin``; this system by default.
    progress
        Called with a label and the finished share, 0 to 1.

    Returns
    -------
    ExportedFmu
        The file, and what it holds; all values in it are SI.

    Raises
    ------
    InputError
        When the bench cannot be exported, or the file cannot be written.
    CompilerError
        When there is no compiler for a system, or it fails.
    """
    if kind not in KINDS:
        raise unknown_name("kind", kind, KINDS)
    part = part or ("plant" if kind == "model-exchange" else "brake")
    if part not in PARTS:
        raise unknown_name("part", part, PARTS)
    if kind == "model-exchange" and part != "plant":
        raise ParameterError(
            f"part = {part!r}: model exchange is for the plant, the ECU works in ticks; export "
            "that for co-simulation beside it"
        )
    if fmi not in (2, 3):
        raise ParameterError(f"fmi = {quoted(fmi)}: FMUs of version 2 (2.0) and 3 (3.0) are made")
    systems = tuple(dict.fromkeys(targets)) or (this_platform(),)
    for each in systems:
        if each not in PLATFORMS:
            raise unknown_name("target", each, PLATFORMS)
    if not isinstance(bench, Bench):
        bench = bench_file.read(bench, overrides)
    elif overrides:
        bench = bench.with_overrides(overrides)
    from bywire.export.exported import exported

    unit = unit_of(exported(bench, case), part, fmi, kind)
    with export_folder(out) as folder:
        path = folder / f"{unit.identifier}.fmu"
        compilers = write_unit(unit, path, systems, progress or silent)
    return ExportedFmu(path, unit, systems, tuple(compilers))


def _some(names: list[str], most: int = 6) -> str:
    """Return the first of some names."""
    return ", ".join(names[:most]) + (" ..." if len(names) > most else "")
