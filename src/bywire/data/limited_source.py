"""Files of columns, read in a child process with limits of memory and time.

The memory limit works on Linux only, the time limit on every system.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import shutil
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import count
from pathlib import Path
from subprocess import DEVNULL
from tempfile import mkdtemp
from typing import IO, Any, Literal

import numpy as np
from numpy.typing import NDArray

from bywire.core.child_process import start_python
from bywire.core.errors import FileError
from bywire.core.libraries import how_to_install, one_thread_variables
from bywire.core.machine import address_space, machine_memory
from bywire.core.scratch import process_folder
from bywire.core.typing import Progress
from bywire.data.file_format import Column, FileFormat
from bywire.data.reading_child import NUMBERS, fill, receive, send

SECONDS = 60.0
"""time limit of a library to open a file, and between pieces [s]"""

MOST_MEMORY = 4 * 2**30
"""memory limit in bytes for a library that reads a file, if half the machine's memory is larger"""

_IS_LINUX = sys.platform == "linux"
_PIPE = 2**20  # bytes of a pipe's buffer; a large buffer needs fewer process switches
_State = Literal["idle", "open", "busy"]
"""state of a child: waiting for a file, waiting for a request on the open file, or working"""

_idle: dict[tuple[int, str], list[Child]] = {}
_numbers = count()


class Child:
    """A process that reads files of one format.

    Parameters
    ----------
    module
        Module of the format.
    """

    def __init__(self, module: str) -> None:
        # asammdf writes a temporary file, which close() always removes with its folder.
        self._folder = mkdtemp(dir=process_folder())
        self._process = start_python(
            "bywire.data.reading_child",
            module,
            "forks" if _IS_LINUX else "alone",
            bufsize=0,
            stderr=DEVNULL,
            further={
                **one_thread_variables(),  # it forks, so it must not have threads
                "TMPDIR": self._folder,
                "TEMP": self._folder,
            },
        )
        self.state: _State = "idle"
        self.is_late = False
        with contextlib.suppress(ImportError, AttributeError, OSError):
            import fcntl

            fcntl.fcntl(self.stream, fcntl.F_SETPIPE_SZ, _PIPE)

    @property
    def stream(self) -> IO[bytes]:
        """Messages of the child."""
        assert self._process.stdout is not None
        return self._process.stdout

    def ask(self, message: Mapping[str, Any]) -> None:
        """Send a message."""
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):  # it has ended, as reading the answer will show
            send(self._process.stdin, message)

    @contextmanager
    def within(self, seconds: float) -> Iterator[None]:
        """End the child if the block takes longer."""
        watch = threading.Timer(seconds, self._end_late)
        watch.start()
        try:
            yield
        finally:
            watch.cancel()

    def reason(self) -> str:
        """Return the reason for its end."""
        status = self._process.wait()
        return "" if self.is_late else _ending(status)

    def _end_late(self) -> None:
        self.is_late = True
        self._kill()

    def _kill(self) -> None:
        if os.name == "posix":
            with contextlib.suppress(OSError):
                os.killpg(self._process.pid, signal.SIGKILL)  # with its own children
        else:
            self._process.kill()

    def close(self) -> None:
        """End the process."""
        self._kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            assert stream is not None
            stream.close()
        shutil.rmtree(self._folder, ignore_errors=True)


