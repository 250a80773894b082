"""A file to write that takes everything, and says at its end what could not be written.

The HDF library does not survive a write that fails: what it still holds is written at the end of
the process, which then crashes.
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer as Buffer
    from _typeshed import WriteableBuffer


class FailingStream(io.RawIOBase):
    """A file whose first error is remembered; nothing is written after it.

    Parameters
    ----------
    stream
        The file, unbuffered.
    """

    def __init__(self, stream: FileIO) -> None:
        super().__init__()
        self._stream = stream
        self.error: OSError | None = None

    def write(self, data: Buffer, /) -> int:
        """Write everything, or remember why not."""
        left = memoryview(data).cast("B")
        size = len(left)
        try:
            while left and self.error is None:
                left = left[self._stream.write(left) :]
        except OSError as error:
            self.error = error
        return size

    def truncate(self, size: int | None = None, /) -> int:
        """Set the size of the file, or remember why not."""
        try:
            return self._stream.truncate(size)
        except OSError as error:
            self.error = self.error or error
            return 0

    def readinto(self, buffer: WriteableBuffer, /) -> int:
        """Read what was written; zeros where nothing could be."""
        wanted = memoryview(buffer).cast("B")
        count = self._stream.readinto(wanted) or 0
        wanted[count:] = bytes(len(wanted) - count)
        return len(wanted)

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        """Go to a place."""
        return self._stream.seek(offset, whence)


@contextmanager
def kept(path: Path) -> Iterator[FailingStream]:
    """Open a new file for a library that must not see an error.

    Raises
    ------
    OSError
        At the end, the first one that writing met.
    """
    with FileIO(path, "w+") as stream:
        failing = FailingStream(stream)
        yield failing
    if failing.error is not None:
        raise failing.error
