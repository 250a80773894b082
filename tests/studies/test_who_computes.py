"""Who computes the chunks of a study changes no bit of them: processes, pools, a cluster."""

from __future__ import annotations

import re
import signal
import sys
import time
import warnings
from functools import partial
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bywire.bench.ensemble import numbers_per_case
from bywire.core.errors import FileError, ParameterError, RunError
from bywire.studies import executor
from bywire.studies.executor import (
    CLUSTER_MEMORY,
    CLUSTER_SETTINGS,
    Cluster,
    InProcess,
    Pool,
    executor_of,
)
from bywire.studies.plan import CHUNK
from bywire.studies.store import Origin, StudyStore
from bywire.studies.study_file import read_study
from raising import raises


def chunks_of(executor, plan, chunks):
    with executor.opened(plan) as compute:
        yield from compute(chunks)


# A process of tests has threads; commands that are copied have none.
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
@pytest.mark.parametrize("is_copied", [False, True], ids=["begun", "copied"])
def test_who_computes_changes_no_bit_and_ends_at_once_when_nobody_asks_any_more(
    study, tmp_path, monkeypatch, is_copied
):
    """Processes end as after Ctrl-C: what they are at may take long."""
    if is_copied and sys.platform != "linux":
        pytest.skip("processes are copied on Linux alone")
    monkeypatch.setattr("bywire.studies.executor.may_copy", lambda: is_copied)
    plan = read_study(study())
    alone, shared = (StudyStore(tmp_path / name) for name in ("alone", "shared"))
    for store in (alone, shared):
        store.open(plan, Origin(tmp_path / "study.toml"))
    for chunk, columns in chunks_of(InProcess(), plan, [2, 0, 1]):  # in whatever order
        alone.write(chunk, columns, {})
    computing = chunks_of(Pool(2), plan, range(100))
    while not all(shared.path(k).exists() for k in range(3)):
        shared.write(*next(computing), {})
    workers = active_children()
    assert workers
    computing.close()
    pd.testing.assert_frame_equal(alone.read(3), shared.read(3), check_exact=True)
    anew = StudyStore(shared.folder)  # from its files
    pd.testing.assert_frame_equal(alone.read(3), anew.read(3), check_exact=True)
    if sys.platform == "win32":
        return  # signals of POSIX
    until = time.monotonic() + 10.0  # the pool's own thread may wait for them too
    while any(each.exitcode is None for each in workers) and time.monotonic() < until:
        time.sleep(0.01)
    assert {each.exitcode for each in workers} == {-signal.SIGKILL}


# A process of tests has threads; commands that are copied have none.
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
@pytest.mark.parametrize("kind", ["pool", "alone"])
def test_what_stands_beside_chunks_warns_and_fails_where_it_was_asked(study, monkeypatch, kind):
    if kind == "pool" and sys.platform != "linux":
        pytest.skip("processes are copied on Linux alone")
    monkeypatch.setattr("bywire.studies.executor.may_copy", lambda: True)
    plan = read_study(study())
    with (Pool(1) if kind == "pool" else InProcess()).opened(plan) as compute:
        with pytest.warns(UserWarning, match="coarse"):
            assert compute.beside(partial(warnings.warn, "coarse")).result() is None
        if kind == "pool":  # the other fails at once
            failing = compute.beside(partial(read_study, "nowhere.toml"))
            assert [chunk for chunk, _ in compute([0])] == [0]
            with pytest.raises(FileError, match="nowhere"):
                failing.check()


def test_the_page_says_how_a_cluster_is_best_started():
    config = pytest.importorskip("dask").config
    pytest.importorskip("distributed")
    page = (Path(__file__).parents[2] / "docs/studies.md").read_text(encoding="utf-8")
    said = dict(re.findall(r"^export (DASK_DISTRIBUTED\w+)=(\w+)$", page, re.M))
    read = config.collect_env(said)
    assert len(said) == len(CLUSTER_SETTINGS)
    for name, value in CLUSTER_SETTINGS.items():
        assert config.get(name) != value  # there is such a setting, and it is another one
        assert config.get(name, config=read) == value
    memory = dict(re.findall(r"^export (MALLOC_\w+)=(\d+)$", page, re.M))
    assert {name: int(value) for name, value in memory.items()} == CLUSTER_MEMORY
    known = config.get("distributed.nanny.pre-spawn-environ")
    assert int(known["MALLOC_TRIM_THRESHOLD_"]) < CLUSTER_MEMORY["MALLOC_TRIM_THRESHOLD_"]


