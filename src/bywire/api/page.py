"""A bench as one page that anybody can open: parameters to move, curves that follow."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bywire.report.answer import Answer
from bywire.report.document import Document, Listing, Section
from bywire.report.subject import bench_changes

if TYPE_CHECKING:
    from bywire.export.exported import Exported


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
