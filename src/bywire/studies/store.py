"""The folder of a study: a Parquet file a chunk, whose they are, and how many are asked for.

The files are the truth: a chunk that is there is never computed again. Each appears whole or not at
all, so that whatever is killed loses the chunks that it was at.
"""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from bywire.cases.store import PieceFolder
from bywire.core.arguments import whole_number
from bywire.core.brake import loaded_files
from bywire.core.errors import FileError, ParameterError
from bywire.studies.chunk import Columns, read_chunk, require_pyarrow, write_chunk
from bywire.studies.designs import MOST, SPANNED
from bywire.studies.meant_study import RECORD, require_no_file
from bywire.studies.plan import CHUNK, StudyPlan

if TYPE_CHECKING:
    import pandas as pd

CHUNKS = "chunks"
"""folder of the chunks"""


@dataclass(frozen=True)
class Origin:
    """What a study was read from.

    Parameters
    ----------
    file
        Study file.
    overrides
        Changes of its bench, as ``--set`` takes them.
    """

    file: Path
    overrides: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class StudyStore(PieceFolder):
    """Where the chunks of a study lie.

    Parameters
    ----------
    folder
        The study's folder.
    """

    NOUN = "study"
    KIND = "study of many cases"
    COMMAND = "bywire study run"
    RECORD = RECORD
    PIECES = CHUNKS
    FILE = "{:06d}.parquet"
    SAID: ClassVar[Mapping[str, type]] = {
        "digest": str,
        "source": str,
        "cases": int,
        "set": dict,
        "systems": list,
        "study": dict,
    }

    # What was read or written here, so that nobody who judges a study waits for its files again.
    _known: dict[int, Columns] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def elsewhere(self) -> str:
        """What to do where the folder holds another study."""
        return (
            "what is computed there does not belong to this one; run it into another folder, "
            "bywire study run FILE --out FOLDER, or remove that one"
        )

    def open(self, plan: StudyPlan, origin: Origin) -> None:
        """Make the folder one of a study, or refuse that of another.

        Raises
        ------
        FileError
            When it holds another study, or cannot be written.
        """
        require_pyarrow()
        about = {
            "source": str(origin.file.resolve()),
            "name": plan.name,
            "cases": plan.total,
            "chunk": CHUNK,
            "set": dict(origin.overrides),
            "systems": list(loaded_files()),
        }
        self.begin(plan, about)

    def asked_and_computed(self, plan: StudyPlan) -> tuple[int, int]:
        """Return for how many cases the folder was asked, and how many of them are computed.

        Both are zero where it does not hold this study. In designs that seek, both are of each
        requirement: what is computed, of the one that has the most.
        """
        if not (self.folder / RECORD).exists():
            return 0, 0
        known = self.record()
        if known["digest"] != plan.digest:
            return 0, 0
        there = self.finished()
        if plan.sought is None:
            chunks = max(there, default=-1) + 1
        else:
            turns = Counter(number % plan.sought.requirements for number in there)
            chunks = max(turns.values(), default=0)
        return int(known["cases"]), min(int(known["cases"]), CHUNK * chunks)

    def record(self) -> dict[str, Any]:
        """Return what the folder says of its study.

        Raises
        ------
        FileError
            When it holds none.
        """
        require_no_file(self.folder)
        return super().record()

    @property
    def resume_command(self) -> str:
        """Command that goes on with the study, with the brakes that were loaded by path."""
        words = ["bywire", "study", "resume", str(self.folder)]
        return shlex.join([*words, *(w for file in loaded_files() for w in ("--system", file))])

    def drop_damaged(self) -> int:
        """Take away files of chunks that cannot be read, so that they are computed again.

        Returns
        -------
        int
            How many there were.
        """
        require_pyarrow()
        damaged = 0
        for chunk in self.finished():
            try:
                self.columns(chunk)
            except FileError:
                self.path(chunk).unlink()
                damaged += 1
        return damaged

    def write(self, chunk: int, columns: Columns, units: Mapping[str, str]) -> None:
        """Keep a chunk, whole or not at all.

        Raises
        ------
        FileError
            When it cannot be written.
        """
        columns = {  # texts as they come back from the file
            name: column.astype(object) if column.dtype.kind == "U" else column
            for name, column in columns.items()
        }
        marks = self._marks(chunk)
        self.keep_file(chunk, lambda fresh: write_chunk(fresh, columns, units, marks))
        self._known[chunk] = columns

    def read(self, chunks: int) -> pd.DataFrame:
        """Return all cases of the first chunks that are there, in their order.

        Raises
        ------
        FileError
            When a file is damaged.
        """
        import pandas as pd

        each = [self.columns(n) for n in sorted(self.finished()) if n < chunks]
        names = each[0] if each else ()
        return pd.DataFrame({n: np.concatenate([columns[n] for columns in each]) for n in names})

    def columns(self, chunk: int) -> Columns:
        """Return the cases of a chunk that is there, as they were when it was read or written here.

        Raises
        ------
        FileError
            When its file is damaged.
        """
        if chunk not in self._known:
            self._known[chunk] = self._read(chunk)
        return self._known[chunk]

    def _read(self, chunk: int) -> Columns:
        """Return what the file of a chunk holds; see `columns`."""
        path = self.path(chunk)
        require_pyarrow()
        try:
            columns, marks = read_chunk(path)
        except Exception as error:  # the library raises what it likes of damaged files
            raise FileError(
                f"{path} is damaged ({type(error).__name__}): '{self.resume_command}' computes it "
                "again"
            ) from None
        if any(marks.get(key) != value for key, value in self._marks(chunk).items()):
            raise FileError(
                f"{path} is of another study, or another chunk of this one: "
                f"'{self.resume_command}' computes it again"
            )
        return columns

    def _marks(self, chunk: int) -> dict[bytes, bytes]:
        """Return what tells a chunk's file from any other."""
        return {b"study": self._digest, b"chunk": str(chunk).encode()}

    @cached_property
    def _digest(self) -> bytes:
        return str(self.record()["digest"]).encode()


