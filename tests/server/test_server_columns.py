"""Columns of a measurement, with units to choose from and a first plot."""

from __future__ import annotations

import os

import numpy as np
import pytest

from bywire.core.unit_list import meanings_of, units_by_symbol
from bywire.server import columns
from bywire.server.columns import choosable, shown_columns
from bywire.server.place import Place
from bywire.server.task import tasks

posix = pytest.mark.skipif(os.name != "posix", reason="processes of POSIX")
RIG = "Zeit;Demand;p_pd;Temp [degC]\n" + "".join(
    f"{k};{k % 7};{k / 2:g};{20 + k}\n" for k in range(1000)
)


@pytest.fixture
def rig(visit):
    (visit.folder / "rig.csv").write_text(RIG)
    return "rig.csv"


def test_columns_come_with_units_signals_and_curves(visit, rig):
    said = visit("GET", f"/api/columns?file={rig}&bench=hard-braking").object
    assert said["clock"] == "Zeit"  # no usual name, but the first column that increases
    by_name = {each["name"]: each for each in said["columns"]}
    assert {name: each["unit"] for name, each in by_name.items()} == {
        "Zeit": "",
        "Demand": "",
        "p_pd": "",
        "Temp": "degC",
    }
    demand = by_name["Demand"]
    assert (min(demand["low"]), max(demand["high"]), demand["length"]) == (0.0, 6.0, 1000)
    assert len(demand["first"]) == len(demand["low"]) + 1
    assert {"name": "p_set", "label": "pressure demand", "symbol": "Pa"} in said["inputs"]
    names = {each["name"] for each in said["outputs"]}
    assert "p_pd" in names
    assert "E_copper" not in names
    assert said["units"]["Pa"][0] == "bar"


def test_a_method_names_its_signals(visit, rig):
    said = visit("GET", f"/api/columns?file={rig}&method=linear-regression").object
    assert said["inputs"] == []
    said = visit("GET", f"/api/columns?file={rig}&bench=bad.toml").object
    assert said["outputs"] == []  # the form shows the bench's error


@pytest.mark.parametrize(
    ("query", "status"),
    [
        ("file=../secret.csv", 404),
        ("file=out.csv", 404),
        ("file=.hidden.toml", 404),
        ("file=page.html", 415),
        ("file=", 404),
        ("file=rig.csv&bench=../x.toml", 404),
        ("file=rig.csv&bench=hard-brakin", 400),
    ],
)
@pytest.mark.usefixtures("rig")
def test_only_measurements_of_the_folder_are_read(visit, query, status):
    assert visit("GET", f"/api/columns?{query}").status == status


def test_a_file_that_cannot_be_read_is_one_error(visit):
    (visit.folder / "broken.csv").write_bytes(b"")
    answer = visit("GET", "/api/columns?file=broken.csv")
    assert answer.status == 400
    assert answer.object["error"].startswith("broken.csv is empty")


def test_a_large_table_is_read_in_part(tmp_path, monkeypatch):
    monkeypatch.setattr(columns, "_LARGEST_TEXT", 5_003)
    (tmp_path / "rig.csv").write_text(RIG)
    said = shown_columns(Place(tmp_path), tmp_path / "rig.csv")
    assert said["notes"][0].startswith("The plot shows the first")
    length = RIG[:5_003].count("\n") - 1
    assert {each["length"] for each in said["columns"]} == {length}
    assert [path.name for path in tmp_path.iterdir()] == ["rig.csv"]


def test_points_keep_extremes_and_gaps():
    values = np.sin(np.linspace(0.0, 500.0, 100_000))
    values[50_000:60_000] = np.nan
    values[777] = 9.0
    points = columns._points(values)
    assert max(value for value in points["high"] if value == value) == 9.0
    assert sum(value != value for value in points["low"]) == pytest.approx(40, abs=2)
    assert columns._points(np.array([])) == {"low": [], "high": [], "first": []}


def test_units_to_choose_from_are_those_that_files_may_state():
    for symbol in units_by_symbol():
        powers = meanings_of(symbol)[0].powers
        for unit in choosable(symbol):
            assert any(each.powers == powers for each in meanings_of(unit)), unit


@pytest.mark.parametrize(
    ("task", "field", "example"),
    [
        ("replay", "input", "p_set=Demand [bar]"),
        ("replay", "tolerance", "nrmse <= 5 %"),
        ("replay", "track", "mu_B"),
        ("identify", "output", "p_mc=Pressure [psi] +- 0.02 bar"),
        ("margins", "at", "20 bar"),
        ("run", "set", "motor.R_m=0.4ohm"),
    ],
)
def test_fields_show_the_example_of_the_help(task, field, example):
    shown = {each.name: each.example for each in tasks()[task].fields}
    assert shown[field] == example


USE = "[aria-label='use of {}']"
UNIT = "[aria-label='unit of {}']"


def replays(visit):
    return [job for job in visit.server.service.jobs.all() if job.task.name == "replay"]


@posix
@pytest.mark.usefixtures("standin")
def test_a_dropped_file_shows_its_columns_and_fills_the_form_in(visit, chromium, tmp_path):
    page, noise = chromium.new_page(), []
    page.on("pageerror", lambda error: noise.append(str(error)))
    (tmp_path / "dropped.csv").write_text(RIG)
    page.goto(visit.server.link)
    (visit.folder / "hard.toml").write_text(
        'experiment = "hard-braking"\nparameters = "dardanelli2010"\n'
    )
    page.goto(f"{page.url}bench?of=hard.toml")
    page.evaluate("() => document.querySelector('#live').remove()")
    assert page.get_attribute("#replay-input", "placeholder") == "p_set=Demand [bar]"
    page.set_input_files("form[data-task=replay] .upload", tmp_path / "dropped.csv")
    page.wait_for_selector(".columns table")
    assert page.locator(".columns svg").count() == 4
    assert page.input_value("#replay-output") == "p_pd"  # of the same name
    page.select_option(UNIT.format("Zeit"), "ms")
    page.select_option(USE.format("Demand"), "input p_set")
    page.click("form[data-task=replay] button[type=submit]")  # the browser asks for the units
    assert not replays(visit)
    page.select_option(UNIT.format("Demand"), "bar")
    page.select_option(UNIT.format("p_pd"), "MPa")
    assert page.input_value("#replay-input") == "p_set=Demand [bar]"
    assert page.input_value("#replay-output") == "p_pd=p_pd [MPa]"
    assert page.input_value("#replay-time") == "Zeit [ms]"
    assert "Zeit, 0 to 999 ms" in page.inner_text(".columns caption")
    page.select_option(USE.format("Temp"), "output p_pd")  # a signal has one column
    assert page.input_value("#replay-output") == "p_pd=Temp"
    page.click("form[data-task=replay] button[type=submit]")
    page.wait_for_selector("#jobs li:has-text('Replay')")
    (job,) = replays(visit)
    assert job.asked["input"] == {"p_set": "Demand [bar]"}
    visit("POST", f"/api/jobs/{job.number}/cancel", {})
    assert noise == []
    page.close()
