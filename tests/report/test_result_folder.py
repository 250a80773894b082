"""A folder contains one result, the old or the new, or is marked as unfinished."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from bywire.core.errors import FileError
from bywire.core.scratch import UNFINISHED, require_finished
from bywire.report import result_folder as module
from bywire.report.answer import write_document
from bywire.report.document import Attachment, Document, FigureBlock, Section
from bywire.report.drawing import write_bytes
from bywire.report.result_folder import earlier_files, result_folder


def document(label: str, names: tuple[str, ...], record: str = "result.json") -> Document:
    figure = Figure(figsize=(1.0, 1.0))
    attachments = [
        Attachment(name, lambda path: write_bytes(path, label.encode())) for name in names
    ]
    sections = [Section("S", [FigureBlock(figure, "A figure.", f"figure-{label}")])]
    return Document(
        label, "", sections, [], {"label": label}, attachments=attachments, record=record
    )


def names_in(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_the_new_result_leaves_nothing_of_the_old(tmp_path: Path) -> None:
    write_document(document("old", ("a.nc", "b.nc"), ""), tmp_path)
    (tmp_path / "mine.csv").write_text("mine")
    (tmp_path / "mine.json").write_text('{"files": ["mine.csv"]}')
    files = write_document(document("new", ("b.nc", "c.nc")), tmp_path)
    ours = {"b.nc", "c.nc", "figure-new.png", "report.html", "result.json"}
    assert {path.name for path in files} == ours
    assert names_in(tmp_path) == {*ours, "mine.csv", "mine.json"}
    assert (tmp_path / "b.nc").read_text() == "new"
    assert earlier_files(tmp_path) == ours
    assert json.loads((tmp_path / "result.json").read_text())["files"] == list(map(str, files))
    require_finished(tmp_path)


class Killed(BaseException):
    """Represents the end of the process."""


def killed_at(step: int) -> Iterator[None]:
    """Count moves, and end the process at one of them."""
    for _ in range(step):
        yield
    raise Killed


@pytest.mark.parametrize("step", range(8))
def test_killed_while_files_are_moved_it_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: int
) -> None:
    """The recording of one is never next to the report of the other without a marker."""
    write_document(document("old", ("a.nc",)), tmp_path)
    moves, replace = killed_at(step), os.replace

    def counted(source: Path, target: Path) -> None:
        if Path(target).parent == tmp_path:
            next(moves)
        replace(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(module.os, "replace", counted)
        try:
            write_document(document("new", ("a.nc", "b.nc")), tmp_path)
            is_killed = False
        except Killed:
            is_killed = True
    assert is_killed == (step < 6)  # the marker, two recordings, figure, page, record
    contents = {
        (tmp_path / "a.nc").read_text() if (tmp_path / "a.nc").exists() else "",
        json.loads((tmp_path / "result.json").read_text())["label"],
    }
    if (tmp_path / UNFINISHED).exists():
        with pytest.raises(FileError, match="contains an incomplete result"):
            require_finished(tmp_path)
    else:
        assert len(contents) == 1
    write_document(document("third", ("d.nc",)), tmp_path)
    assert names_in(tmp_path) == {"d.nc", "figure-third.png", "report.html", "result.json"}


def test_a_file_that_cannot_be_written_leaves_the_old_result(tmp_path: Path) -> None:
    write_document(document("old", ("a.nc",)), tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def full(path: Path) -> Path:
        raise FileError(f"cannot write {path}: No space left on device")

    broken = document("new", ("a.nc",))
    broken.attachments.append(Attachment("b.nc", full))  # type: ignore[attr-defined]
    with pytest.raises(FileError, match="No space left"):
        write_document(broken, tmp_path)
    (tmp_path / "c.nc").mkdir()
    with pytest.raises(FileError, match=r"c\.nc: a folder of that name already exists"):
        write_document(document("new", ("a.nc", "c.nc")), tmp_path)
    (tmp_path / "c.nc").rmdir()
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_an_interrupt_keeps_what_is_written_and_says_so(tmp_path: Path) -> None:
    def interrupted() -> None:
        with result_folder(tmp_path) as place:
            (place.scratch / "a.nc").write_text("new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match="is incomplete"):
        interrupted()
    assert names_in(tmp_path) == {"a.nc", UNFINISHED}
    assert "a.nc" in (tmp_path / UNFINISHED).read_text()
