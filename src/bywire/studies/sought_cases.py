"""The cases of a design that seeks: asked for batch by batch, looked up before they are computed.

A method is replayed from its seed each time, also for a report: what it asks for depends on the
seed and on what cases gave, so that it asks for the same again, and finds it in the folder.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bywire.bench.requirements import Limit
from bywire.core.errors import FileError
from bywire.core.typing import Array, Progress
from bywire.studies.chunk import CASE, Columns, PlacedChunk
from bywire.studies.computing import Compute, Executor
from bywire.studies.limit_state import BudgetSpentError, UnfinishedError, margins_of
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.sought_design import SoughtDesign
from bywire.studies.store import StudyStore

if TYPE_CHECKING:
    import pandas as pd


@dataclass
class SoughtCases:
    """The cases of a study that seeks.

    Parameters
    ----------
    plan, store
        The study and its folder.
    executor
        Who computes what the folder lacks; None where nothing is computed.
    progress
        Called with a label and the share of the budget that is used.
    """

    plan: StudyPlan
    store: StudyStore
    executor: Executor | None
    progress: Progress
    chunks: dict[int, Columns] = field(default_factory=dict)
    _shared: dict[bytes, list[int]] = field(default_factory=dict)
    _opened: ExitStack = field(default_factory=ExitStack)
    _compute: Compute | None = None

    def __enter__(self) -> SoughtCases:
        return self

    def __exit__(self, *error: Any) -> None:
        self._opened.__exit__(*error)  # who computes says what the loss of workers means

    @property
    def design(self) -> SoughtDesign:
        """How cases are sought."""
        assert self.plan.sought is not None
        return self.plan.sought

    @property
    def frame(self) -> pd.DataFrame:
        """All cases, in the order of their numbers."""
        import pandas as pd

        frames = [pd.DataFrame(self.chunks[number]) for number in sorted(self.chunks)]
        return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()

    def batch(self, scores: Array, numbers: list[int]) -> list[int]:
        """Have the cases at some scores, computed where they are not there; return their chunks.

        Parameters
        ----------
        scores
            Shape (cases, quantities).
        numbers
            Of their chunks. A batch with the scores of another one is not computed again.

        Raises
        ------
        UnfinishedError
            When some are not there, and nothing is computed.
        FileError
            When the folder has others in their place.
        """
        numbers = self._shared.setdefault(scores.tobytes(), numbers)
        wanted = {
            number: self.plan.values_at(scores[k * CHUNK : (k + 1) * CHUNK])
            for k, number in enumerate(numbers)
        }
        there = self.store.finished()
        missing = [PlacedChunk(n, values) for n, values in wanted.items() if n not in there]
        if missing:
            self._computed(missing)
        for number, values in wanted.items():
            if number not in self.chunks:
                self.chunks[number] = self.store.columns(number)
                self._require(number, values)
        return numbers

    def _computed(self, missing: list[PlacedChunk]) -> None:
        if self.executor is None:
            raise UnfinishedError
        if self._compute is None:  # workers are started once, and only where they are needed
            self._compute = self._opened.enter_context(self.executor.opened(self.plan))
        for number, columns in self._compute(missing):
            self.store.write(number, columns, self.plan.column_units)

    def _require(self, number: int, values: Mapping[str, NDArray[np.generic]]) -> None:
        """Refuse a chunk of other cases: the method would answer from what it never asked for."""
        found = self.chunks[number]
        for name, column in values.items():
            known = found.get(name, np.array([]))
            is_same = known.shape == column.shape and (
                bool(np.all(known == column))
                if column.dtype.kind in "OU"
                else np.allclose(known.astype(float), column, rtol=1e-9, atol=0.0)
            )
            if not is_same:
                raise FileError(
                    f"{self.store.path(number)} holds other cases than the study asks for now: "
                    "another machine or library draws differently; run it into another folder"
                )


@dataclass
class RequirementCases:
    """The cases that are asked for because of a requirement, in their order.

    Parameters
    ----------
    cases
        Those of the study.
    requirement
        Number of the requirement among those judged.
    numbers, failed
        Of the cases in the order in which they were asked for, and of those that failed.
    """

    cases: SoughtCases
    requirement: int
    numbers: list[int] = field(default_factory=list)
    failed: set[int] = field(default_factory=set)
    _searched: int = 0
    _drawn: int = 0
    _said: str = ""

    @property
    def demand(self) -> Limit:
        """The requirement."""
        return self.cases.plan.judged_demands[self.requirement]

    def drawn(self, scores: Array) -> Array:
        """Return margins of cases with noise of their own; see `limit_state.Margins`."""
        first = self.cases.design.first_sampled + self._drawn
        margins, chunks = self._margins(scores, first)
        self._drawn += chunks
        return margins

    def searched(self, scores: Array) -> Array:
        """Return margins of cases with the noise of the bench; see `limit_state.Margins`."""
        if self._searched >= self.cases.design.first_sampled:
            raise BudgetSpentError
        margins, chunks = self._margins(scores, self._searched)
        self._searched += chunks
        return margins

    def report(self, estimate: float) -> None:
        """Take note of how probable a failure seems so far."""
        self._said = f", failure {estimate:.2g} so far"

    def _margins(self, scores: Array, first: int) -> tuple[Array, int]:
        plan, used = self.cases.plan, len(self.numbers)
        if used + len(scores) > plan.cases:
            raise BudgetSpentError
        self.cases.progress(f"{self.demand.figure}{self._said}", used / plan.cases)
        count = -(-len(scores) // CHUNK)
        own = [self.cases.design.chunk(self.requirement, first + k) for k in range(count)]
        found = [self.cases.chunks[n] for n in self.cases.batch(scores, own)]
        self.numbers += [int(n) for columns in found for n in columns[CASE]]
        values = np.concatenate([columns[self.demand.figure] for columns in found])
        margins = margins_of(values, self.demand)
        self.failed.update(np.array(self.numbers[used:])[margins <= 0.0].tolist())
        return margins, count
