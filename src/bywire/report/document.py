"""A result as a document: the blocks of terminal, JSON, HTML page and files.

A `Document` loads no plotting library: figures are drawn when a page or a file needs them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from bywire.report.tables import Table

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Picture:
    """A figure that another process has drawn.

    Parameters
    ----------
    png, svg
        Its files.
    axes
        Positions of its axes; see `bywire.report.drawing.axes_of`.
    """

    png: bytes
    svg: bytes
    axes: str


# --- Blocks


@dataclass(frozen=True)
class Paragraph:
    """Plain text; a terminal wraps it if it is longer than a line."""

    text: str


@dataclass(frozen=True)
class Listing:
    """Plain texts with bullets, below an optional title line."""

    texts: Sequence[str]
    title: str = ""


@dataclass(frozen=True)
class FigureBlock:
    """A figure with its caption; the page numbers it.

    Parameters
    ----------
    source
        The figure, or a function that draws it.
    caption
        Description of the content.
    name
        File name in an output folder, without the extension; empty for no file.
    is_long
        Whether the figure takes much longer to draw than most, for example because it has many
        panels. Such figures start first when figures are drawn in parallel.
    """

    source: Figure | Callable[[], Figure]
    caption: str
    name: str = ""
    is_long: bool = False

    @cached_property
    def figure(self) -> Figure | Picture:
        """The figure, created on first use or drawn by another process."""
        return self.source() if callable(self.source) else self.source


@dataclass(frozen=True)
class Drawing:
    """A drawing in the colors of its page, with its caption.

    Parameters
    ----------
    source
        Function that makes it: an SVG element as text, with its own description and escaped texts.
    caption
        Description of the content.
    """

    source: Callable[[], str]
    caption: str


@dataclass(frozen=True)
class TableBlock:
    """A table, with a caption that the page numbers.

    Parameters
    ----------
    title
        Line above the table on a terminal, which shows no captions; empty for none.
    most
        Maximum number of rows on a terminal without ``--verbose``; 0 for all.
    """

    table: Table
    caption: str = ""
    title: str = ""
    most: int = 0


@dataclass(frozen=True)
class Details:
    """Folded blocks on a page; a terminal shows them with ``--verbose``.

    The reader of a page opens them.
    """

    title: str
    blocks: Sequence[Flat]


Flat = Paragraph | Listing | FigureBlock | Drawing | TableBlock
Block = Flat | Details


@dataclass(frozen=True)
class Section:
    """A heading and its blocks."""

    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Banner:
    """The result in one line at the top: ``good``, ``bad``, ``open`` or neither."""

    text: str
    verdict: Literal["good", "bad", "open", "none"] = "none"


@dataclass(frozen=True)
class Attachment:
    """A data file next to the page.

    Parameters
    ----------
    name
        File name in the output folder.
    write
        ``write(path)``: writes the complete file or nothing, and returns the path.
    after_record
        Whether the document's record is written first, so that values never exist without the
        record of their validity.
    """

    name: str
    write: Callable[[Path], Path]
    after_record: bool = False


def recording_file(name: str, data: xr.Dataset) -> Attachment:
    """Return a NetCDF file with a recording, or another dataset with units."""

    def write(path: Path) -> Path:
        from bywire.data.netcdf import write_recording

        return write_recording(data, path)

    return Attachment(name, write)


@dataclass(frozen=True)
class Change:
    """A value that the user changed.

    Parameters
    ----------
    name
        Name in the form of ``--set``.
    now, before
        New and original value as text with unit.
    of
        Name of the changed parameter set, or of the owner of the defaults.
    where
        Source of the original value.
    """

    name: str
    now: str
    before: str
    of: str
    where: str = ""


@dataclass(frozen=True)
class Document:
    """Content of a result for all outputs.

    Parameters
    ----------
    title, summary
        Heading of the page, and one line below it.
    sections
        Sections of the page, or a function that creates them if that requires drawing.
    brief
        Texts and blocks for the terminal, mostly also on the page. The last line is the banner's
        text.
    data
        The JSON object without the files, or a function that creates it if that requires
        statistics. NaN and infinite numbers become null.
    banner
        Verdict above the contents of the page.
    attachments
        Data files.
    record
        File for the JSON object in the output folder; empty for none.
    notices
        Lines for standard error before the result, such as changed or omitted settings.
    remarks
        Lines for standard error after the result, such as missed requirements.
    file_notes
        Notes on the files of an output folder, or the reason for their absence.
    prepare
        ``prepare(folder)``: called before writing, to reject a folder or clean it up.
    is_paged
        Whether an output folder gets a page and figures; false if an interrupt left too little.
    page_name
        File name of the page.
    has_files
        Whether it can be written to a folder; its JSON object then lists the files.
    headline
        Most important message: the first entry of the JSON object. A terminal shows it as a warning
        and in the verdict.
    changes
        The user's changes, which a terminal shows first and the JSON object contains by name; None
        if nothing can be changed. On pages a section shows them (`bywire.report.subject`).
    """

    title: str
    summary: str
    sections: Sequence[Section] | Callable[[], Sequence[Section]]
    brief: Sequence[str | Block]
    data: Mapping[str, Any] | Callable[[], Mapping[str, Any]]
    banner: Banner | None = None
    attachments: Sequence[Attachment] = ()
    record: str = ""
    notices: Sequence[str] = ()
    remarks: Sequence[str] = ()
    file_notes: Sequence[str] = ()
    prepare: Callable[[Path], None] | None = None
    is_paged: bool = True
    page_name: str = "report.html"
    has_files: bool = True
    headline: str = ""
    changes: Sequence[Change] | None = None

    @cached_property
    def page(self) -> Sequence[Section]:
        """The sections, created on first use."""
        return self.sections() if callable(self.sections) else self.sections

    @cached_property
    def facts(self) -> Mapping[str, Any]:
        """The JSON object, created on first use."""
        data = self.data() if callable(self.data) else self.data
        data = {"headline": self.headline, **data} if self.headline else data
        if self.changes is None:
            return data
        return {
            **data,
            "changes": {
                each.name: {"value": each.now, "instead_of": each.before, "of": each.of}
                for each in self.changes
            },
        }

    def flat(self) -> Iterator[Flat]:
        """Yield the blocks of all sections, including folded ones."""
        return flat_blocks(block for section in self.page for block in section.blocks)


def spaced(blocks: Iterable[str | Block]) -> list[str | Block]:
    """Return the blocks of a brief separated by empty lines."""
    apart: list[str | Block] = []
    for block in blocks:
        apart += ["", block] if apart else [block]
    return apart


def flat_blocks(blocks: Iterator[Block] | Sequence[Block]) -> Iterator[Flat]:
    """Yield blocks, with the contents of folded parts in place."""
    for block in blocks:
        if isinstance(block, Details):
            yield from block.blocks
        else:
            yield block
