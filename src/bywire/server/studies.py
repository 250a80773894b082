"""How far a study is, as its folder tells."""

from __future__ import annotations

from pathlib import Path

from bywire.core.errors import FileError
from bywire.studies.plan import CHUNK
from bywire.studies.store import StudyStore


def how_far(folder: Path) -> str:
    """Return in a sentence how much of a study is computed."""
    store = StudyStore(folder)
    try:
        said = store.record()
    except FileError:
        return "Nothing of it is computed yet."
    done = min(len(store.finished()) * CHUNK, int(said["cases"]))
    return f"{done:,} of {said['cases']:,} cases are computed."
