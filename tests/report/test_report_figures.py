"""Every figure has labels with units and shows its data."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bywire.core.errors import ParameterError, UnknownNameError
from bywire.report.drawing import figure_bytes
from bywire.report.energy_balance import energy_balance
from bywire.report.friction_figures import hysteresis_loop, stribeck_curve
from bywire.report.panels import Panel, Role, Trace
from bywire.report.response_figures import Response, bode
from bywire.report.step_response import StepFacts, StepLimits, step_response, tracking
from bywire.report.time_traces import overlaid_traces, time_traces
from raising import raises

step_figure = partial(step_response, variable="p_mc", set_point="p_ref")
LOOP = ("p_mc", "i", "i_star")  # response, drive, demand

LIMITS = StepLimits(start=0.1, before=6e5, after=37e5, overshoot=0.15)
FACTS = StepFacts(rise_time=0.042, settling_time=0.187, overshoot=0.126)
HERTZ = np.logspace(-2, 2, 50)
LAG = 10.0 / (1.0 + 1j * HERTZ)

DRAWN: dict[str, Callable[[xr.Dataset], Figure]] = {
    "traces": lambda r: time_traces(r, limits=LIMITS),
    "traces compared": lambda r: time_traces(r, measured=r),
    "step": lambda r: step_figure(r, limits=LIMITS, facts=FACTS),
    "step compared": lambda r: step_figure(r, limits=LIMITS, measured=r),
    "loop": lambda r: hysteresis_loop({"with dither": r, "without": r}, *LOOP),
    "tracking": lambda r: tracking(r, "p_mc", "p_ref"),
    "energy": energy_balance,
    "bode": lambda r: bode([Response("plant", HERTZ, LAG)], marks={"crossover 10 Hz": 10.0}),
}


@pytest.fixture(params=[*sorted(DRAWN), "seal-stribeck"])
def figure(request: pytest.FixtureRequest, recording: xr.Dataset, curve: xr.Dataset) -> Figure:
    if request.param == "seal-stribeck":
        return stribeck_curve(curve)
    return DRAWN[request.param](recording)


def legend_of(axes: Axes) -> list[str]:
    legend = axes.get_legend()
    return [] if legend is None else [text.get_text() for text in legend.get_texts()]


def heights(axes: Axes) -> list[np.ndarray]:
    return [np.asarray(line.get_ydata(), dtype=float) for line in axes.lines]


def test_axes_have_labels_with_units(figure: Figure) -> None:
    unit = re.compile(r"\S\s+\[[^\[\]]+\]$")
    assert unit.search(figure.axes[-1].get_xlabel())
    for axes in figure.axes:
        names = [tick.get_text() for tick in axes.get_yticklabels()]
        assert unit.search(axes.get_ylabel()) or names == ["came from", "went to"]


def test_nothing_leaves_the_figure_and_legends_do_not_cover_data(figure: Figure) -> None:
    figure_bytes(figure, "png")
    width, height = figure.bbox.size
    for axes in figure.axes:
        around = axes.get_tightbbox()
        assert around is not None
        assert min(around.x0, around.y0) >= -1.0
        assert around.x1 <= width + 1.0
        assert around.y1 <= height + 1.0
        legend = axes.get_legend()
        if legend is not None:
            assert legend.get_window_extent().y0 >= axes.bbox.y1 - 1.0


def test_panels_do_not_overlap(recording: xr.Dataset) -> None:
    drawn = time_traces(recording, limits=LIMITS)
    figure_bytes(drawn, "png")
    boxes = [axes.get_tightbbox() for axes in drawn.axes]
    for upper, lower in pairwise(boxes):
        assert upper is not None
        assert lower is not None
        assert lower.y1 <= upper.y0 + 1.0


def test_pressure_is_drawn_in_bar(recording: xr.Dataset) -> None:
    axes = step_figure(recording).axes[0]
    assert axes.get_ylabel() == "master-cylinder pressure [bar]"
    assert heights(axes)[0].max() == pytest.approx(recording["p_mc"].max().item() / 1e5)


@pytest.mark.parametrize(("size", "unit"), [(12e3, "kN"), (800.0, "N")])
def test_every_axis_of_a_force_takes_the_unit_of_tables(size: float, unit: str) -> None:
    t = np.linspace(0.0, 1.0, 51)
    force = ("time", size * t, {"units": "N", "long_name": "clamp force"})
    data = xr.Dataset({"F": force, "F_ref": force}, {"time": t})
    panel = Panel("clamp force", (Trace("F"), Trace("F_ref", Role.SET_POINT)))
    figures = [
        time_traces(data, panels=(panel,)),
        step_response(data, "F", "F_ref"),
        tracking(data, "F", "F_ref"),
        overlaid_traces({"a": data, "b": data}, {"F": "clamp force"}),
        hysteresis_loop({"a": data}, "F", "F_ref"),
    ]
    for figure in figures:
        axes = figure.axes[0]
        assert axes.get_ylabel().endswith(f"[{unit}]")
        top = max(float(np.max(line.get_ydata(), initial=0.0)) for line in axes.lines)
        assert top == pytest.approx(size / (1e3 if unit == "kN" else 1.0))


def test_short_recordings_are_drawn_in_milliseconds(recording: xr.Dataset) -> None:
    axes = step_response(recording.isel(time=slice(0, 150)), "i", "i_ref").axes[0]
    assert axes.get_xlabel() == "time [ms]"
    assert axes.get_xlim()[1] == pytest.approx(149.0)


def test_step_marks_stand_where_they_belong(recording: xr.Dataset) -> None:
    axes = step_figure(recording, limits=LIMITS, facts=FACTS).axes[0]
    drawn = {str(line.get_label()): line for line in axes.lines}
    limit = drawn["overshoot limit 15 %"].get_ydata()
    assert np.allclose(limit, 37.0 + 0.15 * 31.0)
    times, levels = drawn["rise 10 to 90 %: 42 ms"].get_data()
    assert np.allclose(levels, [6.0 + 0.1 * 31.0, 6.0 + 0.9 * 31.0])
    assert 0.1 < times[0] < times[1] < 0.3
    assert np.allclose(drawn["settling (2 %): 187 ms"].get_xdata(), 0.287)
    assert drawn["overshoot: 12.6 %"].get_ydata() == [recording["p_mc"].max().item() / 1e5]
    assert "±2 % band" in legend_of(axes)


def test_marks_sit_on_the_averaged_curve_where_that_was_judged(recording: xr.Dataset) -> None:
    axes = step_figure(recording, limits=LIMITS, facts=FACTS, smoothing=0.02).axes[0]
    drawn = {str(line.get_label()): line for line in axes.lines}
    averaged, raw = drawn["averaged over 20 ms"], drawn["master-cylinder pressure"]
    top = np.max(np.asarray(averaged.get_ydata(), dtype=float))
    assert drawn["overshoot: 12.6 %"].get_ydata() == pytest.approx([top])
    assert top < recording["p_mc"].max().item() / 1e5 - 0.01
    assert averaged.get_linewidth() < raw.get_linewidth()
    assert (averaged.get_alpha() or 1.0) > (raw.get_alpha() or 1.0)


def test_a_falling_step_is_judged_downward(recording: xr.Dataset) -> None:
    mirrored = recording.assign(p_mc=-1.0 * recording["p_mc"])
    mirrored["p_mc"].attrs = recording["p_mc"].attrs
    falling = StepLimits(start=0.1, before=-6e5, after=-37e5, overshoot=0.15)
    axes = step_response(mirrored, "p_mc", None, limits=falling, facts=FACTS).axes[0]
    drawn = {str(line.get_label()): line for line in axes.lines}
    assert drawn["overshoot: 12.6 %"].get_ydata() == [-recording["p_mc"].max().item() / 1e5]
    assert np.allclose(drawn["overshoot limit 15 %"].get_ydata(), -37.0 - 0.15 * 31.0)


def test_no_overshoot_is_said_but_not_marked(recording: xr.Dataset) -> None:
    axes = step_figure(recording, limits=LIMITS, facts=StepFacts(overshoot=0.0)).axes[0]
    drawn = {str(line.get_label()): line for line in axes.lines}
    assert len(np.asarray(drawn["overshoot: 0 %"].get_xdata())) == 0


def test_facts_that_do_not_exist_are_not_drawn(recording: xr.Dataset) -> None:
    facts = StepFacts(rise_time=float("nan"), settling_time=None)
    axes = step_figure(recording, limits=LIMITS, facts=facts).axes[0]
    assert not [label for label in legend_of(axes) if "rise" in label or "settling" in label]


def test_a_step_of_no_height_is_refused() -> None:
    with raises(ParameterError, name="after", value="1"):
        StepLimits(start=0.0, before=1.0, after=1.0)


def test_stuck_phases_and_saturation_are_named(recording: xr.Dataset) -> None:
    drawn = time_traces(recording)
    # under dither, which breaks it loose
    again = "shaft stuck repeatedly, 11 % of the shaded time"
    assert again in legend_of(drawn.axes[0])
    assert "saturated" in legend_of(drawn.axes[1])


def test_a_set_point_never_used_is_left_out(recording: xr.Dataset) -> None:
    unused = recording.assign(p_ref=0.0 * recording["p_ref"])
    assert "pressure set point" not in legend_of(time_traces(unused).axes[0])
    assert "pressure set point" in legend_of(time_traces(recording).axes[0])


def test_compared_lines_are_measured_blue_and_simulated_dashed_red(recording: xr.Dataset) -> None:
    axes = time_traces(recording, measured=recording).axes[0]
    look = {str(line.get_label()): (line.get_color(), line.get_linestyle()) for line in axes.lines}
    assert look["master-cylinder pressure, measured"] == ("#0072B2", "-")
    assert look["master-cylinder pressure, simulated"] == ("#D55E00", "--")


def test_long_recordings_are_thinned_but_keep_their_peak(long_recording: xr.Dataset) -> None:
    spiked = long_recording.copy(deep=True)
    spiked["p_mc"].values[43_210] = 99e5
    axes = time_traces(spiked).axes[0]
    assert max(len(values) for values in heights(axes)) < 4_000
    assert max(values.max() for values in heights(axes)) == pytest.approx(99.0)


def test_a_ripple_that_fills_an_area_is_pale_behind_its_average(
    long_recording: xr.Dataset,
) -> None:
    rippled = long_recording.copy()
    ripple = np.sin(2.0 * np.pi * 50.0 * long_recording["time"].values)
    rippled["i"] = ("time", 3.0 + ripple, long_recording["i"].attrs)
    rippled["i_ref"] = ("time", 3.0 + ripple, long_recording["i_ref"].attrs)
    axes = time_traces(rippled).axes[1]
    assert legend_of(axes)[:2] == [
        "motor current, 100 ms average (pale: ripple)",
        "current set point, 100 ms average",
    ]
    band, average, set_point = axes.lines
    assert np.ptp(np.asarray(band.get_ydata())) == pytest.approx(2.0, rel=1e-3)
    for line in (average, set_point):
        assert np.allclose(np.asarray(line.get_ydata(), dtype=float), 3.0, atol=0.02)
    assert band.get_zorder() < average.get_zorder()
    assert band.get_alpha() < 0.5


def test_missing_variables_are_left_out_and_nothing_at_all_is_refused(
    recording: xr.Dataset,
) -> None:
    assert len(time_traces(recording[["p_mc", "omega"]]).axes) == 2
    with pytest.raises(ParameterError, match="none of the variables"):
        time_traces(recording[["E_copper"]])


def test_a_panel_has_one_unit(recording: xr.Dataset) -> None:
    mixed = Panel("mixed", (Trace("p_mc"), Trace("i")))
    with pytest.raises(ParameterError, match="two panels"):
        time_traces(recording, panels=[mixed])


def test_unknown_variables_and_unselected_cases_are_explained(recording: xr.Dataset) -> None:
    with pytest.raises(UnknownNameError, match="p_mc"):
        step_response(recording, "p_mcc")
    with raises(ParameterError, name="p_mc", value="case", valid="time"):
        step_response(xr.concat([recording, recording], "case"), "p_mc", "p_ref")
    with pytest.raises(ParameterError, match="no samples"):
        step_response(recording.isel(time=slice(0, 0)), "p_mc", "p_ref")


def test_labels_are_never_read_as_formulas(recording: xr.Dataset) -> None:
    hostile = recording.copy()
    hostile["p_mc"].attrs = {"units": "Pa", "long_name": "cost $\\frac{ in \x1b[31m 圧力\n" * 9}
    assert figure_bytes(step_figure(hostile, limits=LIMITS), "svg").startswith(b"<?xml")
    assert figure_bytes(hysteresis_loop({"$\\bad{$": hostile}, *LOOP), "png").startswith(b"\x89PNG")
