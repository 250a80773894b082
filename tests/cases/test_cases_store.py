"""Stores of finished pieces: a killed run can be resumed, and a damaged piece is missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import pytest

from bywire.cases.identity import digest_of
from bywire.cases.store import PieceFolder, PieceLines
from bywire.core.errors import FileError
from raising import raises


def values_of(row: dict[str, Any]) -> list[float]:
    return [float(each) for each in row["values"]]


def test_pieces_come_back_but_for_a_line_that_was_cut_off(tmp_path: Path) -> None:
    lines = PieceLines(tmp_path / "made" / "starts.jsonl")
    assert list(lines.pieces(values_of)) == []
    lines.keep("a", {"values": [1.0, 0.1]})
    lines.keep("b", {"values": []})
    assert lines.path is not None
    assert (
        lines.path.read_text() == '{"key": "a", "values": [1.0, 0.1]}\n{"key": "b", "values": []}\n'
    )
    with lines.path.open("a") as file:
        file.write('[1, 2]\n{"key": "d", "values": 3}\n' + "[" * 100_000 + '\n{"key": "c", "val')
    kept = [("a", [1.0, 0.1]), ("b", [])]
    assert list(lines.pieces(values_of)) == kept
    lines.keep("c", {"values": [2.0]})  # on a line of its own
    assert list(lines.pieces(values_of)) == [*kept, ("c", [2.0])]


def test_without_a_file_nothing_is_kept() -> None:
    lines = PieceLines(None)
    lines.keep("a", {"values": []})
    assert list(lines.pieces(values_of)) == []


def test_lines_that_cannot_be_read_or_written_are_refused(tmp_path: Path) -> None:
    unreadable = tmp_path / "starts.jsonl"
    unreadable.write_bytes(b"\xff\xfe\x00")
    with raises(FileError, name=str(unreadable)):
        list(PieceLines(unreadable).pieces(values_of))
    with pytest.raises(FileError, match="cannot write"):
        PieceLines(unreadable / "starts.jsonl").keep("a", {})


@dataclass(frozen=True)
class Sums:
    """A plan of something."""

    identity: Mapping[str, Any] = field(default_factory=lambda: {"seed": 1})
    name: str = "sums"

    @property
    def digest(self) -> str:
        return digest_of(self.identity)


class SumStore(PieceFolder):
    NOUN = "sum"
    KIND = "sum of many terms"
    COMMAND = "bywire sum"
    RECORD = "sum.json"
    PIECES = "terms"
    FILE = "{:03d}.txt"
    SAID: ClassVar[Mapping[str, type]] = {"digest": str, "sum": dict}

    @property
    def elsewhere(self) -> str:
        return "take another folder"


def test_a_folder_is_that_of_one_plan(tmp_path: Path) -> None:
    store = SumStore(tmp_path / "out")
    with raises(FileError, name=str(store.folder)):
        store.record()
    assert not store.holds(Sums())
    store.begin(Sums(), {"name": "sums"})
    assert [*store.require(Sums())] == ["digest", "name", "sum"]
    store.begin(Sums(), {"name": "renamed"})  # it goes on
    assert store.holds(Sums())
    assert not store.holds(Sums({"seed": 2}))
    other = r"out contains another sum \(seed: 1, now 2\)\. take another folder"
    for refuse in (store.require, lambda plan: store.begin(plan, {})):
        with pytest.raises(FileError, match=other):
            refuse(Sums({"seed": 2}))


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"digest": 1, "sum": {}}', "[" * 100_000])
def test_a_damaged_record_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "sum.json").write_text(text)
    store = SumStore(tmp_path)
    assert not store.holds(Sums())
    for refuse in (store.record, lambda: store.begin(Sums(), {})):
        with raises(FileError, name=str(tmp_path / "sum.json")):
            refuse()


def test_a_piece_is_there_whole_or_not_at_all(tmp_path: Path) -> None:
    store = SumStore(tmp_path)
    store.begin(Sums(), {})
    left = store.path(0).parent / ".bywire-left"  # by a process that was killed
    left.mkdir()
    store.keep_file(7, lambda fresh: fresh.write_text("7"))

    def interrupted(fresh: Path) -> None:
        fresh.write_text("half of it")
        raise KeyboardInterrupt

    for number in (7, 8):
        with pytest.raises(KeyboardInterrupt):
            store.keep_file(number, interrupted)
    (tmp_path / "terms" / "notes.txt").write_text("not a piece")
    assert store.finished() == {7}
    assert store.path(7).read_text() == "7"
    assert sorted(path.name for path in left.parent.iterdir()) == ["007.txt", "notes.txt"]


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "terms").write_text("a file in its place")
    store = SumStore(tmp_path)
    for refuse in (lambda: store.begin(Sums(), {}), lambda: store.keep_file(1, Path.touch)):
        with pytest.raises(FileError, match=r"cannot write .*resume the sum"):
            refuse()
