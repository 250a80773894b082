"""What is read into memory is bounded by what the machine has."""

import pytest
from measurement_files import file_of

from bywire.core.errors import FileError, ParameterError
from bywire.data import file_format
from bywire.data.alignment import resample
from bywire.data.measurement import read_measurement


def test_half_of_the_memory_and_never_more_than_8_gib(monkeypatch):
    monkeypatch.setattr(file_format, "machine_memory", lambda: 64e9)
    assert file_format.room() == 8 * 2**30
    monkeypatch.setattr(file_format, "machine_memory", lambda: 4e9)
    assert file_format.room() == 2_000_000_000


def test_a_small_machine_refuses_early_unless_asked(tmp_path, monkeypatch):
    path = file_of(tmp_path, "mat")
    monkeypatch.setattr(file_format, "machine_memory", lambda: 12_000.0)
    with pytest.raises(FileError, match="fewer signals"):
        read_measurement(path)
    run = read_measurement(path, largest=10_000)
    with pytest.raises(ParameterError, match="a larger"):
        resample(run, "1 ms")