def test_a_cluster_computes_the_same_until_its_workers_are_gone(study):
    distributed = pytest.importorskip("distributed")
    plan = read_study(study())
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0"
    ) as cluster:
        ((_, theirs),) = chunks_of(Cluster(cluster.scheduler_address), plan, [1])
        with Cluster(cluster.scheduler_address).opened(plan) as compute:
            given = compute(range(64))
            next(given)
            cluster.scale(0)
            with pytest.raises(RunError, match=r"lost its workers.*Resume the study"):
                list(given)
    ((_, ours),) = chunks_of(InProcess(), plan, [1])
    for name, column in ours.items():
        np.testing.assert_array_equal(column, theirs[name])


def test_a_cluster_that_is_not_there_is_named(study, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("bywire.studies.executor._SECONDS", 0.5)
    with pytest.raises(RunError, match=r"no cluster responds at 'tcp://192\.0\.2\.1:9'"):
        next(chunks_of(Cluster("tcp://192.0.2.1:9"), read_study(study()), [0]))


def test_who_computes_is_chosen_by_the_work(monkeypatch):
    assert isinstance(executor_of(None, "", 2), InProcess)
    with monkeypatch.context() as copied:
        copied.setattr("os.cpu_count", lambda: 2)
        copied.setattr("bywire.studies.executor.may_copy", lambda: True)
        assert isinstance(executor_of(None, "", 1), InProcess)
        assert isinstance(executor_of(None, "", 2), Pool)
    assert isinstance(executor_of(1, "", 100), InProcess)
    assert isinstance(executor_of(3, "", 100), Pool)
    with pytest.raises(ParameterError, match="workers = 0"):
        executor_of(0, "", 1)
    with pytest.raises(ParameterError, match="a cluster has its own workers"):
        executor_of(2, "tcp://host:8786", 1)
    alone, shared = (executor_of(n, "", 1000, engine="cuda") for n in (1, 3))
    assert isinstance(alone, InProcess)
    assert isinstance(shared, Pool)
    assert (alone.together, shared.together) == (500, 334)  # as few rounds as possible
    monkeypatch.setattr("os.cpu_count", lambda: 16)
    few, some, many = (executor_of(None, "", n, engine="cuda") for n in (63, 157, 3125))
    assert isinstance(few, InProcess)
    assert few.together == 63
    assert (some.workers, some.together) == (4, 40)  # a launch of few cases takes as long
    assert (many.workers, many.together) == (16, 196)
    with raises(ParameterError, name="cluster"):
        executor_of(None, "tcp://host:8786", 1000, engine="cuda")


def test_a_batch_for_a_graphics_processor_fits_into_this_machines_memory(study, monkeypatch):
    plan = read_study(study())
    size = 8 * CHUNK * numbers_per_case(plan.bench)
    rows = 51  # of 10 ms of settling and 40 ms, 12 signals or more, and the stimulus twice
    assert size > 8 * CHUNK * rows * (12 + 2)
    monkeypatch.setattr(executor, "machine_memory", lambda: 12.5 * size)
    assert [executor._fitting(plan, 100, workers) for workers in (1, 2, 20)] == [6, 3, 1]
    assert executor._fitting(plan, 2, 1) == 2
    assert executor._fitting(plan, 7, 1) == 4  # and then 3, instead of 6 and 1


def test_tasks_grow_to_their_target_and_shrink_towards_the_end():
    tasks, sizes = executor._Tasks(range(40), workers=2, seconds=0.2, most=4), []
    while task := tasks.next():
        sizes.append(len(task))
        tasks.measured((0.08 * len(task), [(n, {}) for n in task]))  # 0.08 s for each chunk
    assert sizes[:4] == [1, 2, 2, 2]
    assert sizes[-3:] == [1, 1, 1]
    assert sum(sizes) == 40
    quick = executor._Tasks(range(40), workers=1, seconds=0.2, most=4)
    quick.measured((1e-3, [(0, {})]))
    assert len(quick.next()) == 4
