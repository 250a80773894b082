"""Child process in which a library reads a measurement file under limits.

Libraries trust a file's own declarations: a damaged or malicious file may crash them, make them run
forever, or request all memory. Here, such a file ends only the child.

Messages in both directions consist of a length, a JSON object and, for a piece of a column, its raw
numbers; nothing is unpickled. The reader sends ``{path, folder, memory, seconds, opening}``, and
receives ``{columns, left_out, remarks, notes}``. It may then send ``{names}`` repeatedly, and ends
with an empty list. It receives pieces ``{column, begin, count, kind}`` and ``{end, remarks}``.
``{error}`` and ``{memory}`` end the exchange early.

On Linux, the process imports the library once and forks for each file. A file then costs
milliseconds, starts from a clean state and has its own limits. Other systems use a process per
file.
"""

from __future__ import annotations

import errno
import importlib
import json
import math
import os
import struct
import sys
import time
from collections.abc import Mapping
from dataclasses import astuple
from io import RawIOBase
from pathlib import Path
from typing import IO, Any, cast

import numpy as np

from bywire.core.errors import FileError
from bywire.data.file_format import FileFormat, PieceSource, ReadOptions

NUMBERS = ("float64", "float32", "int32", "int16", "uint32", "uint16", "int8", "uint8")
"""types of numbers in messages"""

_LENGTH = struct.Struct("<I")


def send(stream: IO[bytes], message: Mapping[str, Any], numbers: Any = b"") -> None:
    """Write a message, followed by numbers."""
    text = json.dumps(message).encode()
    for part in (_LENGTH.pack(len(text)) + text, memoryview(numbers).cast("B")):
        left = part
        while left:
            left = left[stream.write(left) :]


def receive(stream: IO[bytes]) -> dict[str, Any] | None:
    """Return the next message; None if the other side has ended."""
    head = bytearray(_LENGTH.size)
    if not fill(stream, head):
        return None
    text = bytearray(_LENGTH.unpack(head)[0])
    return cast(dict[str, Any], json.loads(text)) if fill(stream, text) else None


def fill(stream: IO[bytes], buffer: Any) -> bool:
    """Fill a buffer; return whether all bytes arrived."""
    left = memoryview(buffer).cast("B")
    while left:
        count = cast(RawIOBase, stream).readinto(left)
        if not count:
            return False
        left = left[count:]
    return True


def main(module: str, is_forking: bool) -> None:
    """Read the requested files until the requests end."""
    requests, answers = open(0, "rb", buffering=0), open(os.dup(1), "wb", buffering=0)  # noqa: SIM115
    os.dup2(2, 1)  # libraries must not print into the messages
    kind: FileFormat = importlib.import_module(module).FORMAT
    try:
        for name in kind.libraries:
            importlib.import_module(name)
        missing = ""
    except (ImportError, MemoryError, OSError) as error:
        missing = str(error) or "out of memory"
    while (request := receive(requests)) is not None:
        if missing:
            what = f"{request['path']}: the library that reads {kind.title} cannot be loaded"
            text = f"{what} ({missing}). Install it again"
            send(answers, {"error": text, "is_of_library": True})
        elif not is_forking:
            _serve(kind, request, requests, answers)
            return
        else:
            child = os.fork()
            if not child:
                status = 1
                try:
                    _limit(request["memory"])
                    _serve(kind, request, requests, answers)
                    status = 0
                finally:
                    os._exit(status)
            status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
            if status:
                send(answers, {"ended": status, "request": request["request"]})


def _serve(
    kind: FileFormat, request: Mapping[str, Any], requests: IO[bytes], answers: IO[bytes]
) -> None:
    """Answer the requests for one file."""
    path = Path(request["path"])
    try:
        os.chdir(request["folder"])
        _allow(request["opening"])
        with kind.open(path, ReadOptions()) as opened:
            source = cast(PieceSource, opened)
            columns = source.columns
            described: dict[str, Any] = {"columns": [astuple(c) for c in columns.values()]}
            described["left_out"] = dict(getattr(source, "left_out", {}))
            described["remarks"] = list(getattr(source, "remarks", []))
            send(answers, described | {"notes": getattr(source, "notes", {})})
            while names := (receive(requests) or {"names": []})["names"]:
                for name, begin, part in source.pieces(names):
                    _allow(request["seconds"])
                    # The stored type is kept: single precision halves the traffic in the pipe.
                    is_plain = part.dtype.isnative and part.dtype.name in NUMBERS
                    numbers = np.ascontiguousarray(part, None if is_plain else np.float64)
                    place = {
                        "column": names.index(name),
                        "begin": begin,
                        "count": numbers.size,
                        "kind": NUMBERS.index(numbers.dtype.name),
                    }
                    send(answers, place, numbers)
                send(answers, {"end": True, "remarks": list(getattr(source, "remarks", []))})
    except FileError as error:
        send(answers, {"error": str(error)})
    except MemoryError:
        send(answers, {"memory": True})
    except Exception as error:  # libraries fail in as many ways as files can be damaged
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())[:200]
        if isinstance(error, LookupError) or not reason:
            reason = "its parts are inconsistent"
        what = f"{path} is damaged: bywire cannot read it as {kind.title} ({reason})"
        hint = "Copy it again, or export it again from its source"
        if getattr(error, "errno", None) == errno.ENOSPC:
            what = f"{path} cannot be read: there is no space for the library's temporary files"
            hint = "Free some space there, or set TMPDIR to another folder"
        send(answers, {"error": f"{what}. {hint}", "is_of_library": True})


def _limit(memory: int) -> None:
    """Limit this process to some memory beyond its current one, and limit the files it writes."""
    import resource

    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + memory
    for kind, wanted in (
        (resource.RLIMIT_AS, most),
        (resource.RLIMIT_FSIZE, memory),
        (resource.RLIMIT_CORE, 0),
    ):
        inherited = [limit for limit in resource.getrlimit(kind) if limit != resource.RLIM_INFINITY]
        allowed = min([wanted, *inherited])  # an inherited limit cannot be raised
        resource.setrlimit(kind, (allowed, allowed))


def _allow(seconds: float) -> None:
    """Limit the processor time until the next piece, in case the reader has ended."""
    if sys.platform == "linux":
        import resource

        hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(time.process_time() + seconds), hard))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2] == "forks")
