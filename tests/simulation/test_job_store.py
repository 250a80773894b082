"""A store of finished jobs: what a killed run leaves can be read, what cannot be kept is said."""

from __future__ import annotations

from pathlib import Path

import pytest

from bywire.core.errors import FileError
from bywire.simulation.job_store import JobStore


def test_rows_come_back_but_for_a_line_that_was_cut_off(tmp_path: Path) -> None:
    store = JobStore(tmp_path / "jobs.jsonl")
    assert list(store.rows()) == []
    store.append({"key": "a", "values": [1.0, 0.1]})
    store.append({"key": "b", "values": []})
    assert store.path is not None
    with store.path.open("a") as file:
        file.write('[1, 2]\n{"key": "c", "val')
    assert list(store.rows()) == [{"key": "a", "values": [1.0, 0.1]}, {"key": "b", "values": []}]


def test_without_a_file_nothing_is_kept() -> None:
    store = JobStore(None)
    store.append({"key": "a"})
    assert list(store.rows()) == []


def test_what_cannot_be_read_or_written_is_said(tmp_path: Path) -> None:
    unreadable = tmp_path / "jobs.jsonl"
    unreadable.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileError, match="delete it to start anew"):
        list(JobStore(unreadable).rows())
    with pytest.raises(FileError, match="cannot write"):
        JobStore(tmp_path / "missing" / "jobs.jsonl").append({"key": "a"})
