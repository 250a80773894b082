"""Studies run: what goes on beside their chunks."""

from __future__ import annotations

import sys
from dataclasses import replace
from multiprocessing import active_children

import pandas as pd
import pytest

from bywire.core.errors import DeviceError, ParameterError
from bywire.core.typing import silent
from bywire.studies import executor
from bywire.studies.running import complete
from bywire.studies.store import Origin, StudyStore
from bywire.studies.study_file import read_study
from emulated_driver import EmulatedDriver, emulated
from raising import raises


# A process of tests has threads; commands that are copied have none.
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_what_waits_for_chunks_is_used_meanwhile(study, tmp_path, monkeypatch):
    if sys.platform != "linux":
        pytest.skip("processes are copied on Linux alone")
    monkeypatch.setattr("bywire.studies.executor.may_copy", lambda: True)
    plan, store = read_study(study()), StudyStore(tmp_path / "out")
    seen: list[int] = []
    complete(
        plan,
        store,
        Origin(tmp_path / "study.toml"),
        workers=2,
        progress=silent,
        meanwhile=lambda: seen.append(len(active_children())),
    )
    assert seen == [2]
    assert len(store.finished()) == plan.chunks


@pytest.fixture
def on_device(study):
    """Return a study of 512 cases for a graphics processor."""
    plan = replace(read_study(study()), cases=512)
    return replace(plan, bench=replace(plan.bench, engine="cuda"))


def completed(plan, folder, workers=1):
    store = StudyStore(folder)
    complete(plan, store, Origin(folder / "study.toml"), workers=workers, progress=silent)
    return StudyStore(folder).read(plan.chunks)  # from its files


# A process of tests has threads; commands that are copied have none.
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
@pytest.mark.parametrize("workers", [1, 2])
def test_a_lost_context_ends_all_processes_and_the_study_goes_on(
    on_device, tmp_path, monkeypatch, workers
):
    if workers > 1 and sys.platform != "linux":
        pytest.skip("processes are copied on Linux alone")
    monkeypatch.setattr(executor, "_TOGETHER", 1)
    monkeypatch.setattr("bywire.core.copies.may_copy", lambda: True)
    monkeypatch.setattr("bywire.studies.running.may_copy", lambda: True)
    folder, driver = tmp_path / "out", EmulatedDriver()
    driver.is_lost = lambda: len([*folder.glob("chunks/*")]) >= 2
    with emulated(driver):
        with raises(DeviceError, name="emulated 0", value="CUDA_ERROR_ECC_UNCORRECTABLE") as lost:
            completed(on_device, folder, workers)
        assert str(lost.value).endswith(f"type 'bywire study resume {folder}' to continue")
        kept = {path: path.stat().st_mtime_ns for path in folder.glob("chunks/*")}
        assert 2 <= len(kept) < on_device.chunks
        assert not active_children()
        driver.is_lost = lambda: False
        cases = completed(on_device, folder, workers)
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    lanes = replace(on_device, bench=replace(on_device.bench, engine="auto"))
    pd.testing.assert_frame_equal(cases, completed(lanes, tmp_path / "lanes"), check_exact=True)


def test_a_processor_for_one_process_alone_has_one(on_device, tmp_path, monkeypatch):
    driver = EmulatedDriver()
    driver.mode = 3
    with emulated(driver):
        with raises(ParameterError, name="workers", value="2", valid="1"):
            completed(on_device, tmp_path / "out", workers=2)
        assert not (tmp_path / "out").exists()
        monkeypatch.setattr(executor, "Pool", None)
        assert len(completed(on_device, tmp_path / "out", workers=None)) == 512
