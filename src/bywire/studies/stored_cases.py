"""Cases of a large study, read from its folder block by block.

A study of 10 million cases does not fit into the memory of a small computer, so its evaluation
passes over blocks of cases, and keeps only sums, counts, and selected cases.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from bywire.core.errors import FileError
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.store import GROUP, Columns, StudyStore, release_memory

if TYPE_CHECKING:
    import pandas as pd

BLOCK = GROUP * CHUNK
"""number of cases in a block, up to which all cases of a study are kept in memory"""


@dataclass(frozen=True)
class Part:
    """Consecutive chunks in a single file.

    Parameters
    ----------
    chunk
        Number of the first chunk.
    cases
        Number of cases to read from it.
    is_group
        Whether the file contains a whole group.
    """

    chunk: int
    cases: int
    is_group: bool


@dataclass(frozen=True, eq=False)
class StoredCases:
    """The cases that the folder of a study contained when this object was created, in order.

    Parameters
    ----------
    store
        Folder of the study.
    parts
        Its files, in order.
    """

    store: StudyStore
    parts: tuple[Part, ...]

    @cached_property
    def count(self) -> int:
        """Number of cases."""
        return sum(part.cases for part in self.parts)

    def blocks(self, names: Sequence[str] | None = None) -> Iterator[Columns]:
        """Yield all columns, or the named ones, of at least `BLOCK` cases at a time.

        Raises
        ------
        FileError
            If a file is damaged.
        """
        gathered: list[Columns] = []
        count = 0
        for part in self.parts:
            gathered.append(self._read(part, names))
            count += part.cases
            if count >= BLOCK:
                yield _joined(gathered)
                gathered, count = [], 0
        if gathered:
            yield _joined(gathered)
        release_memory()

    def row(self, row: int) -> Columns:
        """Return all columns of a case, by its row, shape (1,) each.

        Raises
        ------
        FileError
            If a file is damaged.
        """
        for part in self.parts:
            if row < part.cases:
                return {name: x[row : row + 1] for name, x in self._read(part, None).items()}
            row -= part.cases
        raise IndexError(row)

    def frame(self) -> pd.DataFrame:
        """Return all cases, which need up to 1 kB of memory each.

        Raises
        ------
        FileError
            If a file is damaged.
        """
        import pandas as pd

        return pd.DataFrame(_joined([self._read(part, None) for part in self.parts]))

    def _read(self, part: Part, names: Sequence[str] | None) -> Columns:
        if not part.is_group:
            columns = self.store.columns(part.chunk)
            path = self.store.path(part.chunk)
        else:
            columns = self.store.group(part.chunk // GROUP, names)
            path = self.store.group_path(part.chunk // GROUP)
        found = {n: columns[n][: part.cases] for n in (columns if names is None else names)}
        if any(len(column) != part.cases for column in found.values()):
            raise FileError(
                f"{path} does not contain all of its cases. Delete it, and type "
                f"'{self.store.resume_command}'",
                name=str(path),
            )
        return found


def stored_cases(plan: StudyPlan, store: StudyStore) -> StoredCases:
    """Return the cases of a study whose points do not depend on results, as far as computed."""
    single, groups = store.listed()
    parts = [Part(group * GROUP, GROUP * CHUNK, True) for group in groups]
    parts += [Part(n, CHUNK, False) for n in single if n // GROUP not in groups]
    # The last chunk may be shorter, and a study may request fewer cases than its folder contains.
    within = (
        Part(p.chunk, min(p.cases, plan.total - p.chunk * CHUNK), p.is_group)
        for p in sorted(parts, key=lambda part: part.chunk)
    )
    return StoredCases(store, tuple(part for part in within if part.cases > 0))


def _joined(several: Sequence[Columns]) -> Columns:
    if len(several) == 1:
        return several[0]
    names = several[0] if several else ()
    return {name: np.concatenate([columns[name] for columns in several]) for name in names}
