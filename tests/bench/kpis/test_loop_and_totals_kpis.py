"""Hysteresis, effort and occupation compared with closed forms; the list of all key figures."""

import math

import numpy as np
import pytest
import xarray as xr

from bywire.bench.kpis import effort, families, hysteresis, occupation, release, warming
from bywire.bench.kpis.samples import smoothed

LAG = 0.3


def loop(t, i, p, smoothing=0.0):
    recording = xr.Dataset(
        {"i": ("time", i, {"units": "A"}), "p_mc": ("time", p, {"units": "Pa"})},
        {"time": ("time", t)},
    )
    return families.evaluate("hysteresis", recording, hysteresis.Setting("i", "p_mc", smoothing))


@pytest.mark.parametrize("start", [0.0, 1.0, 4.0])
def test_ellipse(start):
    phase = start + np.linspace(0.0, 2 * math.pi, 20_001)
    found = loop(phase, 3 + 2 * np.cos(phase), 2e6 + 1e6 * np.cos(phase - LAG))
    width = 2 * 2 * math.sin(LAG)
    assert found["loop_width_mid"].value == pytest.approx(width, rel=1e-4)
    assert found["loop_width_max"].value == pytest.approx(width, rel=1e-4)
    assert found["loop_area"].value == pytest.approx(math.pi * 2 * 1e6 * math.sin(LAG), rel=1e-6)
    assert found["loop_area"].unit == "A*Pa"


def play(friction):
    """Ramp (17) on a brake with backlash: a parallelogram of known widths and area."""
    t = np.linspace(0.0, 50.0, 50_001)
    i = np.where(t <= 25, 0.2 * t, 10 - 0.2 * t)
    p = np.where(t <= 25, np.maximum(i - friction, 0), np.minimum(5 - friction, i + friction))
    return t, i, 1e6 * p


def test_play_keeps_a_rest_of_response_and_says_so():
    t, i, p = play(0.5)
    found = loop(t, i, p)
    assert found["loop_width_mid"].value == pytest.approx(1.0, abs=1e-3)
    assert found["loop_width_max"].value == pytest.approx(1.0, abs=1e-3)
    assert found["loop_area"].value == pytest.approx(1e6 * (4.5 * 1.0 - 0.5**2 / 2), rel=1e-3)
    assert "ends 5 bar away" in found["loop_area"].note


def test_dither_hardly_moves_the_smoothed_loop():
    t, i, p = play(0.5)
    found = loop(t, i + 0.4 * np.sin(2 * np.pi * 50 * t), p, smoothing=0.02)
    assert found["loop_width_mid"].value == pytest.approx(1.0, abs=5e-3)
    assert found["loop_width_max"].value == pytest.approx(1.0, abs=2e-2)


def test_what_is_no_single_loop_has_no_width():
    t, i, p = play(0.5)
    half = t <= 25
    assert "the loop is open" in loop(t[half], i[half], p[half])["loop_area"].note
    assert "constant" in loop(t, i, 0 * p)["loop_area"].note
    twice = (np.append(x, x[1:]) for x in (i, p))
    found = loop(np.linspace(0, 1, 2 * t.size - 1), *twice)
    assert all(math.isnan(kpi.value) and "2 loops" in kpi.note for kpi in found.values())
    t, i, p = play(2.0)
    assert "above mid-height" in loop(t, i, p)["loop_width_mid"].note


def test_effort_of_a_sine():
    t = np.linspace(0.0, 1.0, 10_001)
    i = -3 * np.sin(2 * math.pi * t)
    power = 1 + 2 * t
    recording = xr.Dataset({"i": ("time", i), "P_el": ("time", power)}, {"time": ("time", t)})
    found = families.evaluate("effort", recording, effort.Setting())
    expected = {
        "peak_current": 3,
        "mean_current": 6 / math.pi,
        "peak_power": 3,
        "mean_power": 2,
        "energy": 2,
    }
    assert {k: v.value for k, v in found.items()} == pytest.approx(expected, rel=1e-6)
    recording["E_source"] = ("time", 5 + 7 * t)  # integrated between the samples, therefore used
    found = families.evaluate("effort", recording, effort.Setting())
    assert found["energy"].value == pytest.approx(7)
    empty = families.evaluate(
        "effort", recording.drop_vars(["i", "P_el", "E_source"]), effort.Setting()
    )
    assert all(math.isnan(kpi.value) and "recorded" in kpi.note for kpi in empty.values())


