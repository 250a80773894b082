"""Figures of linear analysis: their marks, and what they omit for unstable loops."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from bywire.analysis.agreement import Agreement
from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.locus import Border, Locus
from bywire.analysis.margins import UNSTABLE, Family, LoopCurve, LoopMargins
from bywire.api.agreement import agreement_table, verdict
from bywire.api.linear_texts import left_out, rate_table
from bywire.api.margins import margins_table, worst_texts
from bywire.core.errors import ParameterError
from bywire.report.loop_curves import loop_gain, nichols, nyquist, sensitivity
from bywire.report.poles import pole_map, root_locus
from bywire.report.response_figures import differences

FREQUENCY = np.geomspace(1e-2, 10.0, 400)
CHARTS = (nyquist, nichols, sensitivity, loop_gain)


def curve(gain: float) -> LoopCurve:
    """Return k/(s (s + 1)^2), unstable from k = 2 on, whose phase is -180 degrees at 1 rad/s."""
    s = 2j * np.pi * FREQUENCY
    L = gain / (s * (s + 1.0) ** 2)
    if gain >= 2.0:
        return LoopCurve(FREQUENCY, L, UNSTABLE)
    S = 1.0 / (1.0 + L)
    k = int(np.flatnonzero(np.abs(L) > 1.0)[-1])
    margins = LoopMargins(
        gain=2.0 / gain,
        phase=180.0 + math.degrees(np.unwrap(np.angle(L))[k]),
        crossover=float(FREQUENCY[k]),
        delay=0.1,
        disk=2.0 / float(np.abs(2.0 * S - 1.0).max()),
        sensitivity=float(np.abs(S).max()),
        complementary=float(np.abs(1.0 - S).max()),
        bandwidth=0.2,
        stable=True,
        phase_at=float(FREQUENCY[k]),
        gain_at=1.0 / (2.0 * np.pi),
        lower_gain=0.0,
    )
    return LoopCurve(FREQUENCY, L, margins)


def legend_of(figure: Figure) -> str:
    legends = [axes.get_legend() for axes in figure.axes if axes.get_legend() is not None]
    legends += figure.legends
    return "\n".join(text.get_text() for legend in legends for text in legend.get_texts())


@pytest.mark.parametrize("chart", CHARTS)
def test_a_single_curve_has_its_margins_marked(chart) -> None:
    text = legend_of(chart(Family((curve(0.5),))))
    marked = {nyquist: "gain margin 4", nichols: "gain margin 4", loop_gain: "gain margin 4"}
    assert marked.get(chart, "usual limit 2") in text
    assert "worst" not in text


@pytest.mark.parametrize("chart", CHARTS)
def test_the_worst_of_a_range_is_named(chart) -> None:
    family = Family((curve(0.5), curve(1.0)), "brake.gain", "1", (0.5, 1.0))
    assert "worst: brake.gain = 1" in legend_of(chart(family))


def test_an_unstable_loop_has_no_disk_and_no_sensitivity() -> None:
    family = Family((curve(0.5), curve(3.0)), "brake.gain", "1", (0.5, 3.0))
    figure = nyquist(family)
    assert "brake.gain = 3, unstable" in legend_of(figure)
    assert not any(isinstance(patch, Circle) for patch in figure.axes[0].patches)
    (free,) = (p for p in nyquist(Family((curve(0.5),))).axes[0].patches if isinstance(p, Circle))
    assert free.center[0] + free.radius < 0.0
    drawn = [line for line in sensitivity(family).axes[0].lines if len(line.get_xdata()) == 400]
    assert len(drawn) == 1


def test_the_nichols_chart_shades_what_the_curve_only_touches() -> None:
    """At the phase of the gain margin, the shaded area ends below the distance of the curve."""
    one = curve(1.0)
    phase, size = one.phase, 20.0 * np.log10(np.abs(one.L))
    figure = nichols(Family((one,)))
    (shaded,) = (c for c in figure.axes[0].collections if c.get_zorder() == pytest.approx(0.9))
    (area,) = [path for path in shaded.get_paths() if len(path)]
    inside = area.contains_points(np.column_stack([phase, size]), radius=-0.5)
    assert not inside.any()
    assert area.contains_point((-180.0, 0.0))


def test_poles_are_drawn_once_a_pair_and_unstable_ones_stand_out() -> None:
    rates = np.array([0.0, -5.0, -3 + 4j, -3 - 4j, 1 + 2j, 1 - 2j])
    left = pole_map(rates, 0.01, 1.0).axes[0]
    crosses = [line for line in left.lines if line.get_marker() == "x"]
    assert sorted(len(line.get_xdata()) for line in crosses) == [1, 2]
    assert len({line.get_color() for line in crosses}) == 2


def test_a_locus_marks_its_border_and_shows_all_that_grows() -> None:
    values = np.linspace(-1.0, 2.0, 7)
    poles = np.stack([values + 3j, values - 3j], axis=1)
    border = Border(0.0, 3j, False)
    found = Locus("brake.gain", "1", values, poles, 0.0, values <= 0.0, (border,))
    figure = root_locus(found, math.nan)
    assert "0.477 Hz" in legend_of(figure)
    assert all(axes.get_xlim()[1] > 2.0 for axes in figure.axes[:2])


def test_differences_below_the_tolerance_are_seen_as_such() -> None:
    f = np.array([1.0, 10.0])
    figure = differences(f, {"limits": (np.array([0.0, np.nan]), f)}, (0.01, 0.1))
    (line,) = [
        one
        for one in figure.axes[0].lines
        if len(one.get_xdata()) == 2 and one.get_label() == "limits"
    ]
    np.testing.assert_allclose(line.get_ydata(), [1e-4, np.nan])
    with pytest.raises(ParameterError, match="no cause was passed"):
        differences(f, {}, (0.01, 0.1))


def test_the_agreement_table_names_what_has_no_number() -> None:
    def values(*size: float) -> np.ndarray:
        return np.array(size)

    found = Agreement(
        values(1.0, 2.0),
        {
            "": values(0.0, 1e-3),
            "limits": values(0.0, -3.0),
            "friction": values(-0.5, np.nan),
            "all": values(-0.5, np.nan),
        },
        {
            "": values(0.0, 0.01),
            "limits": values(0.0, 0.0),
            "friction": values(170.0, np.nan),
            "all": values(170.0, np.nan),
        },
        values(0.0, 0.0),
        values(0.0, 0.0),
    )
    rows = [[cell.text for cell in row] for row in agreement_table(found).rows]
    assert rows[2] == ["friction", "-0.500 dB +170.00°", "-"]
    assert rows[-1] == ["largest", "friction", "friction"]
    small = replace(
        found,
        gain=dict.fromkeys(found.gain, values(0.0, 0.0)),
        phase=dict.fromkeys(found.phase, values(0.0, 0.05)),
    )
    assert small.largest == ["", ""]
    assert "0.001 dB" in verdict(found)
    assert "DO NOT" in verdict(replace(found, gain=found.gain | {"": values(0.0, 0.02)}))


def test_the_margins_table_says_what_is_unstable() -> None:
    found = [curve(0.5).margins, UNSTABLE]
    rows = margins_table(found, "brake.gain", "1", (0.5, 3.0)).rows
    assert [row[0].text for row in rows] == ["0.5", "3"]
    assert [row[-1].verdict for row in rows] == ["none", "bad"]
    assert rows[1][1].text == "not defined"


def test_the_worst_of_a_range_names_what_is_unstable_apart() -> None:
    found = [curve(0.5).margins, curve(1.0).margins, UNSTABLE, UNSTABLE]
    texts = worst_texts(found, "brake.gain", "1", (0.5, 1.0, 2.0, 3.0))
    assert texts[0] == "unstable at 2 of 4 values of brake.gain (2 to 3)"
    assert "gain margin 2 at brake.gain = 1" in texts
    assert not any("not defined" in text for text in texts)
    assert worst_texts([UNSTABLE], "brake.gain", "1", (2.0,)) == [
        "unstable at 1 of 1 values of brake.gain (2)"
    ]


def test_poles_that_a_table_leaves_out_are_counted() -> None:
    z = np.array([0.9, -0.5, 1.0, 0.0, 0.0])
    n = len(z)
    model = LinearModel(
        "chain",
        np.diag(z),
        np.ones((n, 1)),
        np.ones((1, n)),
        np.zeros((1, 1)),
        tuple("abcde"),
        ("u",),
        ("y",),
        ("1",) * n,
        ("1",),
        ("1",),
        np.zeros(n),
        1e-3,
    )
    rows = [[cell.text for cell in row] for row in rate_table(model).rows]
    assert len(rows) == 2
    assert rows[1][2:] == ["500 (f_s/2)", "-"]
    assert left_out(model) == [
        "other poles: 1 at 0 (not driven, or without restoring force), 2 that decay within a sample"
    ]
    own = replace(model, A=np.diag([0.9, 0.8, 0.7, 0.6, 0.5]))
    assert left_out(own) == []


def test_a_pole_beyond_the_plane_is_told() -> None:
    rates = np.array([-5.0 + 0j, -400.0 + 1j * np.pi / 0.01])
    assert "1 faster, not shown" in pole_map(rates, 0.01, 1.0).axes[0].get_title(loc="left")
    assert "not shown" not in pole_map(rates[:1], 0.01, 1.0).axes[0].get_title(loc="left")
