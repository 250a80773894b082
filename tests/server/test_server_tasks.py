"""Values of forms reach the public functions, and each page is created once."""

from __future__ import annotations

import inspect
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import bywire
from bywire.core.errors import ParameterError
from bywire.server import study_so_far
from bywire.server.contents import Contents, contents
from bywire.server.exchange import RefusedError
from bywire.server.field import Field
from bywire.server.jobs import Job, Jobs
from bywire.server.live_pages import LivePages, shown_bench
from bywire.server.pages import bench_page, form
from bywire.server.place import Place
from bywire.server.study_so_far import StudyProgress, so_far
from bywire.server.task import tasks
from bywire.studies.findings import Findings
from bywire.studies.store import CASE, FAILURE, WARNINGS
from bywire.studies.study_file import read_study

STUDY = """
bench = "curve.toml"
[vary]
"seal.T_pr" = "+-20 %"
[design]
kind = "monte-carlo"
cases = 64
[requirements]
breakaway_apply = "<= 0.5 N*m with 90 %"
"""
FILLED = {
    "lines": "a=1\n b=2 \n\n",
    "pairs": "a = 1\n",
    "names": "a\nb=2 bar",
    "changes": "motor.R_m = 0.4 ohm\n",
    "text": "3",
    "whole": "3",
    "file": "x.csv",
    "files": "x.csv\n",
    "thing": "b.toml",
    "things": "x.csv\nb.toml",
}


def filled(field: Field) -> Any:
    """Return a value that differs from a field's default."""
    if field.kind == "flag":
        return not field.default
    return field.choices()[-1] if field.kind == "choice" else FILLED[field.kind]


@pytest.fixture
def place(tmp_path: Path) -> Place:
    for name in "x.csv", "b.toml":
        (tmp_path / name).write_text('experiment = "seal-stribeck"\n')
    return Place(tmp_path.resolve())


@pytest.mark.parametrize("name", tasks())
def test_every_field_reaches_the_function(name, place, monkeypatch):
    task = tasks()[name]
    signature, calls = inspect.signature(task.case.public), []
    if name == "identify":  # whose fields become fields of a question
        signature = inspect.signature(task.case.function)

    def called(*args: Any, **kwargs: Any) -> None:
        calls.append(signature.bind(*args, **kwargs).arguments)

    monkeypatch.setitem(vars(task.case), "function", called)
    monkeypatch.setitem(vars(task.case), "check", None)  # the fields' values have no meaning
    every = {field.name: filled(field) for field in task.fields}
    least = {field.name: every[field.name] for field in task.fields if field.is_required}

    def given(form: dict[str, Any]) -> dict[str, str]:
        task.compute(task.read(form, place), place.root / "out", lambda *_: None)
        return {k: repr(v) for k, v in calls[-1].items() if k != "progress"}

    by_default = given(least)
    assert (given(every) != by_default) == (every != least)
    # Each filled-in field changes one argument of the function.
    for field in task.fields:
        if not field.is_required:
            assert given({**least, field.name: every[field.name]}) != by_default, field.name


def test_forms_escape_what_the_folder_has(place):
    (place.root / '"><script>.csv').write_text("x")
    text = form(tasks()["replay"], contents(place), {"bench": '"><script>'})
    assert "<script>" not in text
    assert "&quot;&gt;&lt;script&gt;.csv" in text


class QuickJobs(Jobs):
    """Jobs that end immediately."""

    started, state = 0, "done"

    def start(self, task, asked, out=None):
        type(self).started += 1
        job = Job(self.started, task, asked, out, self.state, message="seeded")
        job.ended.set()
        return job


def test_live_pages_are_made_again_when_their_bench_changes(place, tmp_path):
    jobs = QuickJobs(place)
    pages = LivePages(place, jobs, tmp_path)
    text = (place.root / "b.toml").read_text() + 'name = "x.csv"\n'
    (place.root / "b.toml").write_text(text)
    first = pages.file("b.toml", "")
    assert pages.file("b.toml", "") == first
    assert jobs.started == 1
    assert pages.file("b.toml", "second") != first
    (place.root / "x.csv").write_text("a file that the bench names")
    changed = pages.file("b.toml", "")
    (place.root / "b.toml").write_text(text + '\n[set]\n"motor.R_m" = 1\n')
    assert len({first, changed, pages.file("b.toml", "")}) == 3
    QuickJobs.state = "failed"
    with pytest.raises(RefusedError, match="seeded"):
        pages.file("b.toml", "third")


