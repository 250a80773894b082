"""Forms show the same messages as commands, each next to its field."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from bywire.campaigns import running
from bywire.core.errors import RunError, UnknownNameError
from bywire.server import job_process
from bywire.server.contents import Contents, contents
from bywire.server.exchange import RefusedError
from bywire.server.pages import form
from bywire.server.place import Place
from bywire.server.task import Task, tasks
from undrawn import drawn, undrawn_unless_asked

__all__ = ["drawn", "undrawn_unless_asked"]

CAMPAIGN = """
bench = "hard-braking"
[set]
"options.p_from" = "36 bar"
"options.p_to" = "37 bar"
"options.settle" = "0.1 s"
"options.duration" = "0.5 s"
[campaign]
only = ["battery.lost", "motor.hot", "ecu.frozen"]
onset = "0.4 s"
healthy = 4
[[criteria]]
name = "loss"
signal = "p_pd"
below_share = "80 %"
lasting = "20 ms"
"""

PROCEDURE = """
procedure = "Stops"
experiment = "straight-stop"
v_max = "200 km/h"
[[stops]]
name = "cold"
speed = "60 km/h"
"""


@pytest.fixture(scope="module")
def folder(visit) -> None:
    """Write files of each kind to the served folder."""
    (visit.folder / "small.toml").write_text(CAMPAIGN)
    (visit.folder / "wrong.toml").write_text(CAMPAIGN.replace('"motor.hot"', '"motor.hott"'))
    (visit.folder / "pads.toml").write_text('life = "wedge-pads"\n[vary]\n"stop.gap" = "+-5 %"\n')
    (visit.folder / "stops.toml").write_text(PROCEDURE)
    (visit.folder / "aside").mkdir(exist_ok=True)


LOOP = {"loop": "pressure"}
BAD = [
    ("run", {"bench": "hard-brakin"}, "bench", "hard-braking"),
    ("run", {"bench": "hard-braking", "set": "motor.R_mm=1 ohm"}, "set", "motor.R_m"),
    ("run", {"bench": "hard-braking", "set": "motor.R_m"}, "set", "KEY=VALUE"),
    ("run", {"bench": "hard-braking", "fault": "motor.hott"}, "fault", "motor.hot"),
    (
        "replay",
        {"bench": "hard-braking", "measurement": "curve.toml", "set": "options.x=1"},
        "set",
        "unknown",
    ),
    ("faults", {"campaign": ""}, "campaign", "is required"),
    ("faults", {"campaign": "motorcycl"}, "campaign", "motorcycle"),
    ("faults", {"campaign": "wrong.toml"}, "campaign", "motor.hot"),
    ("faults", {"campaign": "curve.toml"}, "campaign", "this is a bench, not"),
    ("faults", {"campaign": "small.toml", "set": "motor.R_m=1 bar"}, "set", "unit"),
    ("life", {"life": "wedge-pad"}, "life", "wedge-pads"),
    ("life", {"life": "pads.toml"}, "life", "stop.gap"),
    ("life", {"life": "wedge-pads", "check": "-1"}, "check", "whole number >= 0"),
    ("life", {"life": "two-wheeler-pads", "check": "1"}, "check", "it must be 0 or >="),
    ("life", {"life": "wedge-pads", "set": "wear.x=1"}, "set", "unknown"),
    ("procedure", {"procedure": "stops.toml"}, "procedure", "has no limit"),
    ("procedure", {"procedure": "pads.toml"}, "procedure", "bywire life"),
    ("compare", {"runs": "curve.toml"}, "runs", "at least two"),
    ("compare", {"runs": "curve.toml\naside"}, "runs", "not a complete result"),
    ("compare", {"runs": "curve.toml\nseal-stribek"}, "runs", "seal-stribeck"),
    ("compare", {"runs": "curve.toml\nseal-stribeck", "set": "motor.x=1"}, "set", "motor.x"),
    (
        "compare",
        {"runs": "curve.toml\nseal-stribeck", "error_estimate": "yes"},
        "error_estimate",
        "true or false",
    ),
    ("size", {"name": "drive-trains"}, "name", "drive-train"),
    ("size", {"name": "drive-train", "parameters": "roberts"}, "parameters", "roberts2003"),
    (
        "size",
        {"name": "drive-train", "parameters": "dardanelli2010"},
        "parameters",
        "Choose another parameter set",
    ),
    ("size", {"name": "drive-train", "set": "t_9=1 s"}, "set", "unknown option"),
    ("margins", {"loop": "pressur"}, "loop", "pressure"),
    (
        "margins",
        {**LOOP, "parameters": "roberts2003"},
        "parameters",
        "Choose another parameter set",
    ),
    ("margins", {**LOOP, "at": "20 A"}, "at", "unit"),
    ("margins", {**LOOP, "set": "motor.R_m=-1 ohm"}, "set", "motor.R_m"),
    ("margins", {**LOOP, "over": "motor.R_m"}, "over", "LOW:HIGH:COUNT"),
    ("linearize", {"loop": "pressures"}, "loop", "pressure"),
    ("linearize", {**LOOP, "friction": "stuck"}, "friction", "applies only to plants"),
    ("linearize", {**LOOP, "at": "20"}, "at", "unit"),
    ("linearize", {"loop": "wedge-plant", "friction": "gone"}, "friction", "removed"),
    ("linearize", {"loop": "wedge-plant", "friction": "sliding"}, "friction", "speed"),
    ("linearize", {"loop": "wedge-plant", "speed": "5 rad/s"}, "speed", "sliding"),
    ("linearize", {"loop": "wedge-plant", "locus": "x=1:2:3"}, "locus", "unknown parameter"),
    ("frequency-response", {**LOOP, "excitation": "sinus"}, "excitation", "sine"),
    ("frequency-response", {**LOOP, "frequencies": "1 bar"}, "frequencies", "unit"),
    ("frequency-response", {**LOOP, "amplitudes": "1 Hz"}, "amplitudes", "unit"),
    ("agreement", {**LOOP, "amplitudes": "2 bar, 1 bar"}, "amplitudes", "the small one first"),
    ("reproduce", {"source": "roberts203"}, "source", "roberts2003"),
    ("identify", {"method": "m"}, "method", "unknown"),
    ("design", {**LOOP, "parameters": "roberts2003"}, "parameters", "Choose another parameter set"),
]


@pytest.mark.parametrize(("task", "given", "field", "text"), BAD)
@pytest.mark.usefixtures("folder", "standin")
def test_what_does_not_fit_stands_beside_its_field(visit, task, given, field, text):
    answer = visit.begin(task, **given)
    assert answer.status == 422
    assert answer.object["field"] == field
    assert text in answer.object["error"]
    assert "\n" not in answer.object["error"].strip()
    assert visit("GET", "/api/jobs").object["jobs"] == []


@pytest.mark.parametrize(
    ("task", "field"),
    [
        ("faults", "campaign"),
        ("life", "life"),
        ("procedure", "procedure"),
        ("compare", "runs"),
        ("run", "bench"),
        ("identify", "map"),
        ("study", "study"),
    ],
)
def test_no_thing_leads_out_of_the_folder(visit, task, field):
    others = {"method": "m"} if task == "identify" else {}
    outside = "../outside/secret.csv", "/etc/passwd", "/no/such", "way/secret.csv", ".hidden.toml"
    for path in outside:
        answer = visit.begin(task, **{field: path, **others})
        assert answer.status in (404, 422)
        assert "secret" not in answer.object["error"].replace("secret.csv", "")
    # A link that has an experiment's name, and leads to another user's results.
    link = visit.folder / "seal-stribeck"
    link.symlink_to(visit.folder.parent)
    try:
        assert visit.begin("compare", runs="curve.toml\nseal-stribeck").status == 404
    finally:
        link.unlink()


@pytest.mark.usefixtures("folder")
def test_pages_of_tasks_are_found_and_begin_as_the_link_says(visit):
    start = visit("GET", "/").body.decode()
    for name, task in tasks().items():
        page = visit("GET", f"/task/{name}")
        assert (f'href="/task/{name}"' in start) == task.form.is_listed == (page.status == 200)
    assert 'href="/task/faults?campaign=small.toml"' in start
    assert 'href="/task/life?life=pads.toml"' in start
    page = visit("GET", "/task/faults?campaign=small.toml").body.decode()
    assert '<option value="small.toml" selected>' in page
    assert '<option value="motorcycle">' in page
    page = visit("GET", '/task/margins?over="><script>').body.decode()
    assert 'value="&quot;&gt;&lt;script&gt;"' in page
    bench = visit("GET", "/bench?of=curve.toml").body.decode()
    assert 'href="/task/compare?runs=curve.toml"' in bench


def test_every_field_has_a_label_and_says_its_hint():
    for task in tasks().values():
        text = form(task, Contents(), {})
        for field in task.fields:
            name = f"{task.name}-{field.name}"
            assert f'<label for="{name}">' in text
            assert f' id="{name}" ' in text
            assert not field.hint or f'aria-describedby="{name}-hint"' in text
        assert text.count('type="submit" disabled') == 1


GOOD = [
    ("run", {"bench": "hard-braking", "set": "motor.R_m=1 ohm", "fault": "pressure.stuck=1 bar"}),
    ("faults", {"campaign": "two-wheeler", "set": "front.disc.mu_pad=0.4"}),
    ("life", {"life": "two-wheeler-pads", "check": "20", "set": "stop.pause=60 s"}),
    ("compare", {"runs": "curve.toml\nhard-braking", "set": "motor.R_m=0.4 ohm"}),
    ("size", {"name": "drive-train", "set": "t_90=120ms"}),
    (
        "linearize",
        {
            "loop": "wedge-plant",
            "friction": "sliding",
            "speed": "5 rad/s",
            "locus": "motor_1.R_ref=0.1ohm:1ohm:3",
        },
    ),
    (
        "frequency-response",
        {
            **LOOP,
            "at": "20 bar",
            "frequencies": "1 Hz:9 Hz:3",
            "amplitudes": "1 bar",
            "over": "motor.R_m=0.2ohm:0.6ohm:5",
        },
    ),
    ("agreement", {**LOOP, "amplitudes": "1 bar, 2 bar"}),
    ("design", {**LOOP, "set": "motor.R_m=0.4 ohm"}),
]


@pytest.mark.parametrize(("task", "given"), GOOD)
def test_what_fits_is_taken_and_tried_out_without_a_simulation(visit, monkeypatch, task, given):
    def refused(*_: Any, **__: Any) -> None:
        raise AssertionError("simulated")

    for place in "simulation.run.simulate", "bench.running.run_of", "bench.running.run":
        monkeypatch.setattr(f"bywire.{place}", refused)
    asked = tasks()[task].read(given, visit.server.service.place)
    assert set(given) <= {name for name, value in asked.items() if value}


def test_unknown_fields_are_no_field_s(visit):
    task, place = tasks()["identify"], Place(visit.folder)
    with pytest.raises(UnknownNameError, match="metod"):
        task.read({"metod": "x"}, place)
    for given, field in ({"method": 1}, "method"), ({"method": "fit", "starts": "0"}, "method"):
        with pytest.raises(RefusedError) as refused:
            task.read(given, place)
        assert refused.value.field == field


def computed(visit, task: Task, asked: dict[str, Any], out: Path) -> dict[str, Any]:
    """Run a job's request in this process, and return the final message."""
    told: list[dict[str, Any]] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(visit.folder)
        patch.setattr(job_process, "tell", lambda **said: told.append(said))
        job_process._compute(
            {
                "task": task.name,
                "asked": asked,
                "folder": str(visit.folder),
                "out": str(out),
                "systems": [],
            }
        )
    return told[-1]["done"]


