"""A disk that fills up while a library writes: one error at the end, and the library survives."""

import io

import numpy as np
import pytest
from measurement_files import measurement

from bywire.core.errors import FileError
from bywire.data.formats import mat73
from bywire.data.formats.mat73 import FailingStream, kept
from bywire.data.writing import write_measurement


class FullDisk(io.FileIO):
    """A file that takes 1000 bytes."""

    def write(self, data):
        room = 1000 - self.tell()
        if room <= 0:
            raise OSError(28, "No space left on device")
        return super().write(data[:room])


def test_everything_is_written_and_read_back(tmp_path):
    with kept(tmp_path / "a") as stream:
        stream.write(b"abcdef")
        stream.seek(2)
        stream.write(np.array([1, 2], dtype="u1"))
        stream.seek(0)
        buffer = bytearray(8)
        assert stream.readinto(buffer) == 8
    assert bytes(buffer) == b"ab\x01\x02ef\0\0"
    assert (tmp_path / "a").read_bytes() == b"ab\x01\x02ef"


def test_the_first_error_is_remembered(tmp_path):
    with FullDisk(tmp_path / "a", "w+b") as file:
        stream = FailingStream(file)
        assert stream.write(bytes(3000)) == 3000
        assert stream.error is not None
        assert stream.error.errno == 28
        assert stream.write(b"more") == 4
    assert (tmp_path / "a").stat().st_size == 1000


def test_hdf5_on_a_full_disk_is_one_error_and_no_file(tmp_path, monkeypatch):
    pytest.importorskip("h5py")
    monkeypatch.setattr(mat73, "FileIO", FullDisk)
    with pytest.raises(FileError, match=r"cannot write .*No space left on device"):
        write_measurement(measurement(), tmp_path / "a.h5")
    assert not list(tmp_path.iterdir())
