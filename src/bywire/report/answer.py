"""Base of all results: shown in terminals, notebooks, files and tables from one document."""

from __future__ import annotations

import contextlib
import json
import math
import os
import sys
from abc import ABC, abstractmethod
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast, get_args

from bywire.bench.kpis.kpi import Kpi
from bywire.bench.requirements import Limit
from bywire.core.arguments import require_kinds
from bywire.core.errors import unknown_name
from bywire.report.document import Document, FigureBlock, TableBlock
from bywire.report.result_folder import ResultFolder, result_folder
from bywire.report.tables import Table

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


Outcome = Literal["missed", "not shown", "undecided", "met"]
"""verdicts, the worst first; ``not shown`` if a result judges nothing"""
OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)


@dataclass(frozen=True)
class FigureAt:
    """Key figure of a result, on which a requirement can be judged.

    Parameters
    ----------
    kpi
        The figure with its value, unit and numerical error.
    at
        Where it applies, for example ``"motor.R_m = 0.35 ohm"``. Empty if the result has only one.
    """

    kpi: Kpi
    at: str = ""


def outcome_of(outcomes: Collection[str]) -> Outcome:
    """Return the worst of several verdicts; ``not shown`` if there are none.

    Examples
    --------
    >>> outcome_of(["met", "undecided"]), outcome_of([])
    ('undecided', 'not shown')
    """
    return next((each for each in OUTCOMES if each in outcomes), "not shown")


class AnswerWarning(UserWarning):
    """Warning about a result that the user should read before using its figures."""


class Answer(ABC):
    """A typed result with one document behind all of its representations."""

    @abstractmethod
    def document(self) -> Document:
        """Return the document of the result."""

    @property
    def warnings(self) -> list[str]:
        """Warnings to read before using the figures. Default: none."""
        return []

    @property
    def notes(self) -> list[str]:
        """Notes on the data processing and the result. Default: none."""
        return []

    @property
    def failures(self) -> list[str]:
        """Failed checks, which make the result unusable. Default: none."""
        return []

    @property
    def partial(self) -> str:
        """Remaining content of an interrupted result. Default: empty."""
        return ""

    @property
    def holds(self) -> bool:
        """Whether all requirements and checks are met; otherwise commands exit with 1."""
        return True

    @property
    def key_figures(self) -> list[FigureAt]:
        """Key figures on which requirements can be judged. Default: none."""
        return []

    @property
    def own_limits(self) -> list[Limit]:
        """Limits of these key figures that the result itself judges. Default: none."""
        return []

    @property
    def outcome(self) -> Outcome:
        """Verdict on the result's own requirements and checks."""
        return "met" if self.holds and not self.failures else "missed"

    def as_object(self) -> dict[str, Any]:
        """Return the JSON object that the command prints with ``--json``, without the files."""
        shown: dict[str, Any] = finite(dict(self.document().facts))
        return shown

    def tables(self) -> dict[str, pd.DataFrame]:
        """Return the tables of the page as pandas frames, by caption or section.

        Numbers are in the units in ``frame.attrs["units"]``, keyed by column. A column of units
        follows each column with several units.
        """
        frames: dict[str, pd.DataFrame] = {}
        for section in self.document().page:
            for block in section.blocks:
                if isinstance(block, TableBlock):
                    name = block.caption.rstrip(".") or section.title
                    frames.setdefault(name, frame_of(block.table))
        return frames

    def plot(self, name: str = "") -> Figure:
        """Return a figure of the report, which a notebook displays.

        Parameters
        ----------
        name
            Name of its file in the output folder, without the extension. Default: the first figure.

        Returns
        -------
        matplotlib.figure.Figure
            The figure, which you can change or save.

        Raises
        ------
        UnknownNameError
            When the report has no figure with this name, or no figures.
        """
        require_kinds(Answer.plot, (self, name), {})
        drawn = [b for b in self.document().flat() if isinstance(b, FigureBlock) and b.name]
        named = {block.name: block for block in drawn}
        if name not in named and (name or not named):
            raise unknown_name("figure", name, named)
        figure: Any = (named[name] if name else drawn[0]).figure
        return cast("Figure", figure)

    def write(self, folder: str | Path) -> list[Path]:
        """Write recordings, figures and one self-contained page. Each file is complete or absent.

        Raises
        ------
        ParameterError
            For an invalid path.
        FileError
            When the folder cannot be created or is not writable.
        """
        require_kinds(Answer.write, (self, folder), {})
        return write_document(self.document(), Path(folder))

    def __str__(self) -> str:
        from bywire.report.terminal import terminal_text, verdict_line

        document = self.document()
        return "\n".join(filter(None, [terminal_text(document), verdict_line(document)]))

    def _repr_html_(self) -> str:
        from bywire.report.page import fragment_html

        return fragment_html(self.document(), [f"Warning: {text}." for text in self.warnings])


