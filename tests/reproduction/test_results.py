"""A made-up reproduction as JSON, table and folder."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from bywire.core.errors import FileError, UnknownNameError
from bywire.data.netcdf import read_recording
from bywire.report.tables import text_table
from bywire.report.terminal import terminal_text
from bywire.reproduction.item import SHARE, Allowance, Fact, RootCause, compared, found
from bywire.reproduction.reproduction import (
    SOURCES,
    Exhibit,
    Part,
    Reproduction,
    Tally,
    tallies,
    verdicts,
)
from raising import raises

KEYS = ["id", "unit", "stated", "computed", "tolerance", "agrees", "note"]


@pytest.fixture
def made_up() -> Reproduction:
    figure = Figure(figsize=(4.0, 2.0))
    figure.subplots().plot([0, 1], [0, 1])
    recording = xr.Dataset(
        {"p_mc": ("time", np.arange(3.0), {"units": "Pa"})}, coords={"time": np.arange(3.0)}
    )
    items = (
        compared("t.K", Fact(10.1, "bar/A", "Table 2"), 7.6, 0.05),
        compared("t.n", Fact(1.0, "1", "Table <2>"), math.nan, "<="),
        found("t.x", "s", math.inf, "ours"),
    )
    part = Part(
        "Table 2",
        "text",
        items,
        (Exhibit("fig", figure, "A figure."),),
        {"run/1 a": recording},
        {"More": text_table(("a",), [("b",)])},
    )
    return Reproduction(
        "made-up",
        "Nobody, 2010",
        (part,),
        (RootCause("Tables differ.", ("t.K*",)),),
        (Allowance("gains", 0.05, SHARE, "two digits"), Allowance("time", 0.1, "s", "a guess")),
        {"": "The set"},
    )


def test_json_has_the_promised_keys_and_no_nan(made_up: Reproduction) -> None:
    content = made_up.as_object()
    assert list(content) == ["source", "items", "in_short"]
    assert all(list(item) == KEYS for item in content["items"])
    json.dumps(content, allow_nan=False)
    assert [item["computed"] for item in content["items"]] == [7.6, None, None]
    assert [item["agrees"] for item in content["items"]] == [False, False, None]
    assert content["items"][1]["tolerance"] == "<="
    assert content["items"][0]["note"] == "Table 2; kind: printed"
    assert content["items"][2]["note"] == "ours; kind: ours"


def test_a_figure_is_drawn_where_it_is_shown_alone(tmp_path: Path) -> None:
    drawn: list[str] = []

    def draw() -> Figure:
        drawn.append("fig")
        return Figure(figsize=(4.0, 2.0))

    part = Part("Table 2", "text", (), (Exhibit("fig", draw, "A figure."),))
    source = Reproduction("made-up", "Nobody, 2010", (part,))
    source.as_object()
    str(source)
    assert drawn == []
    source.write(tmp_path)
    assert drawn == ["fig"]


def test_table_has_a_row_per_item(made_up: Reproduction) -> None:
    assert [row[0].text for row in verdicts(made_up.items).rows] == ["t.K", "t.n", "t.x"]


def test_verdicts_are_counted_for_each_parameter_set() -> None:
    fact = Fact(1.0, "1", "Table 1")
    items = [
        compared("a", fact, 1.0, 0.1),
        compared("b@other", fact, 2.0, 0.1),
        found("c", "1", 1.0, ""),
    ]
    assert tallies(items) == {"": Tally(1, 0, 1), "other": Tally(0, 1, 0)}


@pytest.mark.parametrize("width", [50, 80, 200])
def test_terminal_shows_contradictions_then_causes_counts_and_the_report(
    made_up: Reproduction, width: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    lines = str(made_up).splitlines()
    assert lines[0].startswith("bywire contradicts the paper: 2 of 2 ")
    assert lines[1].startswith("The paper contradicts itself: 0 of 2 ")
    assert max(map(len, lines[:-2])) <= width + 8
    assert lines[-2].endswith("bywire reproduce made-up --out FOLDER")
    assert lines[-1].startswith("verdict: ")
    rest = " ".join(lines)
    assert "- Tables differ. [1 disagreement]" in rest
    assert "- The set: 0 agree, 2 disagree," in rest


def test_folder_is_complete_and_self_contained(made_up: Reproduction, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    paths = made_up.write(folder)
    assert [p.name for p in paths] == ["run-1-a.nc", "fig.png", "report.html", "results.json"]
    assert sorted(p.name for p in folder.iterdir()) == sorted(p.name for p in paths)
    html = paths[2].read_text(encoding="utf-8")
    assert "0 agree, 2 disagree, 1 without verdict" in html
    assert "Tables differ. [1 disagreement]" in html
    for text in ("5 % of the stated value", "100 ms", "two digits", "&lt;= 1", "printed"):
        assert text in html
    assert "Table &lt;2&gt;" in html
    assert "<svg" in html
    assert html.count("<script") == 1  # the one that zooms figures
    results = json.loads(paths[3].read_text())
    assert results.pop("files") == [str(path) for path in paths]
    assert results == made_up.as_object()
    np.testing.assert_array_equal(read_recording(paths[0])["p_mc"], [0.0, 1.0, 2.0])


def test_folder_that_cannot_be_made_is_one_clear_error(
    made_up: Reproduction, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    with raises(FileError, name=str(tmp_path / "file")):
        made_up.write(tmp_path / "file" / "folder")


def test_sources_are_found_by_name() -> None:
    assert SOURCES.find("dardanelli2010").summary
    assert set(SOURCES.all()) >= {"dardanelli2010"}
    with pytest.raises(UnknownNameError, match="dardanelli2010"):
        SOURCES.find("dardaneli2010")


def test_a_parts_own_table_takes_the_place_of_its_verdicts(
    made_up: Reproduction, tmp_path: Path
) -> None:
    (part,) = made_up.parts
    own = replace(part, title="Own", tables={"Side by side": text_table(("here",), [("there",)])})
    both = replace(made_up, parts=(replace(part, items=part.items[:1]), own))
    brief = terminal_text(both.document(), verbose=True)
    assert brief.index("t.K") < brief.index("Side by side") < brief.index("there")
    assert brief.count("t.n") == 1  # a disagreement without a known cause
    both.write(tmp_path)
    assert "Side by side" in (tmp_path / "report.html").read_text(encoding="utf-8")
