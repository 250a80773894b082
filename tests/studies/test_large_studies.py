"""Large studies: few files, exact statistics from blocks, and memory that does not grow."""

from __future__ import annotations

import json
import shutil
import tracemalloc
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from bywire.api.study_figures import case_figures
from bywire.api.study_run import findings_data
from bywire.bench.kpis.kpi import Kpi
from bywire.studies import store as stores
from bywire.studies import stored_cases as stored
from bywire.studies.findings import Findings
from bywire.studies.plan import CHUNK
from bywire.studies.store import CASE, FAILURE, WARNINGS, Origin, StudyStore
from bywire.studies.stored_cases import stored_cases
from bywire.studies.study_file import read_study

VARY = """
[vary]
"seal.T_pr" = { kind = "normal", sd = "5 %" }
"adc.law" = { kind = "discrete", values = ["ideal", "quantized"] }
[requirements]
breakaway_apply = "<= 0.5 N*m with 90 %"
"""
BENCH = 'experiment = "seal-stribeck"\nparameters = "dardanelli2010"\n'


@pytest.fixture
def plan(study):
    return read_study(study(VARY, BENCH))


@pytest.fixture
def kept(plan, tmp_path):
    folder = StudyStore(tmp_path / "out")
    folder.open(plan, Origin(tmp_path / "study.toml"))
    return folder


@pytest.fixture
def few(monkeypatch):
    """Merge four chunks, instead of a thousand."""
    monkeypatch.setattr(stores, "GROUP", 4)
    monkeypatch.setattr(stored, "GROUP", 4)
    monkeypatch.setattr(stored, "BLOCK", 4 * CHUNK)


def cases_of(number: int, count: int) -> dict[str, np.ndarray]:
    """Return made-up cases: some values are equal, some figures undefined, some results missing."""
    rng = np.random.default_rng(number)
    torque = rng.normal(1.0, 0.05, count)
    figure = 0.4 * torque + 0.02 * rng.normal(size=count)
    case = number * count + np.arange(count)
    failed = case % 131 == 7
    reasons, warnings = (np.full(count, "", dtype=object) for _ in range(2))
    reasons[failed] = [f"it left the numbers at {k} s" for k in case[failed]]
    hot = case % 100 == 3
    warnings[hot] = [json.dumps([f"hot: {k} degC"]) for k in case[hot]]
    return {
        CASE: case,
        "seal.T_pr": torque,
        "adc.law": rng.choice(np.array(["ideal", "quantized"], dtype=object), count),
        "breakaway_apply": np.where(failed | (case % 97 == 5), np.nan, figure),
        "breakaway_release": np.where(rng.random(count) < 0.3, 0.0, np.round(figure, 3)),
        FAILURE: reasons,
        WARNINGS: warnings,
    }


def files(kept: StudyStore) -> list[str]:
    return sorted(path.name for path in (kept.folder / "chunks").iterdir())


def test_finished_chunks_become_one_file_that_replaces_theirs(few, plan, kept):
    for n in (5, 1, 0, 2, 9, 4, 3, 7, 6):
        kept.write(n, cases_of(n, CHUNK), {})
    merged = ["000000-000003.parquet", "000004-000007.parquet"]
    assert files(kept) == [*merged, "000009.parquet"]
    anew = StudyStore(kept.folder)
    assert anew.finished() == {*range(8), 9}
    assert anew.asked_and_computed(plan) == (plan.total, 10 * CHUNK)
    for n in (0, 6, 9):
        expected = {name: column.tolist() for name, column in cases_of(n, CHUNK).items()}
        found = {name: column.tolist() for name, column in anew.columns(n).items()}
        np.testing.assert_equal(found, expected)
    pd.testing.assert_frame_equal(
        stored_cases(plan, anew).frame(), anew.read(plan.chunks), check_exact=True
    )