def test_occupation_of_modes():
    t = np.array([0.0, 1.0, 2.0, 4.0])  # unequal: weighted by time, not by samples
    recording = xr.Dataset(
        {"stuck": ("time", [1.0, 1.0, 0.0, 0.0]), "sat_duty": ("time", [0.0, 0.5, 0.0, 0.0])},
        {"time": ("time", t)},
    )
    found = families.evaluate("occupation", recording, occupation.Setting())
    assert found["share_stuck"].value == pytest.approx(1.5 / 4)
    assert "not recorded" in found["share_sat_current"].note
    assert "values other than 0 and 1" in found["share_sat_duty"].note
    recording["t_stuck"] = ("time", [0.0, 1.0, 1.2, 1.2])
    found = families.evaluate("occupation", recording, occupation.Setting())
    assert found["share_stuck"].value == pytest.approx(0.3)


def test_moving_average_of_a_period_is_exact_on_ramps_and_blind_to_ripple():
    t = np.linspace(0.0, 1.0, 1001)
    ramp = smoothed(t, 3 * t, 0.02)
    np.testing.assert_allclose(ramp[10:-10], 3 * t[10:-10], atol=1e-12)
    ripple = smoothed(t, np.sin(2 * np.pi * 50 * t), 0.02)
    assert np.max(np.abs(ripple)) < 1e-12
    np.testing.assert_array_equal(smoothed(t, ramp, 0.0), ramp)


def test_every_figure_is_declared_for_listings():
    found = families.definitions()
    known = families.FAMILIES.all().values()
    assert set(found) == {name for family in known for name in family.measures}

    assert {"rise_time", "energy", "share_stuck", "loop_area"} <= set(found)
    for figure in found.values():
        assert figure.definition.endswith(".")
        assert figure.unit


def test_time_to_empty_lies_between_the_rows():
    """Of exp(-t / T) below a level: T ln(1 / level), though rows are 10 ms apart."""
    t = np.arange(0.0, 2.0, 1e-2)
    p = ("time", np.exp(-t / 0.4), {"units": "Pa"})
    recording = xr.Dataset({"p": p}, {"time": ("time", t)})
    found = families.evaluate("release", recording, release.Setting("p", 0.1))
    exact = 0.4 * math.log(10.0)
    assert found["time_to_empty"].value == pytest.approx(exact, abs=1e-2**2 / 8 / 0.4)
    assert abs(np.min(np.abs(t - exact))) > 1e-3


def test_of_several_windings_the_hottest_counts():
    t = np.linspace(0.0, 10.0, 101)
    rows = {
        "p": ("time", 2e6 - 1e5 * t, {"units": "Pa"}),
        "T_winding_1": ("time", 300.0 + 10.0 * t, {"units": "K"}),
        "T_winding_2": ("time", np.where(t < 4.05, 380.0, 310.0), {"units": "K"}),
        "derated": ("time", np.where((t > 0.95) & (t < 4.05), 1.0, 0.0), {"units": "1"}),
    }
    found = families.evaluate("warming", xr.Dataset(rows, {"time": t}), warming.Setting("p"))
    assert found["peak_winding"].value == pytest.approx(400.0)
    assert found["final_winding"].value == pytest.approx(400.0)
    assert found["derated_after"].value == pytest.approx(1.0)
    assert found["time_derated"].value == pytest.approx(3.1)
    assert found["final_output"].value == pytest.approx(2e6 - 9.5e5, rel=1e-9)
    assert found["final_output"].unit == "Pa"
    bare = xr.Dataset({"p": rows["p"]}, {"time": t})
    none = families.evaluate("warming", bare, warming.Setting("p"))
    assert math.isnan(none["peak_winding"].value)
    assert math.isnan(none["time_derated"].value)


def narrowing(width: float, closed_from: float) -> hysteresis.Loop:
    """Return a loop whose width decreases linearly to zero at a level."""
    up = np.linspace(0.0, 10.0, 101)
    half = 0.5 * width * np.clip(1.0 - up / closed_from, 0.0, None)
    y = np.concatenate((up, up[::-1][1:]))
    x = np.concatenate((up + half, (up - half)[::-1][1:]))
    return hysteresis.Loop(np.arange(y.size, dtype=float), x, y)


def test_widths_and_the_level_from_which_a_loop_is_closed() -> None:
    loop, levels = narrowing(2.0, 5.0), np.arange(0.5, 9.9, 0.1)
    expected = 2.0 * np.clip(1.0 - levels / 5.0, 0.0, None)
    np.testing.assert_allclose(hysteresis.widths(loop, levels), expected, atol=1e-9)
    assert hysteresis.closed_above(loop, 0.4, levels) == pytest.approx(4.0, abs=0.11)
    assert hysteresis.closed_above(loop, 3.0, levels) == pytest.approx(levels[0])
    assert math.isnan(hysteresis.closed_above(loop, -1.0, levels))
    assert np.isnan(hysteresis.widths(loop, np.array([11.0]))[0])
