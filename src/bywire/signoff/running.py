"""Computation of the evidence of a sign-off, of which only missing pieces are computed."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from functools import partial

from bywire.cases.runner import complete
from bywire.core.copies import processes_with_brakes
from bywire.core.errors import BywireError
from bywire.core.typing import Progress, silent
from bywire.signoff.plan import SignOffPlan, Task
from bywire.signoff.store import EvidenceStore, Kept

_ADVICE = "rerun the same command to continue. Finished evidence is saved"


def completed(
    plan: SignOffPlan, store: EvidenceStore, progress: Progress
) -> tuple[dict[str, Kept], dict[str, str]]:
    """Return the evidence by digest, and the reason for evidence that cannot be computed.

    Computations on one core run side by side in processes. Those that use all cores follow, one
    after the other.

    Raises
    ------
    FileError
        If the folder is not writable.
    RunError
        If a process is killed.
    KeyboardInterrupt
        If interrupted. Finished evidence is saved.
    """
    tasks = plan.tasks
    failures: dict[str, str] = {}
    missing = [digest for digest, task in tasks.items() if store.kept(task) is None]
    beside = [digest for digest in missing if not tasks[digest].is_parallel]
    alone = [digest for digest in missing if tasks[digest].is_parallel]

    def keep(digest: str, failure: str) -> None:
        if failure:
            failures[digest] = failure

    def shown(done: int, digest: str, share: float) -> None:
        progress(tasks[digest].title, (done + share) / len(missing))

    try:
        complete(
            beside,
            {},
            partial(_compute, {digest: tasks[digest].origin for digest in beside}, store),
            keep=keep,
            progress=lambda digest, share: shown(0, digest, share * len(beside)),
            pool=_pool,
        )
        for k, digest in enumerate(alone, start=len(beside)):
            report = partial(shown, k, digest)
            report(0.0)
            keep(digest, _computed(tasks[digest], store, _without_label(report)))
    except KeyboardInterrupt:
        saved = sum(store.kept(task) is not None for task in tasks.values())
        raise KeyboardInterrupt(
            f"{saved} of {len(tasks)} results are saved. Rerun the same command to continue"
        ) from None
    kept = {digest: found for digest, task in tasks.items() if (found := store.kept(task))}
    return kept, failures


@contextmanager
def _pool(count: int) -> Iterator[Executor]:
    with processes_with_brakes(count, _ADVICE) as pool:
        yield pool


Origin = tuple[Callable[..., Task], Sequence[object]]
"""function that reads a task, and its arguments, for another process"""


def _without_label(report: Callable[[float], object]) -> Progress:
    def show(_: str, share: float) -> None:
        report(share)

    return show


def _compute(origins: Mapping[str, Origin], store: EvidenceStore, digest: str) -> str:
    """Compute the evidence of a task in a process of the pool."""
    read, arguments = origins[digest]
    return _computed(read(*arguments), store, silent)


def _computed(task: Task, store: EvidenceStore, progress: Progress) -> str:
    """Compute and store the evidence of a task; return the reason if that fails."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the evidence contains the warnings
            computed = task.compute(store.place(task), progress)
            store.keep(task, computed)
    except BywireError as error:
        return str(error)
    return ""
