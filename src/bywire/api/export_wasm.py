"""A bench's run as WebAssembly."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from bywire.api.export_folder import export_folder
from bywire.bench import bench_file
from bywire.bench.bench import Bench
from bywire.core.scratch import scratch_folder
from bywire.report.answer import Answer, use_case
from bywire.report.document import Document, Listing, Section
from bywire.report.subject import bench_changes

if TYPE_CHECKING:
    from bywire.export.exported import Exported


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


@use_case
def export_wasm(
    bench: Bench | str | Path,
    out: str | Path,
    overrides: Mapping[str, str] = MappingProxyType({}),
    *,
    case: str = "",
) -> ExportedWasm:
    """Write a bench's run as a WebAssembly module: parameters in, recording out.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or the name of an experiment.
    out
        Folder of the files; those that are there are replaced.
    overrides
        Changes of a bench file or experiment, as ``--set`` takes them.
    case
        Which run of the experiment is exported; may be left out where there is but one.

    Returns
    -------
    ExportedWasm
        The files: ``NAME.wasm``, ``NAME.json`` (parameters, signals, stimulus, all SI), and the
        loader ``bywire.mjs`` with its types.

    Raises
    ------
    InputError
        When the bench cannot be exported, or files cannot be written.
    CompilerError
        Without the extra ``compiler``.
    """
    if not isinstance(bench, Bench):
        bench = bench_file.read(bench, overrides)
    elif overrides:
        bench = bench.with_overrides(overrides)
    from bywire.export.exported import exported
    from bywire.export.interface import identifier_of
    from bywire.export.wasm.module import module_files

    made = exported(bench, case)
    contents = module_files(made, identifier_of(bench.name or bench.experiment))
    with export_folder(out) as folder, scratch_folder(folder) as scratch:  # all, or none
        for name, content in contents.items():
            (scratch / name).write_bytes(content)
        paths = tuple(folder / name for name in contents)
        for path in paths:
            os.replace(scratch / path.name, path)
    return ExportedWasm(paths, made, len(next(iter(contents.values()))))