def frame_of(table: Table) -> pd.DataFrame:
    """Return a table as a pandas frame; see `Answer.tables`."""
    import pandas as pd

    headings: list[str] = []
    columns: list[list[object]] = []
    units: dict[str, str] = {}
    for k, column in enumerate(table.columns):
        cells = [row[k] for row in table.rows]
        headings.append(column.heading)
        columns.append([cell.content for cell in cells])
        known = {cell.unit for cell in cells if cell.unit}
        if len(known) == 1:
            units[column.heading] = known.pop()
        elif known:
            headings.append(f"{column.heading} unit")
            columns.append([cell.unit for cell in cells])
    frame = pd.DataFrame(dict(enumerate(columns)))
    frame.columns = pd.Index(headings)
    frame.attrs["units"] = units
    return frame


def write_document(document: Document, folder: Path) -> list[Path]:
    """Write a document's data files, figures, page and record.

    Raises
    ------
    FileError
        When a file cannot be written.
    KeyboardInterrupt
        When interrupted, with advice on the missing files.
    """
    if not document.has_files:
        return []
    if document.prepare is not None:
        document.prepare(folder)
    with result_folder(folder) as place:
        names = _written(document, place)
    return [folder / name for name in names]


def _written(document: Document, place: ResultFolder) -> list[str]:
    """Write the files of a document and return their names."""
    shown = []
    if document.is_paged:
        shown = [block for block in document.flat() if isinstance(block, FigureBlock)]
    figures = [block for block in shown if block.name]
    names = [
        *(each.name for each in document.attachments),
        *(f"{block.name}.png" for block in figures),
        *([document.page_name] if document.is_paged else []),
        *([document.record] if document.record else []),
    ]
    from bywire.report.drawing import drawn_side_by_side  # loads a module that starts processes

    with drawn_side_by_side(shown):
        for each in document.attachments:
            if each.after_record and document.record:
                _record(document, place, names)
            each.write(place.scratch / each.name)
        if document.record:
            document.facts  # noqa: B018 - made while copies draw
    if document.is_paged:
        from bywire.report.drawing import save_figure
        from bywire.report.identity import identity
        from bywire.report.page import write_page

        for block in figures:
            save_figure(block.figure, place.scratch / f"{block.name}.png")
        write_page(
            place.scratch / document.page_name,
            document.title,
            document.summary,
            document.page,
            banner=document.banner,
            files=names,
            made=identity(),
        )
    if document.record:
        _record(document, place, names)
    return names


def _record(document: Document, place: ResultFolder, names: list[str]) -> None:
    from bywire.report.drawing import write_bytes

    shown = with_files(document, [place.folder / name for name in names])
    write_bytes(place.scratch / document.record, (json.dumps(shown, indent=2) + "\n").encode())


def with_files(document: Document, files: list[Path]) -> dict[str, Any]:
    """Return the JSON object of a document with the written files, its own among them."""
    shown: dict[str, Any] = finite(dict(document.facts))
    return {**shown, "files": [*shown.get("files", []), *map(str, files)]}


def load_matplotlib() -> None:
    """Load matplotlib with the user's configuration.

    bywire ignores a file ``matplotlibrc`` in the working folder: it may come with somebody else's
    data, and may start another program (TeX) to typeset figures.
    """
    is_set_here = os.path.exists("matplotlibrc")
    with contextlib.chdir(sys.prefix) if is_set_here else contextlib.nullcontext():
        import matplotlib  # noqa: F401


def finite(value: Any) -> Any:
    """Return plain data with null for infinite or undefined numbers, which JSON does not allow."""
    if isinstance(value, dict):
        return {key: finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
