"""A result, written once: the blocks that terminal, JSON, HTML page and files are made of.

A `Document` loads no plotting: its figures are drawn when a page or a file wants them.
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
    """A figure that was drawn elsewhere.

    Parameters
    ----------
    png, svg
        Its files.
    axes
        Where its axes lie; see `bywire.report.drawing.axes_of`.
    """

    png: bytes
    svg: bytes
    axes: str


# --- Blocks


@dataclass(frozen=True)
class Paragraph:
    """Plain text; a terminal wraps it where it is longer than a line."""

    text: str


@dataclass(frozen=True)
class Listing:
    """Plain texts, each with a bullet, below a line of their own if there is one."""

    texts: Sequence[str]
    title: str = ""


@dataclass(frozen=True)
class FigureBlock:
    """A figure with its caption; the page numbers it.

    Parameters
    ----------
    source
        The figure, or what draws it.
    caption
        What it shows.
    name
        Its file in an output folder, without the ending; no file where it is empty.
    is_long
        Whether it takes much longer to draw than most, as one of many panels does: where figures
        are drawn side by side it is begun first.
    """

    source: Figure | Callable[[], Figure]
    caption: str
    name: str = ""
    is_long: bool = False

    @cached_property
    def figure(self) -> Figure | Picture:
        """The figure, made on first use, or what was drawn of it elsewhere."""
        return self.source() if callable(self.source) else self.source


@dataclass(frozen=True)
class Drawing:
    """A drawing that takes the colors of the page it stands in, with its caption.

    Parameters
    ----------
    source
        What makes it: an SVG element as text, with its own description and all text escaped.
    caption
        What it shows.
    """

    source: Callable[[], str]
    caption: str


@dataclass(frozen=True)
class TableBlock:
    """A table, with a caption that the page numbers.

    Parameters
    ----------
    title
        Line above it on a terminal, which shows no captions; none where it is empty.
    most
        Rows that a terminal shows without ``--verbose``; 0 for all.
    """

    table: Table
    caption: str = ""
    title: str = ""
    most: int = 0


@dataclass(frozen=True)
class Details:
    """Blocks that a page folds until the reader opens them; a terminal shows them on request.

    On a terminal that is ``--verbose``.
    """

    title: str
    blocks: Sequence[Flat]


Flat = Paragraph | Listing | FigureBlock | Drawing | TableBlock
Block = Flat | Details


@dataclass(frozen=True)
class Section:
    """A heading and what stands under it."""

    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Banner:
    """The outcome in one line at the top: ``good``, ``bad``, ``open`` or neither."""

    text: str
    verdict: Literal["good", "bad", "open", "none"] = "none"


@dataclass(frozen=True)
class Attachment:
    """A file of data beside the page.

    Parameters
    ----------
    name
        File name in the output folder.
    write
        ``write(path)``: writes it whole or not at all and returns the path.
    after_record
        Whether the document's record is written before it: values that must never lie without
        what says whether to believe them.
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
    """A value that the user set, and that is not what it would be otherwise.

    Parameters
    ----------
    name
        What ``--set`` calls it.
    now, before
        Both values as text with unit.
    of
        What it changes: the name of a parameter set, or whose defaults.
    where
        Where the value before comes from.
    """

    name: str
    now: str
    before: str
    of: str
    where: str = ""


@dataclass(frozen=True)
class Document:
    """What a result has to say.

    Parameters
    ----------
    title, summary
        Heading of the page, and one line below it.
    sections
        The page; or what makes it, where that costs drawing.
    brief
        What a terminal shows, a text or block each: mostly blocks that the page has as well. The
        banner's text is its last line.
    data
        The JSON object, but for the files, or what makes it, where that costs statistics; NaN and
        infinite numbers become null.
    banner
        Outcome, above the contents of the page.
    attachments
        Files of data.
    record
        File of the output folder that keeps the JSON object; none where it is empty.
    heed
        Lines for standard error before the result: what was set or left out.
    remarks
        Lines for standard error after the result, such as requirements that are not met.
    file_notes
        What is to be known of the files of an output folder, or why there are none.
    prepare
        ``prepare(folder)``: called before anything is written, to refuse a folder or to tidy it.
    is_paged
        Whether an output folder gets a page and figures; not where an interrupt left too little.
    page_name
        File of the page.
    has_files
        Whether it may be written into a folder; its JSON object then lists the files.
    headline
        What a reader must know first: the first words on a terminal and of the JSON object.
    changes
        What the user changed, which a terminal shows first and the JSON object has by name; None
        where nothing can be. Pages do not show it by themselves: a section holds it
        (`bywire.report.subject`).
    """

    title: str
    summary: str
    sections: Sequence[Section] | Callable[[], Sequence[Section]]
    brief: Sequence[str | Block]
    data: Mapping[str, Any] | Callable[[], Mapping[str, Any]]
    banner: Banner | None = None
    attachments: Sequence[Attachment] = ()
    record: str = ""
    heed: Sequence[str] = ()
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
        """The sections, made on first use."""
        return self.sections() if callable(self.sections) else self.sections

    @cached_property
    def facts(self) -> Mapping[str, Any]:
        """The JSON object, made on first use."""
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
        """Yield the blocks of all sections, folded ones among them."""
        return flat_blocks(block for section in self.page for block in section.blocks)


def spaced(blocks: Iterable[str | Block]) -> list[str | Block]:
    """Return blocks of a brief with an empty line between them."""
    apart: list[str | Block] = []
    for block in blocks:
        apart += ["", block] if apart else [block]
    return apart


def flat_blocks(blocks: Iterator[Block] | Sequence[Block]) -> Iterator[Flat]:
    """Yield blocks, those of folded parts in their place."""
    for block in blocks:
        if isinstance(block, Details):
            yield from block.blocks
        else:
            yield block
