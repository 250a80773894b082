"""Measurement files that are dropped on a page: kept as they came, and read by nobody here.

Whoever made them, their bytes are opened by the limited process of `bywire.data.limited_source`.
"""

from __future__ import annotations

from pathlib import Path

from bywire.core.scratch import scratch_folder
from bywire.server.contents import endings
from bywire.server.exchange import Request
from bywire.server.place import Place, safe_name
from bywire.server.refusal import RefusedError

_PIECE = 2**20


def uploaded(place: Place, request: Request, name: str, largest: int) -> Path:
    """Keep a file, whole or not at all, under a name that nothing has yet.

    Raises
    ------
    RefusedError
        With status 415 for an ending of no format, 411 and 413 for its length, 400 where it does
        not come to its end.
    OSError
        When there is no room for it.
    """
    if Path(safe_name(name)).suffix.lower() not in endings():
        raise RefusedError(
            415,
            f"{name[:100]!r} has the ending of no measurement format: known are "
            f"{', '.join(endings())}",
        )
    request.require_length(largest, "a measurement")
    if request.length == 0:
        raise RefusedError(400, f"{name[:100]!r} is empty: was the recording stopped?")
    with scratch_folder(place.measurements()) as scratch:
        fresh = scratch / "measurement"
        with fresh.open("wb") as stream:
            left = request.length
            while left:
                piece = request.body.read(min(left, _PIECE))
                if not piece:
                    what = f"{name[:100]!r} did not come to its end: send it again"
                    raise RefusedError(400, what)
                stream.write(piece)
                left -= len(piece)
        return place.kept(fresh, name)
