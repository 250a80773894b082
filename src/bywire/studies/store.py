"""Folder of a study: Parquet files of chunks, the identity of the study, and its size.

A chunk depends only on the plan and its number, regardless of where and in which order it is
computed. Each finished chunk is a file. Once all chunks of a group are finished, a single file
replaces theirs, so that the number of files of a large study stays small.
"""

from __future__ import annotations

import gc
import json
import math
import os
import re
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from bywire.bench.bench import Bench
from bywire.bench.ensemble import changed, key_figures_of
from bywire.bench.joined import in_groups
from bywire.cases.store import PieceFolder
from bywire.core.arguments import whole_number
from bywire.core.brake import loaded_files
from bywire.core.errors import BywireError, DeviceError, FileError, ParameterError
from bywire.data.file_format import library
from bywire.studies.designs import MOST, SPANNED
from bywire.studies.meant_study import RECORD, require_no_file
from bywire.studies.plan import CHUNK, StudyPlan

if TYPE_CHECKING:
    import pandas as pd

CASE, FAILURE, WARNINGS = "case", "failure", "warnings"
"""other columns than values and key figures: number, reason for a missing result, warnings"""

CHOICE = "choice"
"""entry of the record: the step that bywire chose for a stated error"""

Columns = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class PlacedChunk:
    """A chunk whose values are not in the plan: its number, and columns [SI]."""

    number: int
    values: Mapping[str, NDArray[Any]]


def number_of(chunk: int | PlacedChunk) -> int:
    """Return the number of a chunk."""
    return chunk if isinstance(chunk, int) else chunk.number


def computed_chunk(
    plan: StudyPlan, chunk: int | PlacedChunk, threads: int | None = None
) -> Columns:
    """Return the cases of a chunk.

    Parameters
    ----------
    plan
        The study.
    chunk
        Number of the chunk, >= 0, with its values if they are not in the plan.
    threads
        Threads to use; all cores by default.

    Returns
    -------
    dict
        Columns of equal length: the case's number, the varied values by name [SI], every key figure
        by name in its unit (NaN if it is undefined), and two texts: the reason for a missing
        result, and warnings. Texts may be empty.

    Raises
    ------
    DeviceError
        If the bench's graphics processor fails, which the cases do not cause.
    KeyboardInterrupt
        If interrupted.
    """
    ((_, columns),) = computed_chunks(plan, [chunk], threads)
    return columns


def computed_chunks(
    plan: StudyPlan, chunks: Sequence[int | PlacedChunk], threads: int | None = None
) -> list[tuple[int, Columns]]:
    """Return the numbers and the columns of chunks whose cases are computed together.

    The columns are the result of `computed_chunk` for each chunk, in order.

    Raises
    ------
    DeviceError, KeyboardInterrupt
        Likewise.
    """
    each = [plan.values(c) if isinstance(c, int) else c.values for c in chunks]
    sizes = [len(next(iter(values.values()))) for values in each]
    numbers = [number_of(chunk) for chunk in chunks]
    cases = [n * CHUNK + np.arange(size) for n, size in zip(numbers, sizes, strict=True)]
    values = {name: np.concatenate([one[name] for one in each]) for name in each[0]}
    with _garbage_later():
        columns = _computed(plan, np.concatenate(cases), values, threads)
    ends = np.cumsum(sizes).tolist()
    return [
        (number, {name: column[end - size : end] for name, column in columns.items()})
        for number, size, end in zip(numbers, sizes, ends, strict=True)
    ]


