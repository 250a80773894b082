"""Run of a study, which computes missing chunks and stores each one as soon as it is complete."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from bywire.bench import running
from bywire.bench.running import Result
from bywire.core.callers import option
from bywire.core.copies import may_copy, processes_with_brakes
from bywire.core.errors import DeviceError, ParameterError
from bywire.core.typing import Progress
from bywire.simulation.cuda_device import find_device
from bywire.simulation.engine import CUDA
from bywire.studies.designs import WORST
from bywire.studies.executor import executor_of, require_workers, workers_on_device
from bywire.studies.plan import CHUNK, StudyPlan
from bywire.studies.sought_cases import rare_failures, worst_cases
from bywire.studies.store import Origin, StudyStore


@dataclass(frozen=True)
class Completed:
    """Results of a study outside its folder.

    Parameters
    ----------
    nominal
        Key figures of the bench itself, with their numerical error.
    damaged
        Number of damaged chunks, which are recomputed.
    """

    nominal: Result
    damaged: int


def _allowed_workers(workers: int | None, chunks: int) -> int | None:
    """Return the number of processes on the graphics processor, or fail without a processor.

    A copy of this process looks for it if workers will be copies too, because copies of a process
    that has used the driver cannot use it.
    """
    if workers_on_device(workers, chunks) > 1 and may_copy():
        with processes_with_brakes(1, "check the driver") as pool:
            label = pool.submit(_exclusive_device).result()
    else:
        label = _exclusive_device()
    if label and workers is not None and workers > 1:
        raise ParameterError(
            f"workers = {workers} is not valid: it must be 1, because the compute mode of {label} "
            f"allows only one process. Remove {option('workers')}, or ask an administrator to run "
            "'nvidia-smi -c DEFAULT'",
            name=option("workers"),
            value=str(workers),
            valid="1",
        )
    return 1 if label else workers


def _exclusive_device() -> str:
    """Return the name of the graphics processor if only one process may use it, or nothing."""
    device = find_device()
    return str(device.label) if device.is_exclusive else ""


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
    """Compute a study's bench itself, and the chunks that are missing from its folder.

    Parameters
    ----------
    plan, store, origin
        The study, its folder, and its source.
    workers, cluster
        See `bywire.studies.executor.executor_of`.
    progress
        Called with a label and the finished share, 0 to 1.
    meanwhile
        Called once while this process would otherwise wait for the first chunks.

    Returns
    -------
    Completed
        Key figures of the bench itself, and the number of damaged chunks.

    Raises
    ------
    ParameterError
        If the number of workers is invalid. Nothing is written.
    FileError
        If the folder belongs to another study, or is not writable.
    RunError
        If the bench itself fails, or all workers are lost.
    DeviceError
        If the bench needs a graphics processor that is missing or fails. Finished chunks
        remain.
    KeyboardInterrupt
        If interrupted. Finished chunks remain.
    """
    until = time.monotonic() + plan.time
    require_workers(workers, cluster, plan.bench.engine)
    if plan.bench.engine == CUDA:
        workers = _allowed_workers(workers, plan.chunks)  # fails here, before the folder is created
    claim: Callable[[], object] = partial(store.open, plan, origin)
    # The advice to resume after a device's failure needs a folder.
    if store.folder.exists() or plan.sought is not None or plan.bench.engine == CUDA:
        claim()
        claim = tuple
    try:
        return _completed(plan, store, workers, cluster, progress, (claim, meanwhile), until)
    except DeviceError as error:
        if not store.folder.exists():
            raise
        kept = f"Finished chunks are saved: type '{store.resume_command}' to continue"
        raise error.reworded(f"{error}. {kept}") from None


def _completed(
    plan: StudyPlan,
    store: StudyStore,
    workers: int | None,
    cluster: str,
    progress: Progress,
    meanwhile: Sequence[Callable[[], object]],
    until: float,
) -> Completed:
    """Compute the bench itself and the missing chunks; see `complete`.

    ``meanwhile``: called before the first chunk is stored. For a new folder, the first function
    claims it, which takes as long as several chunks because the identity covers all definitions.
    """
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
        for each in meanwhile:
            each()
        for count, (chunk, columns) in enumerate(computed, 1):
            store.write(chunk, columns, plan.column_units)
            progress(label, (done + count) / plan.chunks)
            nominal_run.check()
            if time.monotonic() > until:
                break
        return Completed(nominal_run.result(), damaged)
