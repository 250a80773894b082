"""A chunk of a study's cases: what varied and what it gave, a column each, and its Parquet file.

It depends on the plan and its number alone, wherever and in whatever order it is computed.
"""

from __future__ import annotations

import gc
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bywire.bench.bench import Bench
from bywire.bench.ensemble import changed, key_figures_of
from bywire.core.errors import BywireError, DeviceError
from bywire.data.file_format import library
from bywire.studies.plan import CHUNK, StudyPlan

CASE, FAILURE, WARNINGS = "case", "failure", "warnings"
"""columns beside values and key figures: number, why there is no result, what the run warns of"""

Columns = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class PlacedChunk:
    """A chunk whose values are not those that the plan lists: its number, and columns [SI]."""

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
        Number of the chunk, >= 0; with its values where the plan does not list them.
    threads
        Threads to use; all cores by default.

    Returns
    -------
    dict
        Columns of equal length: the case's number, the values that varied by name [SI], every key
        figure by name in its unit (NaN where it is not defined), and as texts why a case has no
        result and what it warns of, empty where there is nothing.

    Raises
    ------
    DeviceError
        When the bench's graphics processor fails: no case is to blame.
    KeyboardInterrupt
        When interrupted.
    """
    ((_, columns),) = computed_chunks(plan, [chunk], threads)
    return columns


def computed_chunks(
    plan: StudyPlan, chunks: Sequence[int | PlacedChunk], threads: int | None = None
) -> list[tuple[int, Columns]]:
    """Return the numbers and the columns of chunks whose cases are computed together.

    As `computed_chunk` gives each of them, in order.

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
    """Look for garbage once at the end, and not among all objects again and again meanwhile.

    Models that were evaluated refer to themselves.
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
    count = len(numbers)
    benches: dict[int, Bench] = {}
    failures = [""] * count
    rows = zip(*(column.tolist() for column in values.values()), strict=True)
    for k, (number, row) in enumerate(zip(numbers.tolist(), rows, strict=True)):
        try:
            benches[k] = case_bench(plan, number, dict(zip(values, row, strict=True)))
        except BywireError as error:
            failures[k] = str(error)
    names = plan.bench.definition.kpis_with(plan.bench.chosen_options)
    columns: Columns = {CASE: numbers, **values}
    columns |= {name: np.full(count, math.nan) for name in names}
    columns |= {name: np.full(count, "", dtype=object) for name in (FAILURE, WARNINGS)}
    columns[FAILURE][:] = failures
    for group in _alike(benches):
        _fill(columns, group, benches, threads)
    return columns


def case_bench(plan: StudyPlan, number: int, values: Mapping[str, Any]) -> Bench:
    """Return the bench of a case: its values, and of drawn ones noise of its own.

    Raises
    ------
    InputError
        When the values contradict each other, or the experiment does not run with them.
    """
    seed = plan.bench.seed + number if _is_noisy(plan, number) else None
    return changed(plan.bench, values, seed)


def _is_noisy(plan: StudyPlan, number: int) -> bool:
    """Return whether a case has noise of its own."""
    if plan.sought is not None:
        return plan.sought.has_own_noise(number // CHUNK)
    return plan.is_sampled


def _alike(benches: Mapping[int, Bench]) -> list[list[int]]:
    """Return cases in groups that differ in numbers alone, so that they run side by side."""
    groups: dict[tuple[Any, ...], list[int]] = {}
    for k, bench in benches.items():
        each = (bench.par.choices(), bench.chosen_options.choices())  # names may be in both
        groups.setdefault(tuple(tuple(chosen.items()) for chosen in each), []).append(k)
    return list(groups.values())


def _fill(
    columns: Columns, cases: Sequence[int], benches: Mapping[int, Bench], threads: int | None
) -> None:
    """Put what cases give into their rows; where they fail together, each for itself says why."""
    try:
        given = key_figures_of([benches[k] for k in cases], threads)
    except DeviceError:  # says nothing of a case
        raise
    except BywireError as error:
        if len(cases) == 1:
            columns[FAILURE][cases[0]] = str(error)
            return
        middle = len(cases) // 2
        _fill(columns, cases[:middle], benches, threads)
        _fill(columns, cases[middle:], benches, threads)
        return
    for figure in given.figures:
        columns[figure.name][cases] = figure.values
    columns[WARNINGS][cases] = ["; ".join(texts) for texts in given.warnings]


# --- Its file: one Parquet file, whole or not at all, that says whose it is

_WHAT = ("the files of a study", "studies")


def require_pyarrow() -> None:
    """Refuse to go on without the library: nothing could be read, and nothing is damaged.

    Raises
    ------
    FileError
        When it is not installed.
    """
    library("pyarrow", *_WHAT)


def write_chunk(
    path: Path, columns: Columns, units: Mapping[str, str], marks: Mapping[bytes, bytes]
) -> None:
    """Write a chunk's cases.

    Parameters
    ----------
    path
        Its file.
    columns
        Values of each quantity and figure, shape (cases,) each; texts as objects.
    units
        Unit of those that have one.
    marks
        What tells the file from any other.

    Raises
    ------
    FileError
        When pyarrow is not installed.
    OSError
        When the file cannot be written.
    """
    pa, parquet = library("pyarrow", *_WHAT), library("pyarrow.parquet", *_WHAT)
    texts = [name for name, column in columns.items() if column.dtype.kind == "O"]
    arrays = {name: pa.array(column) for name, column in columns.items()}
    fields = [
        pa.field(name, array.type, metadata={b"unit": units.get(name, "1").encode()})
        for name, array in arrays.items()
    ]
    table = pa.table(list(arrays.values()), schema=pa.schema(fields, dict(marks)))
    # A dictionary of numbers that all differ would be written in vain.
    parquet.write_table(table, path, write_page_checksum=True, use_dictionary=texts)


def read_chunk(path: Path) -> tuple[Columns, Mapping[bytes, bytes]]:
    """Return a chunk's cases as they were written, and what tells its file from any other.

    Raises
    ------
    Exception
        Whatever pyarrow raises of a file that is damaged.
    """
    parquet = library("pyarrow.parquet", *_WHAT)
    # Of one file: what reads folders of them takes three times as long, and loads more.
    with parquet.ParquetFile(path, page_checksum_verification=True, pre_buffer=False) as file:
        table = file.read(use_threads=False)
    columns = {
        name: np.asarray(table.column(name).to_numpy(zero_copy_only=False))
        for name in table.column_names
    }
    return columns, table.schema.metadata or {}