@pytest.mark.usefixtures("folder")
def test_a_campaign_goes_on_fault_by_fault_and_another_goes_elsewhere(visit, monkeypatch):
    place, jobs, task = visit.server.service.place, visit.server.service.jobs, tasks()["faults"]
    asked = task.read({"campaign": "small.toml"}, place)
    assert jobs.begun(task, asked) is None
    out = place.fresh_folder("faults-small")
    judge, judged = running.judge_fault, []

    def ended(plan, failing, healthy):
        if len(judged) == 2:
            raise RunError("seeded")
        judged.append(failing.name)
        return judge(plan, failing, healthy)

    monkeypatch.setattr(os, "cpu_count", lambda: 1)  # one thread, so faults run one after another
    monkeypatch.setattr(running, "judge_fault", ended)
    with pytest.raises(RunError, match="seeded"):
        computed(visit, task, asked, out)
    kept = {path: path.read_bytes() for path in (out / "faults").iterdir()}
    assert len(kept) == 2
    # The same request continues in its folder. A changed request starts in a new folder.
    assert jobs.begun(task, asked) == out
    assert jobs.begun(task, {**asked, "set": {"motor.R_m": "0.4 ohm"}}) is None
    monkeypatch.setattr(
        running, "judge_fault", lambda *given: judged.append("again") or judge(*given)
    )
    done = computed(visit, task, asked, out)
    assert judged.count("again") == 1
    assert {path: path.read_bytes() for path in kept} == kept
    assert (out / done["page"]).is_file()
    (visit.folder / "small.toml").write_text(CAMPAIGN.replace("healthy = 4", "healthy = 6"))
    assert jobs.begun(task, asked) is None


@pytest.mark.usefixtures("folder", "standin")
def test_what_is_asked_twice_is_computed_once(visit):
    first = visit.begin("faults", campaign="motorcycle")
    assert first.status == 201
    again = visit.begin("faults", campaign="motorcycle")
    assert again.status == 409
    assert "already computing motorcycle" in again.object["error"]
    visit("POST", f"/api/jobs/{first.object['number']}/cancel", {})
    assert visit.ended(first.object["number"])["state"] == "canceled"


def test_earlier_runs_are_compared(visit):
    place, run, compare = visit.server.service.place, tasks()["run"], tasks()["compare"]
    out = place.fresh_folder("run-curve")
    computed(visit, run, run.read({"bench": "curve.toml"}, place), out)
    assert contents(place).results == [place.named(out)]
    asked = compare.read({"runs": f"{place.named(out)}\ncurve.toml"}, place)
    assert compare.stem(asked) == f"{out.name}-curve"
    done = computed(visit, compare, asked, place.fresh_folder("compare"))
    assert done["page"] == "report.html"
    with pytest.raises(RefusedError, match="would have no effect"):
        compare.read({"runs": f"{place.named(out)}\n" * 2, "set": "motor.R_m=1 ohm"}, place)