# --- How many cases are asked for, beside what the file says and the folder has


def with_cases(plan: StudyPlan, store: StudyStore, cases: int | None) -> StudyPlan:
    """Return the plan with so many cases, and with all that its folder was asked for.

    Parameters
    ----------
    plan
        The study as its file says.
    store
        Its folder.
    cases
        Cases asked for; None for as many as the file and the folder say. Fewer than the folder was
        asked for take back those that are not computed.

    Raises
    ------
    ParameterError
        For fewer than are computed, too few, too many, and where the design says how many there
        are.
    """
    if cases is not None:
        cases = whole_number("cases", cases, 1, MOST)
    if plan.design in SPANNED:
        if cases is not None:
            require_extensible(plan, cases)
        return plan
    if plan.is_sampled or plan.sought is not None:
        asked, computed = store.asked_and_computed(plan)
        if cases is not None and cases < computed:
            raise ParameterError(
                f"cases = {cases}: {store.folder} has {computed} already, and none are taken off: "
                "name more of them, or another folder"
            )
        extended = replace(plan, cases=max(plan.cases, asked) if cases is None else cases)
        if extended.sought is not None:
            extended.sought.require_budget()
        return extended
    given = plan if cases is None else replace(plan, cases=cases)
    given.points  # noqa: B018 - refuses too few before anything runs
    return given


def require_extensible(plan: StudyPlan, cases: int) -> None:
    """Refuse to add cases to a design that has its own.

    Raises
    ------
    ParameterError
        When it lists them, or they belong together in groups.
    """
    if plan.is_sampled or plan.sought is not None:
        return
    why = (
        "it lists them by quantities and levels"
        if plan.design in SPANNED
        else "its groups belong together"
    )
    raise ParameterError(
        f"cases = {cases}: none are added to a study of {plan.design!r}, for {why}: change the "
        "study file, and run it into another folder"
    )
