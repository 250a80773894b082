"""``bywire reproduce`` with input that it cannot take, and with results that it cannot write."""

from __future__ import annotations

import json
import time

import pytest
from command_line import refused

from bywire.reproduction.reproduction import SOURCES, Reproduction


@pytest.fixture
def quick(monkeypatch):
    """Replace the long computation with an empty reproduction that counts its calls."""
    source = next(iter(SOURCES.all().values()))
    calls = []

    class Quick:
        """Source with the attributes that the command uses."""

        @staticmethod
        def reproduce(progress):
            """Compute nothing."""
            calls.append(progress)
            return Reproduction(source.name, "nobody", ())

    monkeypatch.setattr(type(SOURCES), "find", lambda kind, name: Quick)
    return calls


@pytest.mark.parametrize("flag", [(), ("--json",)], ids=["table", "json"])
def test_unknown_source(bywire, flag):
    refused(bywire("reproduce", "dardaneli2010", *flag), "unknown source", "'dardanelli2010'")


def test_source_is_a_name_and_never_a_path(bywire):
    refused(bywire("reproduce", "../catalog/dardanelli2010"), "unknown source")


def test_folder_is_checked_before_anything_is_computed(bywire, tmp_path, quick):
    taken = tmp_path / "taken"
    taken.write_text("mine")
    started = time.process_time()
    outcome = bywire("reproduce", "dardanelli2010", "--out", taken)
    refused(outcome, "output folder", "File exists", "--out")
    assert quick == []
    assert time.process_time() - started < 5.0


def test_results_are_shown_even_when_they_cannot_be_written(bywire, tmp_path, quick, monkeypatch):
    from bywire.core.errors import FileError

    def full(*_):
        raise FileError("cannot write x: No space left on device")

    monkeypatch.setattr("bywire.report.answer.write_document", full)
    status, out, err = bywire("reproduce", "dardanelli2010", "--out", tmp_path, "--json")
    assert (status, json.loads(out)["source"]) == (2, "dardanelli2010")
    assert err == "bywire: error: cannot write x: No space left on device\n"


def test_interrupt_is_130(bywire, monkeypatch):
    def stopped(kind, name):
        raise KeyboardInterrupt

    monkeypatch.setattr(type(SOURCES), "find", stopped)
    status, out, err = bywire("reproduce", "dardanelli2010", "--json")
    assert (status, out, err) == (130, "", "bywire: interrupted\n")
