"""Values stated by a source, in figures and tables: levels are lines, ranges are bands."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.patches import Rectangle

from bywire.bench.stated import StatedFigure, StatedLevel, StatedRange
from bywire.report.panels import Panel, Trace
from bywire.report.stated_levels import stated_figure, stated_level
from bywire.report.tables import KpiRow, kpi_table
from bywire.report.time_traces import time_traces

LEVEL = StatedLevel("x.level", "e", "p", 27e5, "printed", "Fig. 1")
AROUND = StatedLevel("x.around", "e", "p", 27e5, "printed", "Fig. 1", tolerance=1e5)
RANGE = StatedRange("x.range", "e", "p", 25e5, 29e5, "axis", "Fig. 2")


def drawn(*stated):
    """Return bands and lines [bar] of the first panel that shows the signal, of two that do."""
    t = np.linspace(0.0, 1.0, 50)
    recording = xr.Dataset({"p": ("time", 26e5 + 1e5 * t, {"units": "Pa"})}, coords={"time": t})
    panel = Panel("pressure", (Trace("p"),))
    figure = time_traces(recording, panels=(panel, panel), stated=stated)
    first, second = figure.axes
    assert not second.patches
    bands = [p.get_bbox() for p in first.patches if isinstance(p, Rectangle)]
    lines = [line.get_ydata()[0] for line in first.lines if len(line.get_ydata()) == 2]
    legend = [text.get_text() for text in first.get_legend().get_texts()]
    return [(box.y0, box.y1) for box in bands], lines, legend, first.get_ylim()


def test_a_range_is_a_band_between_its_ends():
    bands, lines, legend, (low, high) = drawn(RANGE)
    assert bands == [pytest.approx((25.0, 29.0))]
    assert lines == pytest.approx([25.0, 29.0])
    assert legend.count("stated: axis") == 1
    assert low <= 25.0 < 29.0 <= high  # visible, although the curve is elsewhere


def test_a_level_has_a_band_only_by_its_tolerance():
    assert drawn(LEVEL)[:2] == ([], pytest.approx([27.0]))
    assert drawn(AROUND)[:2] == ([pytest.approx((26.0, 28.0))], pytest.approx([27.0]))


def test_words_say_values_with_tolerances_ranges_and_bounds():
    assert [stated_level(each, "Pa") for each in (LEVEL, AROUND, RANGE)] == [
        "27 bar",
        "27 bar ± 1 bar",
        "25 bar to 29 bar",
    ]
    bound = StatedFigure("x.bound", "e", "overshoot", 15.0, "section 6", bound="<=")
    assert stated_figure(bound, "%") == "<= 15 %"
    warm = StatedFigure("x.warm", "e", "hottest", 333.15, "section 7", tolerance=2.0)
    assert stated_figure(warm, "K") == "60 °C ± 2 K"


def test_key_figures_have_what_is_stated_and_its_place_beside_them():
    stated = KpiRow("overshoot", 5.0, "%", stated="<= 15 %", where="section 6")
    rows = [stated, KpiRow("rise_time", 1.0, "s")]
    table = kpi_table(rows)
    headings = [column.heading for column in table.columns]
    at = headings.index("stated")
    assert headings[at + 1] == "stated in"
    assert [tuple(c.text for c in row[at : at + 2]) for row in table.rows] == [
        ("<= 15 %", "section 6"),
        ("-", "-"),
    ]
    assert "stated" not in [column.heading for column in kpi_table(rows[1:]).columns]
