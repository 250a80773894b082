"""The report is one valid file that loads nothing, runs only its zoom and escapes all text."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections import Counter
from functools import partial
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from bywire.core.errors import FileError
from bywire.report.document import (
    Banner,
    Details,
    FigureBlock,
    Listing,
    Paragraph,
    Section,
    TableBlock,
)
from bywire.report.drawing import inline_figures
from bywire.report.page import page_html, write_page
from bywire.report.response_figures import Response, bode
from bywire.report.step_response import step_response
from bywire.report.tables import text_table
from bywire.report.time_traces import time_traces

step_figure = partial(step_response, variable="p_mc", set_point="p_ref")

HOSTILE = "\"><script>alert(1)</script><img src=http://evil.example/x onerror='y'>\x00\x1b\u202e&"
VOID = {"meta", "img", "br", "link", "input", "hr"}


class Checker(HTMLParser):
    """Collects tags, attributes and text, and reports tags that do not match."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.faults: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Record an opening tag."""
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Record a self-closing tag."""
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        """Compare a closing tag with the open one."""
        if not self.open or self.open.pop() != tag:
            self.faults.append(tag)

    def handle_data(self, data: str) -> None:
        """Collect text."""
        self.text += data


def parsed(html: str) -> Checker:
    checker = Checker()
    checker.feed(html)
    checker.close()
    return checker


@pytest.fixture(scope="module")
def page(recording: xr.Dataset) -> str:
    hertz = np.logspace(0, 2, 30)
    figures = [
        FigureBlock(step_figure(recording), "Pressure."),
        FigureBlock(bode([Response("plant", hertz, 1 / (1 + 1j * hertz))]), "Plant."),
    ]
    inputs = Details("Inputs", [Paragraph("As given."), TableBlock(text_table(["a"], [["b"]]))])
    return page_html(
        "Hard braking",
        "1.2 s at 20 μs",
        [
            Section("Outcome", [figures[0], TableBlock(text_table(["k"], [["v"]]), "Values.")]),
            Section("Plant", [figures[1]]),
            Section("Inputs", [Listing(["first point", "second point"]), inputs]),
        ],
        banner=Banner("all requirements hold", "good"),
    )


def test_page_is_valid(page: str) -> None:
    checker = parsed(page)
    assert page.startswith("<!DOCTYPE html>")
    assert (checker.open, checker.faults) == ([], [])
    ids = Counter(attributes["id"] for _, attributes in checker.tags if "id" in attributes)
    assert ids.most_common(1)[0][1] == 1
    needed = set(re.findall(r'(?:href="|url\()#([^")]+)', page))
    assert needed <= set(ids)


def test_page_says_what_it_was_given(page: str) -> None:
    checker = parsed(page)
    for text in (
        "Hard braking",
        "1.2 s at 20 μs",
        "✓ all requirements hold",
        "Figure 1. Pressure.",
        "Figure 2. Plant.",
        "Table 1. Values.",
        "As given.",
        "second point",
    ):
        assert text in checker.text
    tags = [tag for tag, _ in checker.tags]
    assert tags.count("svg") == 2
    assert tags.count("details") == 1
    assert "<ul>\n<li>first point</li>\n<li>second point</li>\n</ul>" in page
    assert '<a href="#section-2">Plant</a>' in page


def test_page_loads_nothing_and_runs_its_zoom_alone(page: str) -> None:
    checker = parsed(page)
    assert not {"link", "iframe", "object"} & {tag for tag, _ in checker.tags}
    (script,) = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"default-src 'none'; script-src 'sha256-{digest}';" in page
    assert "script" not in page_html("t", "s", [Section("Text", [Paragraph("no figure")])])
    for _, attributes in checker.tags:
        for name in ("src", "href", "xlink:href", "data", "srcset"):
            assert (attributes.get(name) or "#").startswith(("#", "data:image/png;base64,"))
        assert not [name for name in attributes if name.startswith("on")]
    assert "http://" not in page
    assert "https://" not in page
    assert "@import" not in page


def test_a_figure_says_where_its_axes_lie_and_what_they_span() -> None:
    figure = Figure()
    axes = figure.add_axes((0.1, 0.2, 0.5, 0.6))
    axes.set(xlim=(2.0, 4.0), ylim=(1.0, 1e3), yscale="log")
    (html,) = inline_figures([(figure, "axes")])
    said = parsed(html).tags[0][1]["data-axes"]
    assert json.loads(said or "") == [
        {"box": [0.1, 0.2, 0.6, 0.8], "x": [2.0, 4.0, False], "y": [1.0, 1e3, True]}
    ]


@pytest.mark.parametrize(("label", "unit"), [("time [ms]", 1e-3), ("time [s]", 1.0)])
def test_panels_say_that_they_are_over_time_and_in_which_unit(label: str, unit: float) -> None:
    figure = Figure()
    _, lower = figure.subplots(2, 1, sharex=True)
    for text, wanted in ((label, unit), ("frequency [Hz]", None)):
        lower.set_xlabel(text)
        said = parsed(inline_figures([(figure, "axes")])[0]).tags[0][1]["data-axes"]
        assert [each.get("t") for each in json.loads(said or "")] == [wanted, wanted]


def test_hostile_text_is_only_text(recording: xr.Dataset) -> None:
    hostile = recording.copy()
    hostile["p_mc"].attrs = {"units": "Pa", "long_name": HOSTILE}
    figure = FigureBlock(step_figure(hostile), HOSTILE)
    table = TableBlock(text_table([HOSTILE], [[HOSTILE]]), HOSTILE)
    texts = [Paragraph(HOSTILE), Listing([HOSTILE])]
    blocks = [figure, table, *texts, Details(HOSTILE, texts)]
    html = page_html(
        HOSTILE, HOSTILE, [Section(HOSTILE, blocks)] * 3, banner=Banner(HOSTILE, "bad")
    )
    checker = parsed(html)
    assert (checker.open, checker.faults) == ([], [])
    tags = [tag for tag, _ in checker.tags]
    assert (tags.count("script"), tags.count("img")) == (1, 0)
    assert not re.search(r"[\x00-\x09\x0b-\x1f\u202e]", html)
    assert "alert(1)" in checker.text


def test_the_same_report_gives_the_same_bytes(recording: xr.Dataset, tmp_path: Path) -> None:
    sections = [Section("Outcome", [FigureBlock(step_figure(recording), "Pressure.")])]
    first = write_page(tmp_path / "a.html", "t", "s", sections).read_bytes()
    assert write_page(tmp_path / "b.html", "t", "s", sections).read_bytes() == first


def test_a_minute_of_recording_makes_a_small_report(
    long_recording: xr.Dataset, tmp_path: Path
) -> None:
    blocks = [
        FigureBlock(time_traces(long_recording), "All."),
        FigureBlock(time_traces(long_recording, measured=long_recording), "Compared."),
    ]
    path = write_page(tmp_path / "report.html", "t", "s", [Section("Over time", blocks)])
    assert path.stat().st_size < 1_000_000


def test_figures_beyond_the_budget_become_pixels_largest_first(recording: xr.Dataset) -> None:
    """The large one is a cloud of points, which is always many times smaller as pixels."""
    cloud = Figure(figsize=(2.0, 1.0))
    x, y = np.random.default_rng(1).random((2, 5000))
    cloud.subplots().plot(x, y, ".")
    figures = [(step_response(recording, "p_mc"), "small"), (cloud, "large")]
    vector = inline_figures(figures)
    assert [html[:4] for html in vector] == ["<svg", "<svg"]
    mixed = inline_figures(figures, budget=sum(map(len, vector)) - 1)
    assert ["data:image/png" in html for html in mixed] == [False, True]
    assert 'aria-label="large"' in mixed[1]
    assert 'viewBox="0 0 320 160"' in mixed[1]
    assert mixed == inline_figures(figures, budget=sum(map(len, vector)) - 1)


def test_a_report_that_cannot_be_written_is_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(FileError, match="cannot write"):
        write_page(tmp_path / "file" / "report.html", "t", "s", [])
