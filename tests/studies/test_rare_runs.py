"""Studies of rare failures: closed forms come back; kills, workers and budgets change nothing."""

from __future__ import annotations

import json
import math
import shutil
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import bywire
from bywire.core.errors import FileError, InputError, RunError
from bywire.studies import executor
from bywire.studies.store import StudyStore, case_bench
from bywire.studies.study_file import read_study
from raising import raises
from undrawn import undrawn

pytest.importorskip("openturns")

BENCH = """
experiment = "hard-braking"
parameters = "dardanelli2010"
[options]
duration = "40 ms"
settle = "10 ms"
[requirements]
overshoot = "<= 15 %"
"""
AXIS = """
experiment = "step"
parameters = "spring-axis-one"
[options]
input = "F_set"
output = "x"
end = "100 N"
duration = "1.2 s"
record = "0.6 ms"
[simulation]
step = "0.2 ms"
[set]
F_c = "0 N"
k_c = "1 nN/m"
T_s = "0.2 ms"
"""
DAMPED = """
bench = "bench.toml"
[vary]
d = { kind = "normal", sd = "15 %" }
m = { kind = "normal", sd = "3 %" }
[[correlation]]
of = ["d", "m"]
value = 0.5
[design]
kind = "KIND"
MORE
[requirements]
overshoot = "<= LIMIT % with 99.8 %"
"""
BRAKE = """
[vary]
"motor.R_m" = { kind = "normal", sd = "4 %" }
"motor.K_e" = "+-5 %"
[design]
kind = "subset-simulation"
cases = 3000
cases_per_level = 640
[requirements]
peak_current = "<= 19 A with 99.9 %"
"""


def overshoot(d, m):
    """Of a mass on a spring without dry friction [%]."""
    zeta = d / (2.0 * np.sqrt(1e4 * m))
    return 100.0 * np.exp(-np.pi * zeta / np.sqrt(1.0 - zeta**2))


def failure(limit: float) -> float:
    """Return the probability of a larger overshoot: of d / sqrt(m) below a bound, by quadrature."""
    root = 2.0 * math.sqrt(1e4) * abs(math.log(limit / 100.0))
    edge = root / math.hypot(math.pi, math.log(limit / 100.0))
    x, weights = np.polynomial.hermite_e.hermegauss(80)
    m = 2.0 * (1.0 + 0.03 * x)
    # Given the score x of the mass, that of the damping is normal around 0.5 x.
    scores = ((edge * np.sqrt(m) - 60.0) / 9.0 - 0.5 * x) / math.sqrt(0.75)
    return float(weights @ stats.norm.cdf(scores) / math.sqrt(2.0 * math.pi))


@pytest.fixture
def axis(tmp_path, spring_axis):
    """Return a function that runs a study of the mass on a spring."""

    def run(kind: str, limit: float, more: str = ""):
        (tmp_path / "bench.toml").write_text(AXIS)
        text = DAMPED.replace("KIND", kind).replace("LIMIT", f"{limit}").replace("MORE", more)
        (tmp_path / "study.toml").write_text(text)
        return bywire.run_study(tmp_path / "study.toml", tmp_path / "out", workers=1)

    return run


@pytest.mark.parametrize(
    ("kind", "limit", "more"),
    [
        ("subset-simulation", 67.0, "cases = 1920\ncases_per_level = 640"),
        ("importance-sampling", 70.0, "cases = 1280"),
    ],
)
def test_a_linear_axis_fails_as_seldom_as_its_closed_form(axis, tmp_path, kind, limit, more):
    true, study = failure(limit), axis(kind, limit, more)
    assert 2e-4 < true < 5e-3
    (rare,) = study.findings.rare
    assert rare.failure.estimate.low < true < rare.failure.estimate.high
    assert len(study.cases) <= rare.failure.runs <= 1920  # a search may ask for a case twice
    if kind == "importance-sampling":
        assert rare.failure.runs <= 1280
        assert rare.failure.estimate.variation < 0.08
    assert (
        study.status
        == {"met": "passed", "missed": "failed", "undecided": "undecided"}[
            study.findings.judgments[0].outcome
        ]
    )
    assert rare.importance[0].quantity == "d"
    assert rare.importance[0].score < -2.5
    bench = study.worst("overshoot")  # the most probable failing case
    assert limit < overshoot(bench.par.d, bench.par.m) < limit + 3.0
    with undrawn():
        study.write(tmp_path / "out")
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"failing-overshoot.toml", "failing-overshoot.nc", "exceedance.png"} <= names
    assert bywire.run(tmp_path / "out" / "failing-overshoot.toml").kpi("overshoot").value > limit
    (said,) = json.loads((tmp_path / "out" / "report.json").read_text())["requirements"]
    assert said["failure"]["probability"] == rare.failure.estimate.value
    assert said["importance"]["d"]["factor"] > 0.8
    assert "probability" in str(study)


def interrupted(after: int):
    """Return progress that interrupts after so many batches."""
    calls = iter(range(after))

    def progress(label: str, share: float) -> None:
        if next(calls, None) is None:
            raise KeyboardInterrupt

    return progress


@pytest.fixture(scope="module")
def first_level(tmp_path_factory):
    """Return the folder of a study whose budget is spent when its first level is computed."""
    folder = tmp_path_factory.mktemp("rare")
    (folder / "bench.toml").write_text(BENCH)
    (folder / "study.toml").write_text('bench = "bench.toml"\n' + BRAKE)
    bywire.run_study(folder / "study.toml", folder / "out", cases=700, workers=1)
    return folder


