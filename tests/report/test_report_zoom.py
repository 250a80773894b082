"""Zoom of figures in a real browser: only time in panels over time, both axes elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import xarray as xr

from bywire.report.document import FigureBlock, Section, TableBlock
from bywire.report.page import write_page
from bywire.report.panels import Panel, Trace
from bywire.report.response_figures import Response, bode
from bywire.report.tables import Cell, Column, Table
from bywire.report.time_traces import time_traces

JUMP = 0.5  # s, time of the jump, whose position on the screen locates this time
FRAME = 18  # px, border and padding of a figure
SEEN = """() => [...document.querySelectorAll(".zoom svg")].map((svg) => {
  const { a, d, e, f } = svg.getScreenCTM();
  const viewBox = svg.getAttribute("viewBox").split(" ").map(Number), [, , w, h] = viewBox;
  const boxes = JSON.parse(svg.dataset.axes).map(({ box: [left, bottom, right, top] }) => ({
    left: e + a * w * left, right: e + a * w * right,
    top: f + d * h * (1 - top), bottom: f + d * h * (1 - bottom) }));
  const jumps = [...svg.querySelectorAll("path")].flatMap((path) => {
    const points = [...path.getAttribute("d").matchAll(/[ML] (\\S+) (\\S+)/g)]
      .map(([, x, y]) => new DOMPoint(x, y));
    const k = points.length < 6 ? -1
      : points.findIndex(({ y }, k) => k && Math.abs(y - points[k - 1].y) > 30);
    const { height } = path.getBoundingClientRect();
    return k < 0 ? [] : [{ x: points[k].matrixTransform(path.getScreenCTM()).x, height }];
  });
  const ticks = [...svg.querySelectorAll("text")].flatMap((text) => {
    const { left, right, top } = text.getBoundingClientRect();
    const isTick = top > boxes.at(-1).bottom && text.style.display !== "none"
      && /^[.\\d]+$/.test(text.textContent);
    return isTick ? [[Number(text.textContent), (left + right) / 2]] : [];
  });
  return { boxes, jumps, ticks, viewBox };
})"""


def _step(unit_of_time: float) -> xr.Dataset:
    t = np.linspace(0.0, unit_of_time, 2001)
    high = (t >= JUMP * unit_of_time).astype(float)
    return xr.Dataset(
        {"p": ("time", 1e5 * high, {"units": "Pa"}), "i": ("time", 1.0 - high, {"units": "A"})},
        coords={"time": t},
    )


@pytest.fixture(scope="module")
def page(chromium: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    panels = (Panel("pressure", (Trace("p"),)), Panel("current", (Trace("i"),)))
    f = np.geomspace(1.0, 100.0, 50)
    figures = [
        time_traces(_step(1.0), panels=panels),
        time_traces(_step(1.0), panels=panels[:1]),
        time_traces(_step(0.1), panels=panels[:1]),
        bode([Response("lag", f, 1.0 / (1.0 + 1j * f))]),
    ]
    blocks = [FigureBlock(figure, "A figure.") for figure in figures]
    path = tmp_path_factory.mktemp("zoom") / "report.html"
    file = write_page(path, "Zoom", "", [Section("Figures", blocks)])
    opened = chromium.new_page(viewport={"width": 1100, "height": 2400})
    opened.noise = []
    opened.on("console", lambda said: opened.noise.append(said.text))
    opened.on("pageerror", lambda error: opened.noise.append(str(error)))
    opened.goto(file.as_uri())
    yield opened
    assert opened.noise == []
    opened.close()


@pytest.fixture
def seen(page: Any) -> Iterator[Any]:
    """Return the state of all figures; reset the zoom at the end."""
    yield lambda: page.evaluate(SEEN)
    for k in range(4):
        page.locator(".zoom").nth(k).focus()
        page.keyboard.press("Escape")


def drag(page: Any, box: dict[str, float], *ends: tuple[float, float]) -> None:
    """Drag between two positions, as fractions of a panel."""
    width, height = box["right"] - box["left"], box["bottom"] - box["top"]
    for k, (x, y) in enumerate(ends):
        page.mouse.move(box["left"] + x * width, box["top"] + y * height, steps=3)
        (page.mouse.up if k else page.mouse.down)()


def times(figure: dict[str, Any]) -> tuple[float, float]:
    """Return the times at the ends of a figure's panels from its ticks."""
    values, places = zip(*figure["ticks"], strict=True)
    slope, offset = np.polyfit(places, values, 1)
    box = figure["boxes"][0]
    return slope * box["left"] + offset, slope * box["right"] + offset