class LimitedSource:
    """An open file that a child reads.

    Parameters
    ----------
    path, kind
        The file and its format.
    child
        Process that reads it.
    memory
        Limit of its memory in bytes.
    seconds
        Time limit between pieces [s].
    """

    def __init__(
        self, path: Path, kind: FileFormat, child: Child, memory: int, seconds: float
    ) -> None:
        self._path, self._kind, self._child = path, kind, child
        self._memory, self._seconds = memory, seconds
        self._request, self._is_open = next(_numbers), False
        answer = self._answer(
            {
                "path": str(path),
                "folder": os.getcwd(),
                "memory": memory,
                "seconds": seconds,
                "opening": min(seconds, kind.opening),
                "request": self._request,
            }
        )
        self._is_open = True
        columns = [Column(*fields) for fields in answer["columns"]]
        self.columns: Mapping[str, Column] = {column.name: column for column in columns}
        self.left_out: Mapping[str, str] = answer["left_out"]
        self.order: Sequence[str] = list(self.columns)
        self.remarks: Sequence[str] = answer["remarks"]
        self.notes: Mapping[str, Any] = answer["notes"]

    def read(self, names: Sequence[str], progress: Progress) -> dict[str, NDArray[np.float64]]:
        """Return the numbers of some columns, received in pieces from the child."""
        answer = self._answer({"names": list(names)})
        # Allocate memory only here, after the child has rejected numbers that were never written.
        columns = [np.empty(self.columns[name].length or 0) for name in names]
        filled = [0] * len(names)
        total = sum(column.size for column in columns)
        while "end" not in answer:
            k, begin, size = answer["column"], answer["begin"], answer["count"]
            if begin != filled[k] or begin + size > columns[k].size:
                raise self._torn(names[k], begin + size, columns[k].size)
            part = columns[k][begin : begin + size]
            kind = NUMBERS[answer["kind"]]
            numbers = part if kind == "float64" else np.empty(size, kind)
            with self._child.within(self._seconds):
                if not fill(self._child.stream, numbers):
                    raise self._ended(self._child.reason())
            if numbers is not part:
                part[:] = numbers
            filled[k] += size
            progress(f"reading {self._path.name}", sum(filled) / total)
            answer = self._answer(None)
        self.remarks = answer["remarks"]
        for name, column, size in zip(names, columns, filled, strict=True):
            if size != column.size:
                raise self._torn(name, size, column.size)
        return dict(zip(names, columns, strict=True))

    def place(self, name: str, row: int) -> str:
        """Return the place of a number, counted as the format does."""
        word, first = self._kind.counts
        return f"{word} {row + first}"

    def _answer(self, question: Mapping[str, Any] | None) -> dict[str, Any]:
        """Return the child's next message; after some messages, it waits for a request."""
        if question is not None:
            self._child.ask(question)
        self._child.state = "busy"
        with self._child.within(self._seconds):
            answer = receive(self._child.stream)
            # The end of an earlier file's child no longer matters.
            while answer is not None and answer.get("request", self._request) != self._request:
                answer = receive(self._child.stream)
        if answer is None:
            raise self._ended(self._child.reason())
        if "column" not in answer and _IS_LINUX:
            self._child.state = "open" if {"columns", "end"} & set(answer) else "idle"
        if "error" in answer:
            limit = address_space() if answer.get("is_of_library") else 0
            raise FileError(
                answer["error"] + (_limited_to(limit) if limit else ""), name=str(self._path)
            )
        if "memory" in answer:
            if limit := address_space():
                raise self._too_small(limit)
            raise FileError(
                f"{self._path} needs more than {self._memory / 2**30:.3g} GiB of memory to read, "
                "so it may be damaged or malicious. If the file is intact, read fewer signals, or "
                "write it again in smaller pieces",
                name=str(self._path),
            )
        if "ended" in answer:
            raise self._ended(_ending(answer["ended"]))
        return answer

    def _ended(self, reason: str) -> FileError:
        if not reason:
            is_quick = not (self._is_open or self._child.is_late)
            most = min(self._seconds, self._kind.opening) if is_quick else self._seconds
            return FileError(
                f"{self._path}: {'reading' if self._is_open else 'opening'} made no progress for "
                f"{most:g} s, so the file may be damaged or malicious. If it is intact, copy it to "
                "a local disk, or read fewer signals",
                name=str(self._path),
            )
        if limit := address_space():
            return self._too_small(limit)
        return FileError(
            f"{self._path}: the library that reads {self._kind.title} failed ({reason}). The file "
            f"is damaged, or needs more than {self._memory / 2**30:.3g} GiB of memory. Copy or "
            "export it again",
            name=str(self._path),
        )

    def _too_small(self, limit: int) -> FileError:
        return FileError(
            f"{self._path}: reading {self._kind.title} ran out of memory" + _limited_to(limit),
            name=str(self._path),
        )

    def _torn(self, name: str, size: int, declared: int) -> FileError:
        return FileError(
            f"{self._path} is damaged: {name!r} declares {declared} numbers, but {size} "
            "were read. Copy it again, or export it again from its source",
            name=name,
        )


def _limited_to(limit: int) -> str:
    return (
        f". The address space of this process is limited to {limit / 2**30:.3g} GiB (ulimit -v). "
        "If the file is intact, raise the limit, for example with ulimit -v unlimited"
    )


def _ending(status: int) -> str:
    """Describe the end of a process; empty if it exceeded its time limit."""
    if status >= 0:
        return f"exit status {status}"
    with contextlib.suppress(ValueError):
        name = signal.Signals(-status).name
        return "" if name == "SIGXCPU" else name
    return f"signal {-status}"


@contextmanager
def limited(path: Path, kind: FileFormat, seconds: float | None = None) -> Iterator[LimitedSource]:
    """Open a file in a child process.

    Raises
    ------
    FileError
        When the library is not installed, the file is damaged, or a limit is exceeded.
    """
    for name in kind.libraries:
        library = name.partition(".")[0]
        if find_spec(library) is None:
            raise FileError(
                f"{path}: {kind.title} needs the library {library}, which is not installed. "
                f"Install it {how_to_install('measurements')}",
                name=library,
            )
    memory = min(MOST_MEMORY, int(machine_memory() / 2))
    if not _IS_LINUX:
        warnings.warn(
            f"on this system, bywire limits only the time to read {kind.title}, not the memory. "
            "Open untrusted files on Linux only",
            stacklevel=2,
        )
    module = kind.open.__module__
    # The process is part of the key, since a forked process must not share children.
    idle = _idle.setdefault((os.getpid(), module), [])
    child = idle.pop() if idle else Child(module)
    try:
        yield LimitedSource(path, kind, child, memory, seconds or SECONDS)
    finally:
        if child.state == "open":
            child.ask({"names": []})
            child.state = "idle"
        if child.state == "idle":
            idle.append(child)
        else:
            child.close()


def _close_all() -> None:
    for (process, _), children in _idle.items():
        while children and process == os.getpid():
            children.pop().close()


atexit.register(_close_all)