@pytest.fixture
def spent(first_level, tmp_path):
    """Return a folder of that study for a test of its own."""
    folder = Path(shutil.copytree(first_level, tmp_path / "spent"))
    record = folder / "out" / "study.json"
    record.write_text(record.read_text().replace(str(first_level), str(folder)))
    return folder


def test_interrupted_resumed_and_by_workers_it_is_the_same_to_the_bit(spent, tmp_path):
    out, whole = spent / "out", tmp_path / "whole"
    shutil.copytree(out, whole)
    whole = bywire.resume_study(whole, cases=900, workers=1)
    assert len(whole.cases) == 896
    with pytest.raises(KeyboardInterrupt, match="resume"):
        bywire.resume_study(out, cases=900, workers=1, progress=interrupted(12))
    partial = bywire.study_report(out)
    assert partial.status == "unfinished"
    assert len(partial.cases) == 768
    assert [x.probability for x in partial.findings.rare[0].failure.levels] == [0.1]
    assert any("not all cases" in text for text in partial.warnings)
    StudyStore(out).path(3).unlink()  # as one of several that were computed at once
    written = StudyStore(out).path(2).stat().st_mtime_ns
    resumed = bywire.resume_study(out, workers=2)  # of 900 cases
    assert StudyStore(out).path(2).stat().st_mtime_ns == written
    pd.testing.assert_frame_equal(resumed.cases, whole.cases, check_exact=True)
    first, second = (each.as_object()["requirements"] for each in (whole, resumed))
    assert first == second
    assert bywire.study_report(out).as_object()["requirements"] == first


def test_a_spent_budget_is_said_and_extended(spent):
    out = spent / "out"
    before = bywire.study_report(out)
    assert (len(before.cases), before.status) == (640, "undecided")
    assert any(" 700 cases " in text for text in before.warnings)
    more = bywire.resume_study(out, cases=800)
    pd.testing.assert_frame_equal(more.cases[:640], before.cases, check_exact=True)
    assert len(more.cases) == 768


def test_every_case_has_noise_of_its_own_but_those_of_a_search(study):
    plan = read_study(study(BRAKE))
    values = {"motor.R_m": 0.35, "motor.K_e": 0.03}
    assert case_bench(plan, 7, values).seed == plan.bench.seed + 7
    text = BRAKE.replace("subset-simulation", "importance-sampling")
    plan = read_study(study(text.replace("cases_per_level = 640", "")))
    assert case_bench(plan, 7, values).seed == plan.bench.seed
    assert case_bench(plan, 1024 * 64, values).seed == plan.bench.seed + 1024 * 64


def test_each_requirement_in_turn_shares_the_first_level(study, tmp_path):
    text = BRAKE + 'rise_time = "<= 30 ms with 90 %"\n'
    found = bywire.run_study(study(text, bench=BENCH), tmp_path / "out", cases=700)
    first, second = found.findings.rare
    assert (first.failure.runs, second.failure.runs) == (640, 640)
    assert len(found.cases) == 640
    assert any("no verdict" in note and "overshoot" in note for note in found.notes)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (" with 99.9 %", "", "contains no probability"),
        ("cases = 3000", "cases = 600", ">= 640"),
        ('"subset-simulation"', '"importance-sampling"', "cases_per_level applies only to"),
        ('"subset-simulation"', '"subset"', "did you mean 'subset-simulation'"),
        ("cases_per_level = 640", "levels = 3", "levels"),
        (
            'kind = "subset-simulation"\ncases = 3000\ncases_per_level = 640',
            'kind = "importance-sampling"',
            "adc.law",
        ),
    ],
)
def test_what_does_not_fit_is_refused(study, old, new, why):
    text = BRAKE.replace("[design]", '"adc.law" = { values = ["ideal", "quantized"] }\n[design]')
    with pytest.raises(InputError, match=why):
        read_study(study(text.replace(old, new)))


def test_cases_of_another_draw_are_refused(spent):
    store = StudyStore(spent / "out")
    store.write(0, store.columns(1), {})
    with raises(FileError, name=str(store.path(0))):
        bywire.study_report(spent / "out")


def test_a_study_of_another_limit_is_another(spent):
    path, out = spent / "study.toml", spent / "out"
    path.write_text(path.read_text().replace("99.9 %", "99 %"))
    assert bywire.study_report(out).findings.rare[0].demand.probability == 0.99
    path.write_text(path.read_text().replace("19 A", "20 A"))
    with pytest.raises(FileError, match="contains another study"):
        bywire.study_report(out)


def test_a_killed_worker_of_a_search_is_what_the_pool_says_it_is(study, tmp_path, monkeypatch):
    """OpenTURNS, which asks for the cases, stands between the pool and who opened it."""
    text = BRAKE.replace("subset-simulation", "importance-sampling")

    def broken(*given):
        raise BrokenProcessPool("terminated abruptly")
        yield

    monkeypatch.setattr(executor, "as_completed", broken)
    path = study(text.replace("cases_per_level = 640", ""), BENCH)
    with pytest.raises(RunError, match=r"a process of the study was killed.*resume it"):
        bywire.run_study(path, tmp_path / "out", workers=2)
