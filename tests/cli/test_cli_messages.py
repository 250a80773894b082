"""Readable messages: short, with a next step, and no library output among results."""

from __future__ import annotations

import errno
import os

import numpy as np
import pytest
import xarray as xr

from bywire.core.clean_text import shortened
from bywire.core.errors import FileError
from bywire.data.formats import mdf4
from bywire.data.writing import write_measurement
from bywire.usecases import use_cases


def test_a_name_of_hundreds_of_characters_is_shortened(bywire, bench):
    name = 400 * "x"
    outcome = bywire("run", bench(), "--set", f"{name}.y=1")
    assert outcome.status == 2
    assert len(outcome.err) < 1000
    assert "x..." in outcome.err


def test_a_message_keeps_its_beginning_and_its_end(bywire, bench, monkeypatch):
    def failing(*_, **__):
        raise FileError("the file a.csv is odd: " + 50_000 * "x, " + "export it again")

    monkeypatch.setitem(vars(use_cases()["run"]), "function", failing)
    outcome = bywire("run", bench())
    assert outcome.err.startswith("bywire: error: the file a.csv is odd: x, x")
    assert outcome.err.endswith("export it again\n")
    assert len(outcome.err) < 4000


def test_what_is_short_stays():
    for text in (
        "",
        "a line\nand another",
        "/" + "/".join(["folder"] * 50) + "/file.nc: is damaged",
    ):
        assert shortened(text) == text


def test_a_full_disk_is_said_with_place_and_next_step(bywire, bench, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "somewhere/file")

    monkeypatch.setitem(vars(use_cases()["run"]), "function", full)
    outcome = bywire("run", bench())
    assert outcome.status == 3
    assert outcome.lines == [
        "bywire: error: somewhere/file: No space left on device. Free some space, or choose "
        "another folder with --out or TMPDIR"
    ]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyError("comment")])
def test_what_a_library_prints_is_no_result(capsys, monkeypatch, tmp_path, error):
    """Asammdf prints all its information before it raises an error."""

    def loud(*_, **__):
        print(1000 * "dump ")
        raise error

    monkeypatch.setattr(mdf4, "library", loud)
    data = xr.Dataset({"p": ("time", np.zeros(3), {"units": "Pa"})}, {"time": [0.0, 1.0, 2.0]})
    with pytest.raises(
        FileError, match=r"cannot write .*a\.mf4: .*. Free some space there, or choose"
    ):
        write_measurement(data, tmp_path / "a.mf4")
    assert capsys.readouterr().out == ""
    assert list(tmp_path.iterdir()) == []


def test_help_shows_units_in_brackets(bywire):
    assert "p_set=Demand [bar]" in bywire("identify", "--help").out
