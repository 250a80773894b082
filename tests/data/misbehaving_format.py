"""A format whose files say how their reader misbehaves: what libraries do with damaged files."""

import ctypes
import os
import signal
import time
from contextlib import contextmanager

import numpy as np

from bywire.core.errors import FileError
from bywire.data.file_format import Column, FileFormat

SIZE = 1000


class Reader:
    """Reads as its file says."""

    def __init__(self, wish):
        self.columns = {"t": Column("t", "s", SIZE), "y": Column("y", "m", SIZE, "t")}
        self._wish = wish

    def pieces(self, names):
        for name in names:
            misbehave(self._wish)
            numbers = np.arange(SIZE, dtype=np.int16)
            size = SIZE // 2 if self._wish == "cut" else SIZE
            for begin in range(0, size, 300):
                yield name, begin, numbers[begin : min(begin + 300, size)]


def misbehave(wish):
    if wish == "crash":
        ctypes.string_at(0)
    elif wish == "hang":
        time.sleep(100)
    elif wish == "spin":
        while True:
            pass
    elif wish == "memory":
        np.ones(2**40)
    elif wish == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    elif wish == "abort":
        os.abort()
    elif wish == "large":
        with open("large", "wb") as stream:
            for _ in range(300):
                stream.write(bytes(2**16))
    elif wish == "raise":
        raise IndexError(7)
    elif wish == "refuse":
        raise FileError("refused\nso")
    elif wish == "print":
        os.write(1, b"loud\n")


@contextmanager
def _open(path, options):
    when, _, wish = path.read_text().partition(" ")
    if when == "early":
        misbehave(wish)
    yield Reader(wish if when == "late" else "")


FORMAT = FileFormat(
    "odd", "an odd file", (".odd",), lambda head: True, _open, lambda *a: None, libraries=("json",)
)
