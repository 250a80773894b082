"""Studies run: what is not there yet is computed, and kept as soon as it is."""

from __future__ import annotations

from pathlib import Path

from bywire.core.typing import Progress
from bywire.studies.executor import executor_of
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.rare_failures import rare_failures
from bywire.studies.sought_design import WORST
from bywire.studies.store import StudyStore
from bywire.studies.worst_cases import worst_cases


def complete(
    plan: StudyPlan,
    store: StudyStore,
    source: Path,
    *,
    workers: int | None = None,
    cluster: str = "",
    progress: Progress,
) -> None:
    """Compute the chunks of a study that its folder lacks.

    Parameters
    ----------
    plan, store, source
        The study, its folder, and the file that it was read from.
    workers, cluster
        See `bywire.studies.executor.executor_of`.
    progress
        Called with a label and the finished share, 0 to 1.

    Raises
    ------
    FileError
        When the folder is another study's, or cannot be written.
    RunError
        When the workers are lost.
    KeyboardInterrupt
        When interrupted; what is finished stays.
    """
    store.open(plan, source)
    if plan.sought is not None:
        together = plan.sought.together // CHUNK
        executor = executor_of(workers, cluster, -(-plan.cases // CHUNK), together)
        seek = worst_cases if plan.design == WORST else rare_failures
        seek(plan, store, executor, progress)
        return
    missing = sorted(set(range(plan.chunks)) - store.finished())
    if not missing:
        return
    done = plan.chunks - len(missing)
    label = f"{plan.total} cases"
    progress(label, done / plan.chunks)
    for count, (chunk, columns) in enumerate(
        executor_of(workers, cluster, len(missing)).computed(plan, missing), 1
    ):
        store.write(chunk, columns, plan.column_units)
        progress(label, (done + count) / plan.chunks)
