"""Figures of studies are readable: separate labels, named limits, complete legends."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.text import Text
from numpy.typing import NDArray

from bywire.core.typing import Array
from bywire.report import style
from bywire.report.readable_axis import few_labels
from bywire.report.study.cases import CaseAxis, choice_axis, parallel_coordinates, scatter
from bywire.report.study.drawn_cases import LINES, CaseSelection, DrawnCases
from bywire.report.study.influences import tornado
from bywire.report.study.probabilities import (
    Curve,
    Histogram,
    convergence,
    exceedance,
    histograms,
)
from bywire.studies.findings import Effect
from bywire.studies.statistics import Share, bin_count, bin_edges, running_sizes, share

RNG = np.random.default_rng(1)
CASES = 200
UNIT = RNG.uniform(size=CASES)
DRIVERS = [
    CaseAxis("caliper.K_pd", "N/m", 1.1e6 * (1.0 + 0.1 * UNIT)),
    CaseAxis("motor.R_m", "ohm", 0.35 + 1e-7 * RNG.uniform(size=CASES)),
    CaseAxis("motor.J", "kg*m**2", 3e-5 * RNG.uniform(0.9, 1.1, CASES)),
]
ERROR = CaseAxis("steady_state_error", "Pa", 500.0 * UNIT)


def drawn(figure: Figure) -> Figure:
    FigureCanvasAgg(figure).draw()
    return figure


def labels(axes: Axes) -> list[Text]:
    low, high = axes.get_xlim()
    return [
        tick.label1
        for tick in axes.xaxis.get_major_ticks()
        if low <= tick.get_loc() <= high and tick.label1.get_visible() and tick.label1.get_text()
    ]


def assert_readable(figure: Figure) -> None:
    """Labels of horizontal axes never touch, and nothing is drawn outside the axes."""
    shown = [label for axes in figure.axes if axes.get_visible() for label in labels(axes)]
    for one, other in combinations(shown, 2):
        assert not one.get_window_extent().overlaps(other.get_window_extent()), (one, other)
    for axes in figure.axes:
        assert len(labels(axes)) <= 5
        assert not axes.xaxis.get_offset_text().get_text()
        assert not axes.yaxis.get_offset_text().get_text()


def segments(drawn: object) -> list[Array]:
    assert isinstance(drawn, LineCollection)
    return drawn.get_segments()


def entries(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def drawn_cases(
    met: NDArray[np.bool_],
    most_met: int,
    most_missed: int = CASES,
    known: NDArray[np.bool_] | None = None,
) -> DrawnCases:
    """Return a selection from blocks, whose columns are all cases in order if all are drawn."""
    shown = np.ones(met.size, dtype=bool) if known is None else known
    masks = met & shown, ~met & shown, ~shown
    all_met, all_missed, all_lacking = (int(np.sum(mask)) for mask in masks)
    selection = CaseSelection(all_met, all_missed, most_met, most_missed, all_lacking)
    for block in np.array_split(np.arange(met.size), 3):
        selection.add({}, met[block], shown[block])
    cases = selection.cases
    return replace(
        cases,
        met=cases.rows[cases.met],
        missed=cases.rows[cases.missed],
        lacking=cases.rows[cases.lacking],
    )


def every(met: NDArray[np.bool_]) -> DrawnCases:
    return drawn_cases(met, met.size, met.size)


def histogram(values: Array, unit: str, nominal: float, limit: float | None = None) -> Histogram:
    ends = float(values.min()), float(values.max())
    edges = bin_edges(*ends, bin_count(values))
    band = (float(x) for x in np.quantile(values, (0.05, 0.95)))
    return Histogram(
        np.histogram(values, edges)[0], edges, ends, (next(band), next(band)), unit, nominal, limit
    )


def running_share(met: NDArray[np.bool_]) -> list[Share]:
    sizes = running_sizes(met.size, 100).tolist()
    return [share(int(met[:n].sum()), n, 0.95) for n in sizes]


def texts(axes: Axes) -> list[str]:
    return [text.get_text() for text in axes.texts]


@pytest.mark.parametrize(
    ("middle", "spread", "unit"),
    [
        (0.0115, 1e-3, "s"),
        (19.0, 1.0, "1"),
        (3e-7, 2e-7, "1"),
        (2e6, 3e5, "Pa"),
        (3e-7, 2e-7, "s"),
        (0.35, 1e-8, "Pa"),
    ],
)
def test_labels_of_a_histogram_never_touch(middle: float, spread: float, unit: str) -> None:
    values = middle + spread * (UNIT - 0.5)
    assert_readable(
        drawn(
            histograms(
                {
                    name: histogram(values, unit, middle)
                    for name in ("share_sat_current", "share_sat_duty")
                }
            )
        )
    )


def test_a_histogram_names_a_limit_that_lies_far_off() -> None:
    far = histogram(ERROR.values, "Pa", 250.0, 1e4)
    near = histogram(ERROR.values, "Pa", 250.0, 600.0)
    figure = drawn(histograms({"far": far, "near": near}))
    assert figure.axes[0].get_title(loc="right") == "limit 0.1 bar →"
    assert texts(figure.axes[0]) == texts(figure.axes[1]) == []
    assert "limit" in entries(figure)
    assert "limit" not in entries(histograms({"far": far}))


@pytest.mark.parametrize(
    ("limit", "named"), [(1e4, ["limit 0.1 bar ↑"]), (-1e4, ["limit -0.1 bar ↓"]), (600.0, [])]
)
def test_points_of_a_scatter_fill_it_however_far_the_limit(limit: float, named: list[str]) -> None:
    figure = drawn(scatter(ERROR, DRIVERS, limit, every(ERROR.values <= limit)))
    assert_readable(figure)
    low, high = figure.axes[0].get_ylim()
    assert (low <= 1e-2 * limit <= high) == (not named)  # in 10⁻³ bar
    assert np.ptp(ERROR.shown) > 0.7 * (high - low)
    assert texts(figure.axes[0]) == named
    assert ("limit" in entries(figure)) == (not named)


def test_entries_of_a_scatter_are_what_is_drawn() -> None:
    mixed = scatter(ERROR, DRIVERS, 300.0, every(ERROR.values <= 300.0))
    assert entries(mixed) == ["meets the limit", "misses the limit", "limit"]
    undefined = CaseAxis(ERROR.name, "Pa", np.where(ERROR.values > 300.0, np.nan, ERROR.values))
    known = drawn_cases(UNIT < 0.6, CASES, known=np.isfinite(undefined.values))
    assert "misses the limit" not in entries(scatter(undefined, DRIVERS, 300.0, known))


def test_cases_without_the_figure_stand_at_the_edge_of_a_scatter() -> None:
    lacking = ERROR.values > 400.0
    undefined = CaseAxis(ERROR.name, "Pa", np.where(lacking, np.nan, ERROR.values))
    cases = drawn_cases(ERROR.values <= 300.0, CASES, known=~lacking)
    figure = drawn(scatter(undefined, DRIVERS, 300.0, cases))
    said = ["meets the limit", "misses the limit", "no figure, so missed", "limit"]
    assert entries(figure) == said
    box = figure.legends[0].get_window_extent()
    assert box.x1 <= figure.bbox.x1
    for axes, driver in zip(figure.axes, DRIVERS, strict=True):
        edge = axes.lines[2]
        np.testing.assert_array_equal(edge.get_xdata(), driver.shown[lacking])
        top = edge.get_transform().transform([(0.0, edge.get_ydata()[0])])[0, 1]
        assert axes.bbox.y1 < top < box.y0


def test_lines_of_cases_without_a_figure_go_to_none() -> None:
    lacking = ERROR.values > 400.0
    undefined = CaseAxis(ERROR.name, "Pa", np.where(lacking, np.nan, ERROR.values))
    figure = drawn(parallel_coordinates([*DRIVERS, undefined], every(~lacking), {}))
    axes = figure.axes[0]
    (none,) = (text for text in axes.texts if text.get_text() == "none")
    assert none.get_position()[0] == len(DRIVERS)
    ends = [line[-1, 1] for line in segments(axes.collections[1])]
    assert len(ends) == np.count_nonzero(lacking)
    assert 1.0 < min(ends) == max(ends) <= none.get_position()[1] < axes.get_ylim()[1]


def test_many_points_are_small_and_translucent() -> None:
    def marker(cases: int) -> tuple[float, float]:
        own = CaseAxis("ripple", "Pa", np.linspace(1.0, 2.0, cases))
        axes = scatter(own, [own], 3.0, every(np.ones(cases, dtype=bool))).axes[0]
        return axes.lines[0].get_markersize(), axes.lines[0].get_alpha() or 1.0

    (few_size, few_alpha), (size, alpha) = marker(1000), marker(1001)
    assert size < few_size
    assert alpha < few_alpha


def test_a_convergence_shows_what_decides() -> None:
    met = np.ones(256, dtype=bool)
    met[[70, 130]] = False
    shares = running_share(met)
    figure = drawn(convergence({"a": shares, "b": shares}, {"a": 0.99, "b": None}, first=64))
    assert entries(figure) == ["estimate", "interval", "required"]
    assert_readable(figure)
    for axes in figure.axes:
        low, high = axes.get_ylim()
        assert 85.0 < low < 100.0 * min(s.low for s in shares if s.cases >= 128)
        assert 100.0 < high < 101.0
        assert axes.get_xlim() == (pytest.approx(64, abs=4), 256)


@pytest.mark.parametrize(
    ("cases", "part", "wanted"),
    [
        (1, 0.0, None),
        (1, 0.4, 0.5),
        (1, 1.0, 0.999),
        (64, 0.0, 0.5),
        (64, 0.4, 0.999),
        (64, 1.0, None),
        (1000, 0.0, 0.999),
        (1000, 0.4, None),
        (1000, 1.0, 0.5),
    ],
)
def test_a_convergence_holds_its_estimate_and_what_is_wanted(
    cases: int, part: float, wanted: float | None
) -> None:
    shares = running_share(np.arange(cases) < part * cases)
    axes = convergence({"a": shares}, {"a": wanted}, first=64).axes[0]
    low, high = axes.get_ylim()
    last = shares[-1]
    for value in (last.value, last.low, last.high, last.value if wanted is None else wanted):
        assert low < 100.0 * value < high


def test_the_outline_of_a_histogram_holds_all_cases() -> None:
    values = RNG.normal(size=CASES)
    axes = histograms({"overshoot": histogram(values, "%", 0.0)}, has_band=False).axes[0]
    (outline,) = (each for each in axes.patches if isinstance(each, Polygon))
    corners = outline.get_xy()
    widths, heights = np.diff(corners[:, 0]), corners[1:, 1]
    assert np.sum((widths * heights)[:-1]) / np.max(widths) == pytest.approx(CASES)
    (low, high), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    assert low < np.min(values) < np.max(values) < high
    assert bottom == 0.0 < np.max(corners[:, 1]) < top


def test_parallel_coordinates_say_what_lines_are_and_where_limits_lie() -> None:
    met = ERROR.values <= 300.0
    rise = CaseAxis("rise_time", "s", 0.06 + 0.01 * UNIT)
    figure = drawn(
        parallel_coordinates(
            [*DRIVERS, ERROR, rise], every(met), {"steady_state_error": 300.0, "rise_time": 0.1}
        )
    )
    assert entries(figure) == ["meets all requirements", "misses a requirement", "limit"]
    axes = figure.axes[0]
    assert [t for t in texts(axes) if "limit" in t] == ["limit 100 ↑"]
    mark = next(line for line in axes.lines if line.get_zorder() == 4.0)
    least, most = np.min(ERROR.values), np.max(ERROR.values)
    np.testing.assert_allclose(mark.get_ydata(), (300.0 - least) / (most - least))
    lines = [line for drawn in axes.collections for line in segments(drawn)]
    assert len(lines) == CASES
    top = max(float(np.max(line[:, 1])) for line in lines)
    for text in axes.texts:
        assert not 0.0 <= text.get_position()[1] <= top, "a line crosses what is written"
        assert text.get_bbox_patch() is not None
    for one, other in combinations(axes.texts, 2):
        assert not one.get_window_extent().overlaps(other.get_window_extent())


def test_a_figure_that_no_case_has_leaves_parallel_coordinates() -> None:
    nothing = CaseAxis("settling_time", "s", np.full(CASES, np.nan))
    figure = parallel_coordinates([*DRIVERS, nothing], every(np.zeros(CASES, dtype=bool)), {})
    assert len(figure.axes[0].get_xticks()) == len(DRIVERS)
    assert entries(figure) == ["misses a requirement"]


def test_a_tornado_is_not_squeezed_by_a_limit_far_off() -> None:
    effect = Effect("motor.R_m", "ohm", [0.3, 0.4], np.array([200.0, 500.0]), 300.0)
    effects, units = {"steady_state_error": [effect]}, {"steady_state_error": "Pa"}
    figure = drawn(tornado(effects, units, {"steady_state_error": 1e4}))
    assert_readable(figure)
    axes = figure.axes[0]
    assert axes.get_title(loc="right") == "limit 0.1 bar →"
    assert axes.get_xlim()[1] < 6.0
    assert axes.get_xlabel() == "steady state error [10⁻³ bar]"
    near = tornado(effects, units, {"steady_state_error": 600.0})
    assert "limit" in entries(near)
    assert near.axes[0].get_title(loc="right") == ""


def test_choices_are_named_at_their_ends_in_a_tornado() -> None:
    values = ["dry-asphalt", "wet-asphalt", "snow"]
    surface = Effect("options.surface", "", values, np.array([48.0, 60.0, 203.0]), 60.0)
    speed = Effect("options.v_0", "m/s", [19.0, 31.0], np.array([26.0, 64.0]), 60.0)
    units = {"stopping_distance": "m"}
    figure = drawn(tornado({"stopping_distance": [surface, speed]}, units, {}))
    assert_readable(figure)
    assert entries(figure) == ["quantity below the bench value", "above the bench value", "choice"]
    axes = figure.axes[0]
    assert texts(axes) == ["dry-asphalt", "snow"]
    for text in axes.texts:
        box = text.get_window_extent()
        assert axes.bbox.x0 <= box.x0 < box.x1 <= axes.bbox.x1
    assert {patch.get_facecolor()[:3] for patch in axes.patches[:2]} == {to_rgb(style.GRAY)}
    assert entries(tornado({"stopping_distance": [surface]}, units, {})) == ["choice"]


def test_curves_of_figures_with_other_units_fill_panels_of_their_own() -> None:
    points = np.linspace(0.0, 1.0, 50)
    probable = 10.0 ** (-3.0 * points)
    curves = [
        Curve(
            name,
            unit,
            limit,
            0.01,
            limit * (0.5 + 0.6 * points),
            probable,
            0.5 * probable,
            2.0 * probable,
        )
        for name, unit, limit in (("rise_time", "s", 0.07), ("peak_power", "W", 200.0))
    ]
    figure = drawn(exceedance(curves))
    assert_readable(figure)
    for axes, shown in zip(figure.axes, ((35.0, 77.0), (100.0, 220.0)), strict=True):
        low, high = axes.get_xlim()
        assert shown[1] - shown[0] > 0.8 * (high - low)
        assert len(labels(axes)) > 1
    assert [axes.get_xlabel() for axes in figure.axes] == ["rise time [ms]", "peak power [W]"]


def test_choices_stand_by_their_names_and_their_points_beside_each_other() -> None:
    law = choice_axis("adc.law", ["quantized", "ideal"] * (CASES // 2), ["ideal", "quantized"])
    met = ERROR.values <= 300.0
    figure = drawn(scatter(ERROR, [law, *DRIVERS[:2]], 300.0, every(met)))
    assert_readable(figure)
    axes = figure.axes[0]
    assert [text.get_text() for text in labels(axes)] == ["ideal", "quantized"]
    assert axes.get_xlabel() == "adc.law"
    points = np.sort(np.concatenate([line.get_xdata() for line in axes.lines[:2]]))
    assert np.unique(points).size == CASES
    np.testing.assert_array_equal(np.round(points), np.repeat([0.0, 1.0], CASES // 2))
    shown = drawn(parallel_coordinates([law, ERROR], every(met), {})).axes[0]
    assert {"ideal", "quantized"} <= set(texts(shown))


def test_long_names_of_choices_never_touch() -> None:
    names = ["field-oriented", "six-step-commutation", "direct-torque"]
    law = choice_axis("drive.law", [names[k % 3] for k in range(CASES)], names)
    figure = drawn(scatter(ERROR, [law, law, law], 300.0, every(UNIT < 2.0)))
    for axes in figure.axes:
        first, second, _ = labels(axes)
        apart = second.get_position()[0] - first.get_position()[0]
        width = np.ptp(axes.transData.transform([(0.0, 0.0), (apart, 0.0)])[:, 0])
        across = width * np.sin(np.deg2rad(first.get_rotation()))  # between slanted lines of text
        assert across > first.get_fontsize() * figure.dpi / 72.0


def test_what_is_thinned_is_said_with_its_numbers() -> None:
    met = np.arange(1000) % 100 != 0
    cases = drawn_cases(met, 400, LINES)
    assert (cases.met.size, cases.missed.size) == (400, 10)
    assert np.all(met[cases.met])
    assert not np.any(met[cases.missed])
    caption = cases.caption("meet the limit", "miss it")
    assert "400 of 990 cases that meet the limit" in caption
    assert "10 cases that miss it" in caption
    assert drawn_cases(met, 990).caption("meet the limit", "miss it") == ""


@pytest.mark.parametrize("ends", [(0.034126, 0.034856), (0.0301, 0.0309), (21.96, 22.03)])
def test_a_narrow_axis_has_two_labels_at_least(ends: tuple[float, float]) -> None:
    figure = Figure(figsize=(1.87, 1.0))
    axes = figure.subplots()
    axes.set_xlim(*ends)
    few_labels(axes.xaxis, 1.87)
    assert_readable(drawn(figure))
    assert len(labels(axes)) > 1


def test_a_limit_far_off_crosses_no_line_of_a_histogram() -> None:
    own = float(np.max(ERROR.values))  # the value of the bench is at that end
    axes = drawn(histograms({"far": histogram(ERROR.values, "Pa", own, 1e4)})).axes[0]
    title = axes._right_title  # matplotlib returns only its text
    assert title.get_text() == "limit 0.1 bar →"
    assert not title.get_window_extent().overlaps(axes.get_window_extent())
