"""A bench as one page that anybody can open: parameters to move, curves that follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from bywire.bench import bench_file
from bywire.bench.bench import Bench
from bywire.core.errors import ParameterError, unknown_name
from bywire.core.parameters import leaf_fields
from bywire.report.answer import Answer, use_case
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


@use_case
def page(
    bench: Bench | str | Path,
    out: str | Path,
    overrides: Mapping[str, str] = MappingProxyType({}),
    *,
    vary: Sequence[str] = (),
    case: str = "",
) -> BenchPage:
    """Write a bench as one HTML file that computes it: no server, no installation.

    Parameters
    ----------
    bench
        A `Bench`, the path of a bench file, or the name of an experiment.
    out
        File of the page (.html); one that is there is replaced.
    overrides
        Changes of a bench file or experiment, as ``--set`` takes them.
    vary
        Parameters that stand first in the page; by default those that the bench changes,
        else those that its brake declares (`bywire.authoring.Sliders`).
    case
        Which run of the experiment it computes; may be left out where there is but one.

    Returns
    -------
    BenchPage
        The file and its size.

    Raises
    ------
    InputError
        When the bench cannot be exported, for a name in ``vary`` that is no number of the bench or
        has no effect in it, and when the file cannot be written.
    CompilerError
        Without the extra ``compiler``.
    """
    import gzip

    from bywire.bench.running import run
    from bywire.export.exported import exported, start_source
    from bywire.export.interface import interface
    from bywire.report.drawing import write_bytes
    from bywire.report.live_page.content import page_text
    from bywire.report.time_traces import shown_panels

    if Path(out).suffix.lower() not in (".html", ".htm"):
        raise ParameterError(f"out = {str(out)!r} is no page: give a file that ends in .html")
    if not isinstance(bench, Bench):
        bench = bench_file.read(bench, overrides)
    elif overrides:
        bench = bench.with_overrides(overrides)
    made = exported(bench, case)
    _, reads = start_source(made)
    used = [each.name for each in interface(made, "brake", reads).of("parameter")]
    for name in vary:
        if name not in leaf_fields(type(bench.par)):
            raise unknown_name("parameter", name, used)
        if name not in used:
            raise ParameterError(f"{name} has no effect in this bench: leave it out of vary")
    result = run(bench)
    panels = shown_panels(result.recordings[made.case.label])
    content = page_text(made, panels, result, vary).encode()
    file = write_bytes(out, content)
    return BenchPage(file, made, len(content), len(gzip.compress(content, mtime=0)))