def test_a_kill_while_files_are_merged_and_a_damaged_file_lose_nothing_else(few, kept):
    for n in range(3):
        kept.write(n, cases_of(n, CHUNK), {})
    before = kept.folder / "before"
    shutil.copytree(kept.folder / "chunks", before)
    kept.write(3, cases_of(3, CHUNK), {})
    shutil.copytree(before, kept.folder / "chunks", dirs_exist_ok=True)  # not yet removed
    anew = StudyStore(kept.folder)
    assert len(anew.finished()) == 4
    assert anew.drop_damaged() == 0
    assert files(kept) == ["000000-000003.parquet"]
    kept.group_path(0).write_bytes(kept.group_path(0).read_bytes()[:-100])
    assert StudyStore(kept.folder).drop_damaged() == 4
    assert files(kept) == []


def test_files_of_an_earlier_folder_are_merged_when_it_is_continued(plan, kept, monkeypatch):
    for n in range(5):
        kept.write(n, cases_of(n, CHUNK), {"seal.T_pr": "N*m"})
    cases = stored_cases(plan, kept).frame()
    monkeypatch.setattr(stores, "GROUP", 4)
    monkeypatch.setattr(stored, "GROUP", 4)
    anew = StudyStore(kept.folder)
    assert anew.drop_damaged() == 0
    assert files(kept) == ["000000-000003.parquet", "000004.parquet"]
    again = stored_cases(plan, StudyStore(kept.folder)).frame()
    pd.testing.assert_frame_equal(again, cases, check_exact=True)


def test_blocks_give_the_findings_of_all_cases_together(few, plan, kept):
    for n in range(16):
        kept.write(n, cases_of(n, CHUNK), {})
    nominal = (Kpi("breakaway_apply", 0.4, "N*m", "A torque.", error=0.002),)
    cases = stored_cases(plan, StudyStore(kept.folder))
    blocks = Findings(plan, cases, nominal)
    whole = Findings(plan, cases.frame(), nominal)
    assert len(blocks.first) == 4 * CHUNK
    assert blocks.judgments == whole.judgments
    assert (blocks.reasons, blocks.warnings) == (whole.reasons, whole.warnings)
    assert len(whole.reasons) == 1 < whole.failed
    for found, expected in zip(blocks.spreads, whole.spreads, strict=True):
        assert found.quantiles == expected.quantiles
        assert (found.least, found.largest) == (expected.least, expected.largest)
        assert (found.mean, found.sd) == pytest.approx((expected.mean, expected.sd), rel=1e-12)
        values = whole.figure(found.name)
        known = values[np.isfinite(values)]
        median = found.quantiles[1]
        assert median.value == np.quantile(known, 0.5)
        counts, _ = np.histogram(known, found.counts.size)
        np.testing.assert_array_equal(found.counts, counts)
    np.testing.assert_array_equal(blocks.figure("breakaway_apply"), whole.figure("breakaway_apply"))
    row = whole.judgments[0].worst
    assert row is not None
    assert blocks.values(row) == whole.values(row)
    assert [b.caption for b in case_figures(blocks)[1]] == [
        b.caption for b in case_figures(whole)[1]
    ]


def test_neither_memory_nor_report_grows_with_the_cases(plan, kept, monkeypatch):
    """A quarter of a million cases; what would hold all of them is not called."""
    monkeypatch.setattr(stored.StoredCases, "frame", None)
    size = stores.GROUP * CHUNK
    peaks, lengths = [], []
    for groups in (1, 4):
        for n in range(groups):
            if not kept.group_path(n).exists():
                marks = kept._group_marks(n)
                stores._write_chunk(kept.group_path(n), cases_of(n, size), {}, marks)
        larger = replace(plan, cases=groups * size, varied=plan.varied[:1])
        tracemalloc.start()
        findings = Findings(larger, stored_cases(larger, kept), ())
        lengths.append(len(json.dumps(findings_data(findings), default=float)))
        case_figures(findings)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert findings.count == larger.total
        assert findings.judgments[0].share.cases == larger.total
    assert peaks[1] < 1.1 * peaks[0]
    assert lengths[1] < 1.1 * lengths[0]
