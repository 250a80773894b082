"""Studies run: what is not there yet is computed, and kept as soon as it is."""

from __future__ import annotations

import time

from bywire.core.typing import Progress
from bywire.studies.executor import executor_of
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.rare_failures import rare_failures
from bywire.studies.sought_design import WORST
from bywire.studies.store import Origin, StudyStore
from bywire.studies.worst_cases import worst_cases


def complete(
    plan: StudyPlan,
    store: StudyStore,
    origin: Origin,
    *,
    workers: int | None = None,
    cluster: str = "",
    progress: Progress,
) -> int:
    """Compute the chunks of a study that its folder lacks.

    Parameters
    ----------
    plan, store, origin
        The study, its folder, and what it was read from.
    workers, cluster
        See `bywire.studies.executor.executor_of`.
    progress
        Called with a label and the finished share, 0 to 1.

    Returns
    -------
    int
        How many chunks were damaged, and are computed again.

    Raises
    ------
    FileError
        When the folder is another study's, or cannot be written.
    RunError
        When the workers are lost.
    KeyboardInterrupt
        When interrupted; what is finished stays.
    """
    until = time.monotonic() + plan.time
    store.open(plan, origin)
    damaged = store.drop_damaged()
    if plan.sought is not None:
        together = plan.sought.together // CHUNK
        chunks = -(-plan.cases // CHUNK)
        executor = executor_of(workers, cluster, chunks, together, plan.bench.engine)
        seek = worst_cases if plan.design == WORST else rare_failures
        seek(plan, store, executor, progress)
        return damaged
    missing = sorted(set(range(plan.chunks)) - store.finished())
    if not missing:
        return damaged
    done = plan.chunks - len(missing)
    label = f"{plan.total} cases"
    progress(label, done / plan.chunks)
    executor = executor_of(workers, cluster, len(missing), engine=plan.bench.engine)
    with executor.opened(plan) as compute:
        for count, (chunk, columns) in enumerate(compute(missing), 1):
            store.write(chunk, columns, plan.column_units)
            progress(label, (done + count) / plan.chunks)
            if time.monotonic() > until:
                break
    return damaged
