"""Whole commands are timed in multiples of loading the libraries, and what fails says why."""

import sys

import pytest

from benchmarks.commands import LIBRARIES, Command, measured
from benchmarks.declared import declared
from benchmarks.suite import measure
from bywire.core.errors import UnknownNameError


def test_a_command_is_timed_after_what_it_needs(tmp_path, monkeypatch):
    # Loading libraries takes longest, but this test is not about it.
    exec(LIBRARIES, {})
    monkeypatch.setattr("benchmarks.commands._UNIT", [sys.executable, "-c", "import numpy"])
    kernels = tmp_path / "kernels"  # where no other process compiles
    kernels.mkdir(mode=0o700)
    monkeypatch.setenv("BYWIRE_CACHE", str(kernels))
    ride = tmp_path / "ride.csv"
    ride.write_text("t [s],x [m]\n" + "".join(f"{k},{k}\n" for k in range(20)))
    made, first = "{folder}/ride.csv", ("convert", str(ride), "{folder}/ride.csv")
    again = ("convert", made, "{folder}/again.csv")  # a second time would be refused
    command = Command("command.convert", again, 9.0, first)
    (result,) = measured([command])
    assert result.value is not None, result.note
    assert result.value > 0.1
    assert result.holds == (result.value <= 9.0)
    assert "run once" in result.note


def test_a_command_that_fails_has_no_time(monkeypatch):
    monkeypatch.setattr("benchmarks.commands._UNIT", [sys.executable, "-c", ""])
    (result,) = measured([Command("command.wrong", ("run", "no-such-bench"), 1.0)])
    assert (result.value, result.holds) == (None, None)
    assert "no-such-bench" in result.note


def test_names_of_commands_are_rows_and_parts_can_be_chosen():
    assert all("command." in name for name in declared(Command))
    with pytest.raises(UnknownNameError, match=r"part of the benchmark 'comands'.*commands"):
        measure(parts=["comands"])
