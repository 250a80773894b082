"""The rows of a graphics processor are measured, or say why they are not."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.declared import declared
from benchmarks.motorcycle import graphics_processor
from benchmarks.suite import Part
from bywire.studies.store import Origin, StudyStore, computed_chunks
from bywire.studies.study_file import read_study
from emulated_driver import EmulatedDriver, Status, emulated

QUICK = """
experiment = "hard-braking"
parameters = "dardanelli2010"
[options]
duration = "40 ms"
settle = "10 ms"
"""
STUDY = 'bench = "bench.toml"\n[vary]\n"motor.R_m" = "+-5 %"\n'


def run_here(
    line: Sequence[str], limit: float | None = None, changes: Mapping[str, str] | None = None
) -> float:
    """Run the study of a command line in this process, where the driver is emulated."""
    assert limit
    begin, words = time.perf_counter(), list(line[line.index("study") :])
    assert words[:2] == ["study", "run"]
    given = dict(zip(words[3::2], words[4::2], strict=True))
    study, store = Path(words[2]), StudyStore(Path(given["--out"]))
    plan = replace(read_study(study), cases=int(given["--cases"]))
    plan = replace(plan, bench=replace(plan.bench, engine=given["--engine"]))
    store.open(plan, Origin(study))
    for chunk, columns in computed_chunks(plan, range(plan.chunks)):
        store.write(chunk, columns, {})
    return time.perf_counter() - begin


@pytest.fixture
def small(tmp_path, monkeypatch):
    """Make every row small, and studies run in this process."""
    bench, study = tmp_path / "bench.toml", tmp_path / "study.toml"
    bench.write_text(QUICK)
    study.write_text(STUDY)
    longer = {"gpu.wet_stop": (str(bench), {"seal.T_pr": "+-5 %"})}
    changes = {
        "LANES": 2,
        "THREADS": 3,
        "ENSEMBLES": (2, 3),
        "BESIDE": 2,
        "CASES": 64,
        "STUDIES": (64,),
        "_ROUNDS": 1,
        "_TOLERANCES": study,
        "_LONGER": longer,
        "seconds_of": run_here,
    }
    # The digest of the code takes half a second for each study.
    monkeypatch.setattr(
        "bywire.bench.computation.functions_digest", lambda *_, **__: "the same code"
    )
    for name, value in changes.items():
        monkeypatch.setattr(graphics_processor, name, value)


def test_every_row_is_measured_where_there_is_one(small, tmp_path, monkeypatch):
    if sys.platform == "win32":
        pytest.skip("the service is a script of POSIX")
    service = tmp_path / "nvidia-cuda-mps-control"
    service.write_text('#!/bin/sh\n[ "$1" = -d ] || read what\necho "$1$what" >>"$0.log"\n')
    service.chmod(0o700)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    assert "graphics processor" in declared(Part)
    with emulated(EmulatedDriver()):
        rows = {each.id: each for each in graphics_processor.measured()}
    assert not [each.note for each in rows.values() if each.value is None]
    assert service.with_suffix(".log").read_text() == "-d\nquit\n"
    assert list(rows) == [
        "gpu.start",
        "study.gpu_ratio",
        "study.gpu_difference",
        "gpu.ensemble_2",
        "gpu.kernel_2",
        "gpu.ensemble_3",
        "gpu.kernel_3",
        "gpu.study_64",
        "gpu.wet_stop",
        "gpu.study_service",
        "gpu.study_difference",
    ]
    goals = {name: each.goal for name, each in rows.items() if each.goal}
    assert goals == {
        "study.gpu_ratio": ">= 50",
        "study.gpu_difference": "<= 0",
        "gpu.ensemble_3": ">= 350000",
        "gpu.wet_stop": ">= 4",
        "gpu.study_64": ">= 40000",
        "gpu.study_difference": "<= 0",
    }
    assert all(each.value > 0.0 for each in rows.values() if "difference" not in each.id)
    assert rows["study.gpu_difference"].value == rows["gpu.study_difference"].value == 0.0


def test_rows_without_time_or_with_an_error_say_so(small, monkeypatch):
    monkeypatch.setattr(graphics_processor, "SECONDS", 0.0)
    with emulated(EmulatedDriver()):
        _, _, _, *rows = graphics_processor.measured()
        assert all((each.value, each.holds) == (None, None) for each in rows)
        assert all("skipped, because" in each.note for each in rows)
        monkeypatch.setattr(graphics_processor, "SECONDS", 100.0)

        def fails(line, limit, changes):
            raise subprocess.CalledProcessError(1, line, stderr="reading\nno such bench\n")

        monkeypatch.setattr(graphics_processor, "seconds_of", fails)
        rows = {each.id: each for each in graphics_processor.measured()}
    assert rows["gpu.study_64"].is_failed
    assert rows["gpu.study_64"].note == "exit status 1: no such bench"
    assert rows["gpu.ensemble_3"].value


def test_a_processor_that_fails_is_a_reason(small):
    driver = EmulatedDriver()
    driver.cuCtxSynchronize = lambda: (Status.CUDA_ERROR_ILLEGAL_ADDRESS,)
    with emulated(driver):
        _, first, *_ = graphics_processor.measured()
    assert (first.id, first.value, first.is_failed) == ("study.gpu_ratio", None, False)
    assert "CUDA_ERROR_ILLEGAL_ADDRESS" in first.note


def test_without_one_it_says_why():
    driver = EmulatedDriver()
    driver.count = 0
    with emulated(driver):
        (row,) = graphics_processor.measured()
    assert (row.value, row.holds) == (None, None)
    assert row.note.endswith("no NVIDIA graphics processor. Check that nvidia-smi lists one")
