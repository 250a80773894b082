"""Curves of an identification: separate points, families, consecutive records."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from bywire.data.labeled import at_own_places
from bywire.identification.measured import after_one_another
from bywire.identification.method import Curve
from bywire.report.estimate_figures import method_curve

FORCE = {"units": "N", "long_name": "force"}


def line(axes: Axes, label: str) -> Line2D:
    (found,) = (one for one in axes.lines if one.get_label() == label)
    return found


def over(count: int) -> Curve:
    x = np.linspace(0.0, 1.0, count)
    data = {"measured": ("x", x + 0.1, FORCE), "modeled": ("x", x, FORCE)}
    return Curve("a", "b", xr.Dataset(data, {"x": ("x", x, {"units": "m"})}), "x")


@pytest.mark.parametrize(("count", "joined"), [(40, False), (41, True)])
def test_few_measured_points_are_not_joined(count: int, joined: bool) -> None:
    upper, lower = method_curve(over(count)).axes
    assert (line(upper, "measured").get_linestyle() == "-") is joined
    assert (line(upper, "measured").get_marker() == "o") is not joined
    assert line(upper, "modeled").get_linestyle() == "--"
    difference = np.asarray(lower.lines[0].get_ydata())
    np.testing.assert_allclose(difference, -0.1)
    assert (lower.lines[0].get_linestyle() == "-") is joined
    assert lower.get_xlabel() == "x [mm]"
    assert float(np.max(line(upper, "modeled").get_xdata())) == 1e3


def test_each_curve_is_shown_where_it_was_read() -> None:
    places = [np.array([3.0, 1.0]), np.array([2.0, 5.0, 4.0]), np.array([0.0, 6.0])]
    rows = [
        np.array([[30.0, 10.0], [31.0, 11.0]]),
        np.array([[2.0, 5.0, 4.0]] * 2),
        np.array([[np.nan] * 2, [0.0, 6.0]]),
    ]
    x, table = at_own_places(places, rows)
    np.testing.assert_array_equal(x, [[1, 3, np.nan], [2, 4, 5], [0, 6, np.nan]])
    np.testing.assert_array_equal(table[:, 0], [[10, 30, np.nan], [11, 31, np.nan]])
    dims = ("way", "window")
    data = xr.Dataset(
        {"measured": (dims, table[0], FORCE), "modeled": (dims, table[1], FORCE)},
        {"way": ["up", "down", "line"], "F": (dims, x, {"units": "A"})},
    )
    upper, _ = method_curve(Curve("a", "b", data, "F")).axes
    np.testing.assert_array_equal(line(upper, "up measured").get_xdata()[:2], [1.0, 3.0])
    np.testing.assert_array_equal(line(upper, "down modeled").get_ydata(), [2.0, 4.0, 5.0])
    assert "line measured" not in {one.get_label() for one in upper.lines}  # there is none


def test_records_in_a_row_are_named_and_told_apart() -> None:
    axis = after_one_another({"1_bar": np.arange(50.0), "3_bar": np.array([2.0, 3.0, 9.0])})
    t = axis["time"][1]
    np.testing.assert_array_equal(t[[0, 49, 50, 52]], [0.0, 49.0, 52.0, 59.0])
    data = {name: ("time", np.sin(t), FORCE) for name in ("measured", "modeled")}
    upper, lower = method_curve(Curve("a", "b", xr.Dataset(data, axis), "time")).axes
    assert [one.get_text() for one in upper.texts] == ["1_bar", "3_bar"]
    for axes in (upper, lower):
        borders = [b for b in axes.lines if list(b.get_xdata()) == [50.5, 50.5]]
        assert len(borders) == 1
    assert lower.get_xlabel() == "time, records joined [s]"
    assert set(after_one_another({"": np.arange(3.0)})) == {"time"}


def test_a_gain_over_frequency_is_logarithmic_and_a_phase_is_not() -> None:
    f = np.array([1.0, 2.0, 5.0, 15.0])
    for unit, scale in (("Pa/A", "log"), ("degree", "linear")):
        attrs = {"units": unit, "long_name": "response"}
        data = {name: ("frequency", 1.0 / f, attrs) for name in ("measured", "modeled")}
        axis = {"frequency": ("frequency", f, {"units": "Hz"})}
        figure = method_curve(Curve("a", "b", xr.Dataset(data, axis), "frequency"))
        upper, lower = figure.axes
        assert upper.get_yscale() == scale
        assert lower.get_xscale() == "log"
        figure.canvas.draw()
        assert "2" in [tick.get_text() for tick in lower.get_xticklabels()]


def test_a_band_is_named() -> None:
    p = np.linspace(0.0, 1e6, 5)
    values = {
        n: (("level", "p"), np.full((2, 5), k), FORCE)
        for k, n in enumerate(("low", "value", "high"))
    }
    coords = {"p": ("p", p, {"units": "Pa"}), "level": ("level", [1.0, 2.0], {"units": "s"})}
    (axes,) = method_curve(Curve("a", "b", xr.Dataset(values, coords), "p")).axes
    said = [text.get_text() for text in axes.get_legend().get_texts()]
    assert said == ["1 s", "2 s", "95 % band (± 1 N at most)"]


@pytest.mark.parametrize(
    ("half", "said"),
    [
        (0.1, "95 % band (± 0.1 N at most)"),
        (1e-3, "95 % band (± 0.001 N at most, hidden by the line)"),
    ],
)
def test_a_band_that_the_line_hides_is_told(half: float, said: str) -> None:
    x = np.linspace(0.0, 1.0, 41)
    data = {"value": ("x", x, FORCE), "low": ("x", x - half, FORCE), "high": ("x", x + half, FORCE)}
    curve = Curve("a", "b", xr.Dataset(data, {"x": ("x", x, {"units": "m"})}), "x")
    (axes,) = method_curve(curve).axes
    legend = axes.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["modeled", said]
