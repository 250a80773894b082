"""Studies run: what is not there yet is computed, and kept as soon as it is."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from bywire.bench import running
from bywire.bench.running import Result
from bywire.core.typing import Progress
from bywire.simulation.cuda import find_device
from bywire.simulation.engine import CUDA
from bywire.studies.designs import WORST
from bywire.studies.executor import executor_of, require_workers
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.sought_cases import rare_failures, worst_cases
from bywire.studies.store import Origin, StudyStore


@dataclass(frozen=True)
class Completed:
    """What a study that was run has beside its folder.

    Parameters
    ----------
    nominal
        What the bench itself gave, with the error of its figures from the step.
    damaged
        How many chunks were damaged, and are computed again.
    """

    nominal: Result
    damaged: int


def complete(
    plan: StudyPlan,
    store: StudyStore,
    origin: Origin,
    *,
    workers: int | None = None,
    cluster: str = "",
    progress: Progress,
    meanwhile: Callable[[], object] = tuple,
) -> Completed:
    """Compute the bench of a study itself, and the chunks that its folder lacks.

    Parameters
    ----------
    plan, store, origin
        The study, its folder, and what it was read from.
    workers, cluster
        See `bywire.studies.executor.executor_of`.
    progress
        Called with a label and the finished share, 0 to 1.
    meanwhile
        Called once when the first chunks are begun, while this process would wait for them.

    Returns
    -------
    Completed
        What the bench itself gave, and how many chunks were damaged.

    Raises
    ------
    ParameterError
        For workers that cannot be; nothing is written then.
    FileError
        When the folder is another study's, or cannot be written.
    RunError
        When the bench itself fails, or the workers are lost.
    DeviceError
        When the bench wants a graphics processor and there is none.
    KeyboardInterrupt
        When interrupted; what is finished stays.
    """
    until = time.monotonic() + plan.time
    require_workers(workers, cluster, plan.bench.engine)
    if plan.bench.engine == CUDA:
        find_device()  # else there would be a folder without a study
    store.open(plan, origin)
    damaged = store.drop_damaged()
    itself = partial(running.run, plan.bench, estimate_error=True)
    if plan.sought is not None:
        nominal = itself()
        together = plan.sought.together // CHUNK
        chunks = -(-plan.cases // CHUNK)
        executor = executor_of(workers, cluster, chunks, together, plan.bench.engine)
        seek = worst_cases if plan.design == WORST else rare_failures
        seek(plan, store, executor, progress)
        return Completed(nominal, damaged)
    missing = sorted(set(range(plan.chunks)) - store.finished())
    if not missing:
        return Completed(itself(), damaged)
    done = plan.chunks - len(missing)
    label = f"{plan.total} cases"
    progress(label, done / plan.chunks)
    executor = executor_of(workers, cluster, len(missing), engine=plan.bench.engine)
    with executor.opened(plan) as compute:
        nominal_run = compute.beside(itself)
        computed = compute(missing)
        meanwhile()
        for count, (chunk, columns) in enumerate(computed, 1):
            store.write(chunk, columns, plan.column_units)
            progress(label, (done + count) / plan.chunks)
            nominal_run.check()
            if time.monotonic() > until:
                break
        return Completed(nominal_run.result(), damaged)
