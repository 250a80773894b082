"""Plan of a sign-off: requirements, assumptions, and the evidence for them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from bywire.bench.requirements import Limit
from bywire.cases.identity import as_json, digest_of
from bywire.core.typing import Progress
from bywire.report.answer import Answer
from bywire.signoff.exchange.importing import Imported
from bywire.signoff.judging import Judged
from bywire.signoff.statements import NOWHERE, Place, Statement


class Task(ABC):
    """Computation or document that provides evidence, read and checked but not yet computed.

    Tasks with the same digest are computed once.
    """

    @property
    def is_parallel(self) -> bool:
        """Whether the computation itself uses all cores, and therefore runs alone."""
        return False

    @property
    @abstractmethod
    def origin(self) -> tuple[Callable[..., Task], Sequence[Any]]:
        """Function that reads the task, and its arguments, for another process."""

    @property
    @abstractmethod
    def title(self) -> str:
        """One line that identifies the task for the user."""

    @property
    @abstractmethod
    def identity(self) -> Mapping[str, Any]:
        """Everything that affects its figures."""

    @cached_property
    def digest(self) -> str:
        """Digest of its identity."""
        return digest_of(as_json(self.identity))

    @property
    def shelf(self) -> str:
        """Digest in its folder's name. Computations that continue each other share this digest."""
        return self.digest

    @abstractmethod
    def limit(self, text: str) -> Limit:
        """Return a limit of one of its figures.

        Raises
        ------
        InputError
            If the text is not a limit, the figure is unknown, or a unit is wrong.
        """

    def with_limits(self, limits: Sequence[Limit]) -> Task:
        """Return the task with all limits that the file sets for it.

        Raises
        ------
        InputError
            If one computation cannot judge them together.
        """
        del limits
        return self

    @abstractmethod
    def compute(self, folder: Path, progress: Progress) -> Computed:
        """Compute the evidence, and write its result to a folder.

        Raises
        ------
        BywireError
            If the computation fails.
        """


@dataclass(frozen=True)
class Computed:
    """Computed evidence.

    Parameters
    ----------
    answer
        The result with its figures.
    judged
        Verdicts on limits that only the complete result can judge, by the limit's text.
    """

    answer: Answer
    judged: Mapping[str, Judged] = field(default_factory=dict)


@dataclass(frozen=True)
class Evidence:
    """Evidence for one or more statements.

    Parameters
    ----------
    task
        The computation or document.
    limits
        Limits of its figures. Empty if the result as a whole is the evidence.
    shows
        Names of the statements.
    note
        Remark of the user; may be empty.
    place
        Its place in the file.
    """

    task: Task
    limits: tuple[Limit, ...]
    shows: tuple[str, ...]
    note: str = ""
    place: Place = NOWHERE


@dataclass(frozen=True)
class SignOffPlan:
    """Content of a sign-off file.

    Parameters
    ----------
    name
        Name in reports.
    file
        The file.
    requirements, assumptions
        In the order of the file.
    evidence
        In the order of the file.
    signatures
        Roles of the people who sign.
    imported
        File of another tool from which requirements come; None if all are in the sign-off file.
    """

    name: str
    file: Path
    requirements: tuple[Statement, ...]
    assumptions: tuple[Statement, ...] = ()
    evidence: tuple[Evidence, ...] = ()
    signatures: tuple[str, ...] = ()
    imported: Imported | None = None

    @property
    def statements(self) -> Iterator[Statement]:
        """Requirements and assumptions."""
        yield from self.requirements
        yield from self.assumptions

    @cached_property
    def tasks(self) -> Mapping[str, Task]:
        """The different tasks by their digests, in the order of the file."""
        tasks: dict[str, Task] = {}
        for each in self.evidence:
            tasks.setdefault(each.task.digest, each.task)
        return tasks

    def evidence_for(self, id: str) -> tuple[Evidence, ...]:
        """Return the evidence for a statement."""
        return tuple(each for each in self.evidence if id in each.shows)
