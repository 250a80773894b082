"""A bench's run as WebAssembly."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bywire.report.answer import Answer
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
