"""Loops, friction curves, energy bars and frequency responses show their data."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bywire.core.errors import ParameterError, UnknownNameError
from bywire.report.energy_balance import energy_balance
from bywire.report.friction_figures import hysteresis_loop, stribeck_curve
from bywire.report.response_figures import Response, bode
from bywire.report.step_response import tracking

LOOP = ("p_mc", "i", "i_star")  # response, drive, demand

HERTZ = np.logspace(-2, 2, 50)
LAG = 10.0 / (1.0 + 1j * HERTZ)


def legend_of(axes: Axes) -> list[str]:
    legend = axes.get_legend()
    return [] if legend is None else [text.get_text() for text in legend.get_texts()]


def places(axes: Axes) -> list[np.ndarray]:
    return [np.asarray(line.get_xdata(), dtype=float) for line in axes.lines]


def heights(axes: Axes) -> list[np.ndarray]:
    return [np.asarray(line.get_ydata(), dtype=float) for line in axes.lines]


def test_loop_divides_at_the_top_of_the_demand() -> None:
    time = np.linspace(0.0, 50.0, 501)
    demand = np.where(time <= 25.0, 0.2 * time, 10.0 - 0.2 * time)
    ramp = xr.Dataset(
        {
            "p_mc": ("time", 8e5 * demand, {"units": "Pa"}),
            "i": ("time", demand + 0.1, {"units": "A"}),
            "i_star": ("time", demand, {"units": "A"}),
        },
        coords={"time": time},
    )
    drawn = hysteresis_loop({"ramp": ramp}, *LOOP).axes[0]
    applying, releasing = [v for v in places(drawn) if len(v)]
    assert applying[0] == pytest.approx(0.1)
    assert applying[-1] == releasing[0] == pytest.approx(5.1)
    with pytest.raises(ParameterError, match="at least one"):
        hysteresis_loop({}, *LOOP)


def test_loop_of_a_dithered_current_is_its_average() -> None:
    time = np.linspace(0.0, 10.0, 10_001)
    demand = np.where(time <= 5.0, time, 10.0 - time)
    ripple = np.sin(2.0 * np.pi * 50.0 * time)
    ramp = xr.Dataset(
        {
            "p_mc": ("time", 8e5 * demand, {"units": "Pa"}),
            "i": ("time", demand + ripple, {"units": "A"}),
        },
        coords={"time": time},
    )
    drawn = hysteresis_loop({"dithered": ramp}, *LOOP, average=0.02).axes[0]
    raw, applying, releasing, _ = places(drawn)
    assert raw.max() > 5.5
    assert max(applying.max(), releasing.max()) < 5.05
    assert "ripple around the average over 20 ms" in legend_of(drawn)
    raw = hysteresis_loop({"raw": ramp}, *LOOP).axes[0]
    assert not any("ripple" in name for name in legend_of(raw))


def test_stribeck_curve_is_vertical_at_rest(curve: xr.Dataset) -> None:
    drawn = stribeck_curve(curve, measured={2e5: (np.array([1.0]), np.array([5e-3]))})
    axes = drawn.axes[0]
    assert legend_of(axes) == ["2 bar", "2 bar, measured", "20 bar"]
    speed, torque = (np.asarray(v) for v in axes.lines[0].get_data())
    assert np.allclose(torque[speed == 0], [-5.2e-3, 5.2e-3])
    with pytest.raises(UnknownNameError, match="T_fr"):
        stribeck_curve(curve, friction="T_f")
    with pytest.raises(ParameterError, match="a level and a speed"):
        stribeck_curve(curve.isel(p_mc=0))


def test_tracking_shows_the_error(recording: xr.Dataset) -> None:
    error = heights(tracking(recording, "p_mc", "p_ref").axes[1])[0]
    wanted = (recording["p_ref"] - recording["p_mc"]).values / 1e5
    assert np.allclose(error, wanted)
    with pytest.raises(ParameterError, match="Choose a set point"):
        tracking(recording, "p_mc", "i_ref")


def bar_lengths(figure: Figure) -> dict[str, float]:
    """Return the length of the bars in both rows."""
    bars = {"went to": 0.0, "came from": 0.0}
    for patch in figure.axes[0].patches:
        row = "came from" if patch.get_y() > 0.5 else "went to"  # type: ignore[attr-defined]
        bars[row] += patch.get_width()  # type: ignore[attr-defined]
    return bars


def test_energy_bars_balance_and_negative_losses_give(recording: xr.Dataset) -> None:
    drawn = energy_balance(recording)
    bars = bar_lengths(drawn)
    assert bars["went to"] == pytest.approx(bars["came from"])
    names = legend_of(drawn.axes[0])
    assert any(name.startswith("gear and screw (gives)") for name in names)
    assert not any("not accounted for" in name for name in names)


def test_a_sink_has_the_same_color_in_every_figure(recording: xr.Dataset) -> None:
    def colors(figure: Figure) -> dict[str, object]:
        axes = figure.axes[0]
        bars, names = axes.get_legend_handles_labels()
        sinks = [name.split(" (gives)")[0].split(":")[0] for name in names]
        return dict(zip(sinks, bars, strict=True))

    def look(bar: object) -> object:
        return bar.patches[0].get_facecolor()  # type: ignore[attr-defined]

    whole = colors(energy_balance(recording))
    few = {"E_damping": "fluid damping", "E_other": "other", "E_gear": "gear and screw"}
    other = recording.assign(E_other=recording["E_copper"])
    part = colors(energy_balance(other, sinks=few))
    for name in ("fluid damping", "gear and screw"):
        assert look(part[name]) == look(whole[name])
    assert len({look(bar) for name, bar in part.items() if name in few.values()}) == 3


def test_energy_that_is_missing_is_shown(recording: xr.Dataset) -> None:
    drawn = energy_balance(recording.drop_vars("E_copper"))
    assert any("not accounted for" in name for name in legend_of(drawn.axes[0]))
    bars = bar_lengths(drawn)
    assert bars["went to"] == pytest.approx(bars["came from"])
    with pytest.raises(ParameterError, match="no energy"):
        energy_balance(recording.isel(time=slice(0, 1)))


def test_bode_shows_decibel_and_unwrapped_degrees() -> None:
    lag = Response("third order", HERTZ, LAG**3)
    assert lag.magnitude_db[0] == pytest.approx(60.0, abs=0.01)
    assert lag.phase_deg[-1] == pytest.approx(-270.0, abs=3.0)
    upper, lower = bode([lag], gain_unit="bar/A").axes
    assert upper.get_ylabel() == "magnitude [dB re 1 bar/A]"
    assert lower.get_ylabel() == "phase [°]"
    assert legend_of(upper) == ["third order"]


def test_bode_draws_what_exists_of_a_response() -> None:
    partial = LAG.copy()
    partial[:3] = np.nan
    assert np.isfinite(Response("partial", HERTZ, partial).phase_deg).sum() == len(HERTZ) - 3
    with pytest.raises(ParameterError, match="one per frequency"):
        Response("short", HERTZ, LAG[:-1])
    with pytest.raises(ParameterError, match="above 0 Hz"):
        Response("static", np.array([0.0]), np.array([1.0 + 0j]))
    with pytest.raises(ParameterError, match="at least one"):
        bode([])


def test_a_response_ends_where_it_has_fallen_by_the_depth() -> None:
    fast = Response("roll-off", HERTZ, 10.0 / (1.0 + 1j * HERTZ) ** 3)
    upper, lower = bode([fast], depth=40.0).axes
    for axes in (upper, lower):
        drawn = next(line for line in axes.lines if line.get_label() == "roll-off")
        assert 0 < len(drawn.get_xdata()) < len(HERTZ)
    shown = heights(upper)[0]
    assert np.ptp(shown) < 40.0
    assert len(heights(bode([fast]).axes[0])[0]) == len(HERTZ)