@contextmanager
def _garbage_later() -> Iterator[None]:
    """Collect garbage once at the end, instead of repeatedly among all objects.

    Evaluated models contain reference cycles.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
        gc.collect(1)


def _computed(
    plan: StudyPlan,
    numbers: NDArray[np.int64],
    values: Mapping[str, NDArray[Any]],
    threads: int | None,
) -> Columns:
    count, own = len(numbers), numbers.tolist()
    rows = list(zip(*(column.tolist() for column in values.values()), strict=True))

    def bench(k: int) -> Bench:
        return case_bench(plan, own[k], dict(zip(values, rows[k], strict=True)))

    names = plan.bench.definition.kpis_with(plan.bench.chosen_options)
    columns: Columns = {CASE: numbers, **values}
    columns |= {name: np.full(count, math.nan) for name in names}
    columns |= {name: np.full(count, "", dtype=object) for name in (FAILURE, WARNINGS)}
    seeds = [_seed(plan, number) for number in own]
    for places, joined in in_groups(plan.bench, values, seeds, bench):
        if joined is not None:
            _fill(columns, places.tolist(), joined, threads)
            continue
        benches: dict[int, Bench] = {}
        for k in places.tolist():
            try:
                benches[k] = bench(k)
            except BywireError as error:
                columns[FAILURE][k] = str(error)
        for group in _alike(benches):
            _fill(columns, group, [benches[k] for k in group], threads)
    return columns


def case_bench(plan: StudyPlan, number: int, values: Mapping[str, Any]) -> Bench:
    """Return the bench of a case, with its values and, for sampled cases, its own noise.

    Raises
    ------
    InputError
        If the values contradict each other, or the experiment does not run with them.
    """
    return changed(plan.bench, values, _seed(plan, number))


def _seed(plan: StudyPlan, number: int) -> int:
    """Return the seed of a case, which differs if the case has its own noise."""
    sought = plan.sought
    is_noisy = plan.is_sampled if sought is None else sought.has_own_noise(number // CHUNK)
    return plan.bench.seed + number if is_noisy else plan.bench.seed


def _alike(benches: Mapping[int, Bench]) -> list[list[int]]:
    """Return groups of cases that differ only in numbers, so they can run in parallel."""
    groups: dict[tuple[Any, ...], list[int]] = {}
    for k, bench in benches.items():
        each = (bench.par.choices(), bench.chosen_options.choices())  # names may be in both
        groups.setdefault(tuple(tuple(chosen.items()) for chosen in each), []).append(k)
    return list(groups.values())


def _fill(
    columns: Columns, cases: Sequence[int], benches: Sequence[Bench], threads: int | None
) -> None:
    """Store results in the rows of their cases; if they fail together, rerun them separately."""
    try:
        given = key_figures_of(benches, threads)
    except DeviceError:  # not caused by a case
        raise
    except BywireError as error:
        if len(cases) == 1:
            columns[FAILURE][cases[0]] = str(error)
            return
        middle = len(cases) // 2
        _fill(columns, cases[:middle], benches[:middle], threads)
        _fill(columns, cases[middle:], benches[middle:], threads)
        return
    for figure in given.figures:
        columns[figure.name][cases] = figure.values
    columns[WARNINGS][cases] = [json.dumps(texts) if texts else "" for texts in given.warnings]


def warnings_in(cell: str) -> list[str]:
    """Return the warnings of a case, from a JSON list or a single text."""
    warnings: list[str] = json.loads(cell) if cell.startswith("[") else [cell] if cell else []
    return warnings


# --- File of a chunk: a Parquet file, written completely or not at all, with its identity

_WHAT = ("the files of a study", "studies")


def _require_pyarrow() -> None:
    """Require pyarrow before resuming, since without it chunks would appear to be damaged.

    Raises
    ------
    FileError
        If it is not installed.
    """
    library("pyarrow", *_WHAT)


def _write_chunk(
    path: Path, columns: Columns, units: Mapping[str, str], marks: Mapping[bytes, bytes]
) -> None:
    """Write a chunk's cases.

    Parameters
    ----------
    path
        Path of its file.
    columns
        Values of each quantity and figure, shape (cases,) each; texts as objects.
    units
        Units of the columns that have a unit.
    marks
        Identity of the file.

    Raises
    ------
    FileError
        If pyarrow is not installed.
    OSError
        If the file cannot be written.
    """
    pa, parquet = library("pyarrow", *_WHAT), library("pyarrow.parquet", *_WHAT)
    texts = [name for name, column in columns.items() if column.dtype.kind == "O"]
    arrays = {name: pa.array(column) for name, column in columns.items()}
    fields = [
        pa.field(name, array.type, metadata={b"unit": units.get(name, "1").encode()})
        for name, array in arrays.items()
    ]
    table = pa.table(list(arrays.values()), schema=pa.schema(fields, dict(marks)))
    # A dictionary of numbers that all differ would be useless.
    parquet.write_table(table, path, write_page_checksum=True, use_dictionary=texts)


def _read_chunk(
    path: Path, names: Sequence[str] | None = None
) -> tuple[Columns, Mapping[bytes, bytes]]:
    """Return the cases of a file, all columns or the named ones, and the identity of the file.

    Raises
    ------
    Exception
        Any exception of pyarrow for a damaged file.
    """
    parquet = library("pyarrow.parquet", *_WHAT)
    # Read a single file: the reader of folders needs three times as long, and loads more modules.
    with parquet.ParquetFile(path, page_checksum_verification=True, pre_buffer=False) as file:
        table = file.read(None if names is None else list(names), use_threads=False)
    columns = {
        name: np.asarray(table.column(name).to_numpy(zero_copy_only=False))
        for name in table.column_names
    }
    return columns, table.schema.metadata or {}


def release_memory() -> None:
    """Release the memory that pyarrow keeps for its next file, 20 MB after files of groups."""
    library("pyarrow", *_WHAT).default_memory_pool().release_unused()


# --- The folder
# An existing chunk is never recomputed. Each file is written completely or not at all, so that a
# killed process loses only its current chunks.

_CHUNKS = "chunks"
"""folder of the chunks"""
GROUP = 1024
"""number of consecutive chunks that a single file contains once all of them are finished"""
_GROUP_FILE = "{:06d}-{:06d}.parquet"
_GROUP_STEM = re.compile(r"(\d{6,})-(\d{6,})", re.ASCII)
_MOST_KNOWN = 2 * GROUP  # chunks kept in memory, 16 kB each


@dataclass(frozen=True)
class Origin:
    """Source of a study.

    Parameters
    ----------
    file
        Study file.
    overrides
        Changes to its bench, as for ``--set``.
    """

    file: Path
    overrides: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class StudyStore(PieceFolder):
    """Folder of the chunks of a study.

    Parameters
    ----------
    folder
        The study's folder.
    """

    NOUN = "study"
    KIND = "study of many cases"
    COMMAND = "bywire study run"
    RECORD = RECORD
    PIECES = _CHUNKS
    FILE = "{:06d}.parquet"
    SAID: ClassVar[Mapping[str, type]] = {
        "digest": str,
        "source": str,
        "cases": int,
        "set": dict,
        "systems": list,
        "study": dict,
    }

    # Cases that were read or written here, to avoid reading them again.
    _known: dict[int, Columns] = field(default_factory=dict, init=False, repr=False, compare=False)
    # Numbers of the chunks with their own file, by group.
    _single: dict[int, set[int]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    _units: dict[str, str] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def elsewhere(self) -> str:
        """Advice if the folder contains another study."""
        return (
            "Type 'bywire study run FILE --out FOLDER' to use another folder, or remove this folder"
        )

    def open(self, plan: StudyPlan, origin: Origin) -> None:
        """Claim the folder for the study, or reject the folder of another study.

        Raises
        ------
        FileError
            If it contains another study, or is not writable.
        """
        _require_pyarrow()
        about = {
            "source": str(origin.file.resolve()),
            "name": plan.name,
            "cases": plan.total,
            "chunk": CHUNK,
            "set": dict(origin.overrides),
            "systems": list(loaded_files()),
        }
        if plan.bench.choice is not None:
            about[CHOICE] = asdict(plan.bench.choice)
        self.begin(plan, about)
        self._units.update(plan.column_units)

    def asked_and_computed(self, plan: StudyPlan) -> tuple[int, int]:
        """Return the number of requested cases, and of computed cases.

        Both are zero if the folder does not contain this study. For search designs, both count per
        requirement; the second is for the requirement with most cases.
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
        """Return the record of the folder's study.

        Raises
        ------
        FileError
            If the folder contains no record.
        """
        require_no_file(self.folder)
        return super().record()

    @property
    def resume_command(self) -> str:
        """Command that resumes the study, with the brakes that were loaded by path."""
        words = ["bywire", "study", "resume", str(self.folder)]
        return shlex.join([*words, *(w for file in loaded_files() for w in ("--system", file))])

    def listed(self) -> tuple[set[int], set[int]]:
        """Return the numbers of chunks with their own file, and of groups with a single file."""
        # Before the groups, since another process may merge files at this moment.
        single, groups = super().finished(), set()
        for path in (self.folder / _CHUNKS).glob("*-*.parquet"):
            if match := _GROUP_STEM.fullmatch(path.stem):
                first, last = map(int, match.groups())
                if first % GROUP == 0 and last == first + GROUP - 1:
                    groups.add(first // GROUP)
        return single, groups

    def finished(self) -> set[int]:
        """Return the numbers of the stored chunks."""
        single, groups = self.listed()
        return single.union(*(_chunks_of(group) for group in groups))

    def group_path(self, group: int) -> Path:
        """Return the file of a group."""
        chunks = _chunks_of(group)
        return self.folder / _CHUNKS / _GROUP_FILE.format(chunks[0], chunks[-1])

    def drop_damaged(self) -> int:
        """Remove unreadable files, so that their chunks are recomputed, and merge whole groups.

        Returns
        -------
        int
            Number of chunks in the removed files.
        """
        _require_pyarrow()
        damaged = 0
        single, groups = self.listed()
        for group in sorted(groups):
            parts = single.intersection(_chunks_of(group))  # left by a killed process
            try:
                self.group(group)
            except FileError:
                self.group_path(group).unlink()
                damaged += GROUP - len(parts)
            else:
                self._remove(parts)
                single -= parts
        self._single.clear()
        for chunk in sorted(single):
            try:
                self.columns(chunk)
            except FileError:
                self.path(chunk).unlink()
                damaged += 1
            else:
                self._add(chunk)
        return damaged

    def write(self, chunk: int, columns: Columns, units: Mapping[str, str]) -> None:
        """Store a chunk, completely or not at all.

        Raises
        ------
        FileError
            If it is not writable.
        """
        columns = {  # texts as read from the file
            name: column.astype(object) if column.dtype.kind == "U" else column
            for name, column in columns.items()
        }
        marks = self._marks(chunk)
        self._units.update(units)
        self.keep_file(chunk, lambda fresh: _write_chunk(fresh, columns, units, marks))
        self._known[chunk] = columns
        self._add(chunk)

    def _add(self, chunk: int) -> None:
        """Count a chunk's file, and merge the files of its group if all of them exist."""
        group = chunk // GROUP
        there = self._single.setdefault(group, set())
        there.add(chunk)
        if len(there) == GROUP:
            self._merge(group)

    def read(self, chunks: int) -> pd.DataFrame:
        """Return all cases of the first existing chunks, in order.

        Raises
        ------
        FileError
            If a file is damaged.
        """
        import pandas as pd

        each = [self.columns(n) for n in sorted(self.finished()) if n < chunks]
        names = each[0] if each else ()
        return pd.DataFrame({n: np.concatenate([columns[n] for columns in each]) for n in names})

    def columns(self, chunk: int) -> Columns:
        """Return the cases of an existing chunk, stored when they were first read or written.

        Raises
        ------
        FileError
            If its file is damaged.
        """
        if chunk in self._known:
            return self._known[chunk]
        columns = self._read_single(chunk)
        if len(self._known) < _MOST_KNOWN:
            self._known[chunk] = columns
        return columns

    def _read_single(self, chunk: int) -> Columns:
        """Return the cases of a chunk from its own file, or from that of its group."""
        try:
            return self._read(self.path(chunk), self._marks(chunk))
        except FileError:
            # Another process may have just merged it.
            if self.path(chunk).exists() or not self.group_path(chunk // GROUP).exists():
                raise
        columns = self.group(chunk // GROUP)
        begin, end = np.searchsorted(columns[CASE], [chunk * CHUNK, (chunk + 1) * CHUNK])
        return {name: column[begin:end].copy() for name, column in columns.items()}

    def group(self, group: int, names: Sequence[str] | None = None) -> Columns:
        """Return the cases of an existing group, all columns or the named ones.

        Raises
        ------
        FileError
            If its file is damaged.
        """
        return self._read(self.group_path(group), self._group_marks(group), names)

    def _read(
        self, path: Path, marks: Mapping[bytes, bytes], names: Sequence[str] | None = None
    ) -> Columns:
        """Return the content of a file with this identity; see `columns` and `group`."""
        _require_pyarrow()
        try:
            columns, found = _read_chunk(path, names)
        except Exception as error:  # the library raises all kinds of exceptions for damaged files
            raise FileError(
                f"{path} is damaged ({type(error).__name__}). To recompute it, type "
                f"'{self.resume_command}'",
                name=str(path),
            ) from None
        if any(found.get(key) != value for key, value in marks.items()):
            raise FileError(
                f"{path} belongs to another study, or is another chunk of this study. To "
                f"recompute it, type '{self.resume_command}'",
                name=str(path),
            )
        return columns

    def _merge(self, group: int) -> None:
        """Replace the files of a group's chunks with a single one, which is complete before."""
        chunks = _chunks_of(group)
        try:
            each = [self.columns(chunk) for chunk in chunks]
        except FileError:  # the next command that computes cases finds and recomputes it
            return
        columns = {name: np.concatenate([one[name] for one in each]) for name in each[0]}
        marks = self._group_marks(group)

        def write(fresh: Path) -> None:
            _write_chunk(fresh, columns, self._units, marks)
            with fresh.open("rb+") as file:  # before its parts are removed, even in a power cut
                os.fsync(file.fileno())

        self.keep_at(self.group_path(group), write)
        self._remove(chunks)

    def _remove(self, chunks: Iterable[int]) -> None:
        """Remove the files of chunks that are in the file of their group."""
        for chunk in chunks:
            self.path(chunk).unlink(missing_ok=True)
            self._known.pop(chunk, None)
            self._single.pop(chunk // GROUP, None)

    def _marks(self, chunk: int) -> dict[bytes, bytes]:
        """Return the identity of a chunk's file."""
        return {b"study": self._digest, b"chunk": str(chunk).encode()}

    def _group_marks(self, group: int) -> dict[bytes, bytes]:
        """Return the identity of a group's file."""
        chunks = _chunks_of(group)
        return {b"study": self._digest, b"chunks": f"{chunks[0]}-{chunks[-1]}".encode()}

    @cached_property
    def _digest(self) -> bytes:
        return str(self.record()["digest"]).encode()


def _chunks_of(group: int) -> range:
    """Return the numbers of the chunks in a group."""
    return range(group * GROUP, (group + 1) * GROUP)


# --- Requested number of cases, in addition to the file and the folder


def with_cases(plan: StudyPlan, store: StudyStore, cases: int | None) -> StudyPlan:
    """Return the plan with the requested number of cases, at least the number in its folder.

    Parameters
    ----------
    plan
        Plan from the study file.
    store
        Its folder.
    cases
        Requested number of cases; None for the number in the file and the folder. A number below
        the folder's cancels cases that are not computed yet.

    Raises
    ------
    ParameterError
        For fewer cases than are already computed, for too few or too many cases, and for a design
        with a fixed number of cases.
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
                f"cases = {cases} is not valid: it must be >= {computed}, because {store.folder} "
                "already contains that many. Request more cases, or choose another folder",
                name="cases",
                value=str(cases),
                valid=f">= {computed}",
            )
        extended = replace(plan, cases=max(plan.cases, asked) if cases is None else cases)
        if extended.sought is not None:
            extended.sought.require_budget()
        return extended
    given = plan if cases is None else replace(plan, cases=cases)
    given.points  # noqa: B018 - rejects too few cases before any run
    return given


def require_extensible(plan: StudyPlan, cases: int) -> None:
    """Reject additional cases for a design with a fixed number of cases.

    Raises
    ------
    ParameterError
        If its cases are listed, or belong together in groups.
    """
    if plan.is_sampled or plan.sought is not None:
        return
    why = (
        "quantities and levels determine its cases"
        if plan.design in SPANNED
        else "it evaluates all groups together"
    )
    raise ParameterError(
        f"cases = {cases} is not valid: bywire cannot extend a study with design {plan.design!r}, "
        f"because {why}. Change the study file, and run it in another folder",
        name="cases",
        value=str(cases),
    )