def test_a_study_tells_now_and_then_what_there_is(monkeypatch, tmp_path):
    told, pages = [], [[], *[[tmp_path / "report.html"]] * 9]
    clock, shown, estimated = [0.0], [], []

    class Report:
        findings = None

        def write(self, folder):
            assert folder == tmp_path
            shown.append(clock[0])
            return pages[len(shown) - 1]

    def estimate(findings):
        estimated.append(clock[0])
        if len(estimated) == 1:
            raise ParameterError("too few cases")
        return []

    monkeypatch.setattr("bywire.api.study_run.kept_study", lambda _: Report())
    monkeypatch.setattr("bywire.usecases.study.study_report", lambda _: Report())
    monkeypatch.setattr(study_so_far, "so_far", estimate)
    monkeypatch.setattr(study_so_far, "tell", lambda **said: told.append(said))
    monkeypatch.setattr(study_so_far.time, "monotonic", lambda: clock[0])
    progress = StudyProgress(tmp_path, lambda *_: None)
    for second in range(20):
        clock[0] = float(second)
        progress("16 cases", second / 20)
    progress("16 cases", 1.0)
    # From the first chunk on. A study without a page would appear as missing.
    assert shown == [1.0, 7.0, 13.0, 19.0]
    assert estimated == [float(second) for second in range(1, 20, 2)]
    assert [said for said in told if "report" in said] == [{"report": True}] * 3
    assert [said for said in told if "so_far" in said] == [{"so_far": []}] * 9


def test_what_a_study_shows_so_far_is_counted_from_its_cases(tmp_path):
    text = 'experiment = "seal-stribeck"\nparameters = "dardanelli2010"\n'
    (tmp_path / "curve.toml").write_text(text)
    (tmp_path / "study.toml").write_text(STUDY)
    plan = read_study(tmp_path / "study.toml")
    torques = np.append(np.linspace(0.2, 0.6, 63), np.nan)
    columns = {
        "breakaway_apply": torques,
        "breakaway_release": np.full(64, np.nan),
        CASE: np.arange(64),
        FAILURE: "",
        WARNINGS: "",
        "seal.T_pr": 1.0,
    }
    found = Findings(plan, pd.DataFrame(columns), ())
    [row] = so_far(found)
    met = int(np.sum(torques <= 0.5))
    assert f"breakaway_apply <= 0.5 N*m with 90 %: {met} of 64 cases, probability 7" in row["text"]
    assert sum(row["counts"]) == 63
    assert max(row["counts"]) < 63
    assert row["ends"] == ["0.2 N·m", "0.6 N·m"]
    [free] = so_far(Findings(replace(plan, demands=()), found.cases, ()))
    assert free["text"].startswith("breakaway_apply: mean 0.4 N·m, standard deviation 0.1")
    assert so_far(replace(found, source=found.cases[:0])) == []
    assert so_far(replace(found, plan=replace(plan, design="grid"))) == []


def test_a_page_of_a_bench_simulates_nothing(monkeypatch):
    def refused(*_: Any, **__: Any) -> None:
        raise AssertionError("simulated")

    monkeypatch.setattr("bywire.simulation.run.simulate", refused)
    monkeypatch.setattr("bywire.bench.running.run_of", refused)
    stops = shown_bench(Path("repeated-stops"), "repeated-stops")
    assert len(stops.cases) == 2
    driven = shown_bench(Path("motor-open-loop"), "motor-open-loop")
    assert "[stimulus]" in driven.trouble
    page = bench_page(driven, Contents(), 1)
    assert "iframe" not in page
    assert 'data-task="replay"' in page
    assert '<select id="live-case"' in bench_page(stops, Contents(), 1)


def test_a_folder_is_listed_by_what_its_files_are(place):
    (place.root / "study.toml").write_text('bench = "b.toml"\n[vary]\n"motor.R_m" = "+-5 %"\n')
    (place.root / "map.toml").write_text("[columns]\n")
    (place.root / "campaign.toml").write_text('bench = "b.toml"\n[vary]\n[[criteria]]\n')
    (place.root / "life.toml").write_text('life = "wedge-pads"\n[vary]\n')
    (place.root / "broken.toml").write_text("[")
    result = place.root / "results" / "run-b-1"
    result.mkdir(parents=True)
    for name in "run.nc", "result.json", "report.html":
        (result / name).write_text("{}")
    (place.root / "rig.nc").write_text("x")
    there = contents(place)
    assert there.benches == {"b.toml": "seal-stribeck"}
    assert there.studies == {"study.toml": "b.toml"}
    assert there.campaigns == {"campaign.toml": "b.toml"}
    assert there.lives == {"life.toml": "wedge-pads"}
    assert there.results == ["results/run-b-1"]
    assert there.maps == ["map.toml"]
    assert there.reports == ["results/run-b-1/report.html"]
    assert there.measurements == ["rig.nc", "x.csv"]


def test_the_function_is_public():
    assert bywire.serve.__module__ == "bywire.server.serving"
