"""The benchmark of measurement files measures, and says so where a library is not there."""

import pytest

from benchmarks.general import measurement_files


def test_reading_is_measured(monkeypatch):
    pytest.importorskip("asammdf")
    monkeypatch.setattr(measurement_files, "SECONDS", 1)
    monkeypatch.setattr(measurement_files, "_ROUNDS", 1)
    (found,) = measurement_files.measured()
    assert found.id == "read.mdf4"
    assert found.value > 0.0
    assert found.holds == (found.value <= 1.5)


def test_without_the_library_nothing_is_measured(monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(measurement_files.importlib, "import_module", missing)
    (found,) = measurement_files.measured()
    assert (found.value, found.holds) == (None, None)
    assert "'.[measurements]'" in found.note