def test_a_drag_across_a_panel_zooms_time_alone_in_all_panels_over_time(page, seen):
    before = seen()
    drag(page, before[0]["boxes"][1], (0.4, 0.5), (0.65, 0.6))
    after = seen()
    for was, now in zip(before[:2], after[:2], strict=True):
        assert times(now) == pytest.approx((0.4, 0.65), abs=3e-3)
        assert len(now["ticks"]) >= 4
        assert now["viewBox"] == was["viewBox"]
        for old, new in zip(was["jumps"], now["jumps"], strict=True):
            box = now["boxes"][0]
            place = box["left"] + (JUMP - 0.4) / 0.25 * (box["right"] - box["left"])
            assert new["x"] == pytest.approx(place, abs=5.0)  # a pixel of the drag is four here
            assert new["height"] == pytest.approx(old["height"], abs=2.0)
    assert after[2:] == before[2:]  # one ends before that time, the others have no time axis
    drag(page, after[0]["boxes"][0], (0.9, 0.5), (0.5, 0.5))  # again, to the left
    assert times(seen()[1]) == pytest.approx((0.525, 0.625), abs=3e-3)


def test_milliseconds_and_seconds_are_one_time_and_a_double_click_shows_all(page, seen):
    before = seen()
    drag(page, before[2]["boxes"][0], (0.2, 0.5), (0.8, 0.5))
    after = seen()
    assert times(after[2]) == pytest.approx((20.0, 80.0), abs=0.3)
    assert times(after[0]) == pytest.approx((0.02, 0.08), abs=3e-4)
    page.mouse.dblclick(before[0]["boxes"][0]["left"] + 50, before[0]["boxes"][0]["top"] + 50)
    assert seen() == before


def test_the_corner_reads_the_time_that_is_shown_and_arrows_move_on(page, seen):
    box = seen()[0]["boxes"][0]
    drag(page, box, (0.4, 0.5), (0.6, 0.5))
    page.mouse.move(0.5 * (box["left"] + box["right"]), box["top"] + 20)
    read = page.locator(".zoom-here").first.text_content()
    assert float(read.split()[1].rstrip(",")) == pytest.approx(0.5, abs=3e-3)
    page.locator(".zoom").first.focus()
    page.keyboard.press("ArrowRight")
    assert times(seen()[1]) == pytest.approx((0.44, 0.64), abs=3e-3)


def test_other_drags_show_a_part_of_the_figure_in_its_proportions(page, seen):
    before = seen()
    for figure, end in ((1, (0.4, 0.9)), (3, (0.7, 0.1))):  # down; across a panel over frequency
        box = before[figure]["boxes"][0]
        whole = page.locator(".zoom svg").nth(figure).bounding_box()
        drag(page, box, (0.3, 0.1), end)
        now = seen()
        share = [now[figure]["viewBox"][k] / before[figure]["viewBox"][k] for k in (2, 3)]
        wanted = max(
            (end[0] - 0.3) * (box["right"] - box["left"]) / (whole["width"] - FRAME),
            (end[1] - 0.1) * (box["bottom"] - box["top"]) / (whole["height"] - FRAME),
        )
        assert share == pytest.approx([wanted, wanted], rel=0.05)
        assert now[0] == before[0]  # time is unchanged
    page.locator(".zoom").nth(1).focus()
    page.keyboard.press("0")
    assert seen()[1] == before[1]


def test_wheel_and_buttons_zoom_a_figure(page, seen):
    before, place = seen()[0], page.locator(".zoom").first
    place.hover()
    page.mouse.wheel(0, -300)
    assert seen()[0] == before  # without focus on the figure, the page scrolls
    place.focus()
    place.hover()
    page.mouse.wheel(0, -300)
    width = "document.querySelector('.zoom svg').viewBox.baseVal.width"
    page.wait_for_function(f"() => {width} < {before['viewBox'][2]}")
    figure = page.locator("figure").first
    figure.locator("button[title='Whole figure']").click()
    assert seen()[0]["viewBox"] == before["viewBox"]
    figure.locator("button[title='Zoom in']").click()
    assert seen()[0]["viewBox"][2] == pytest.approx(0.5 * before["viewBox"][2])


def test_buttons_cover_nothing_of_a_figure(page):
    page.locator(".zoom").first.hover()
    for figure in page.locator("figure").all():
        drawn = figure.locator("svg").bounding_box()
        for button in figure.locator("button").all():
            assert button.bounding_box()["y"] >= drawn["y"] + drawn["height"]


def test_a_table_of_seven_columns_of_figures_fits_a_window_of_1000_px(chromium, tmp_path):
    heads = ("the bench itself", "5 %", "median", "95 %", "least", "largest")
    columns = (Column("name"), *(Column(head, numeric=True) for head in heads))
    row = tuple(Cell(text) for text in ("excess_slip_time_front", *["0.0008643 rad"] * 6))
    block = TableBlock(Table(columns, (row,)))
    file = write_page(tmp_path / "report.html", "Table", "", [Section("Key figures", [block])])
    opened = chromium.new_page(viewport={"width": 1000, "height": 800})
    opened.goto(file.as_uri())
    widths = "e => [e.scrollWidth, e.clientWidth]"
    table, window = opened.locator(".scroll").evaluate(widths)
    opened.close()
    assert table <= window
