"""Key figures of step responses compared with closed forms of first and second order."""

import math

import numpy as np
import pytest
import xarray as xr

from bywire.bench.kpis import hysteresis, release, sine_sweep, static_gain, step_response, tracking
from bywire.bench.kpis.families import evaluate
from bywire.bench.kpis.step_response import Setting
from bywire.bench.requirements import judge, read_limits
from bywire.core.errors import ParameterError, UnknownNameError
from raising import raises


def recorded(y, t):
    return xr.Dataset(
        {"p": ("time", np.asarray(y, dtype=float), {"units": "Pa"})}, {"time": ("time", t)}
    )


def figures(y, t, **setting):
    given = {"t_step": 1.0, "start": 0.0, "end": 1.0} | setting
    return evaluate("step_response", recorded(y, t), Setting("p", **given))


T = np.linspace(0.0, 3.0, 3001)
AFTER = np.maximum(T - 1.0, 0.0)


@pytest.mark.parametrize(("start", "end"), [(0.0, 1.0), (30e5, 10e5)])
def test_first_order_lag_with_dead_time(start, end):
    tau, dead = 0.1, 0.02
    z = 1 - np.exp(-np.maximum(AFTER - dead, 0) / tau)
    found = figures(start + (end - start) * z, T, start=start, end=end)
    expected = {
        "dead_time": dead - tau * math.log(0.95),
        "rise_time": tau * math.log(9),
        "settling_time": dead + tau * math.log(50),
        "overshoot": 0.0,
    }
    for name, value in expected.items():
        assert found[name].value == pytest.approx(value, abs=2e-5), name
        assert found[name].note == ""
    assert found["steady_state_error"].value == pytest.approx(0.0, abs=1e-6 * abs(end - start))
    assert found["ripple"].value < 1e-6 * abs(end - start)
    assert found["ripple"].unit == "Pa"


def test_second_order_overshoot_and_settling():
    zeta, w = 0.3, 20.0
    wd = w * math.sqrt(1 - zeta**2)
    envelope = np.exp(-zeta * w * AFTER)
    z = 1 - envelope * (np.cos(wd * AFTER) + zeta * w / wd * np.sin(wd * AFTER))
    found = figures(z, T)
    peak = 100 * math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2))
    assert found["overshoot"].value == pytest.approx(peak, abs=0.01)
    fine = np.linspace(0.0, 2.0, 2_000_001)
    y = np.exp(-zeta * w * fine) * (np.cos(wd * fine) + zeta * w / wd * np.sin(wd * fine))
    last = fine[np.flatnonzero(np.abs(y) > 0.02)[-1]]
    assert found["settling_time"].value == pytest.approx(last, abs=2e-5)


def test_steady_state_of_a_rippled_response():
    y = np.where(T >= 1, 0.9 + 0.05 * np.sin(2 * np.pi * 50 * T), 0.0)
    found = figures(y, T, window=(2.0, 2.5))
    assert found["steady_state_error"].value == pytest.approx(0.1, abs=1e-4)
    assert found["ripple"].value == pytest.approx(0.1, abs=1e-4)
    assert math.isnan(found["settling_time"].value)


def test_smoothing_removes_the_ripple_and_says_so():
    tau = 0.2
    y = 1 - np.exp(-AFTER / tau) + 0.05 * np.sin(2 * np.pi * 50 * T)
    found = figures(y, T, smoothing=0.02)
    assert found["settling_time"].value == pytest.approx(tau * math.log(50), abs=2e-3)
    assert found["rise_time"].value == pytest.approx(tau * math.log(9), abs=2e-3)
    assert found["rise_time"].note == "moving average over 20 ms"
    assert math.isnan(figures(y, T)["settling_time"].value)


def test_levels_are_measured_where_no_set_point_is_given():
    y = 5.0 + 2.0 * (1 - np.exp(-AFTER / 0.1))
    found = figures(y, T, start=None, end=None)
    assert found["rise_time"].value == pytest.approx(0.1 * math.log(9), abs=1e-4)
    assert "no set point" in found["steady_state_error"].note
    noise = figures(5.0 + 0.1 * np.sin(50 * T), T, start=None, end=None)
    assert "less than its ripple" in noise["rise_time"].note


def assert_undefined(kpi, reason):
    assert math.isnan(kpi.value)
    assert reason in kpi.note


def test_what_is_not_defined_is_nan_with_a_reason():
    lag = 1 - np.exp(-AFTER / 0.1)
    assert_undefined(figures(lag, T, end=0.0)["overshoot"], "step height is zero")
    assert_undefined(figures(0.5 * lag, T)["rise_time"], "never reaches 90 %")
    assert_undefined(figures(1.1 * lag, T)["settling_time"], "never settles")
    late = figures(np.minimum(0.5 * AFTER, 1.0), T)["settling_time"]
    assert_undefined(late, "before the recording ends")
    sooner = figures(np.minimum(AFTER / 1.79, 1.0), T)["settling_time"]  # 0.12 of the time before
    assert sooner.value == pytest.approx(0.98 * 1.79, abs=1e-3)
    twice = np.sort(np.append(T, 2.0))
    assert_undefined(figures(np.append(lag, 1.0), twice)["rise_time"], "times do not increase")
    assert_undefined(figures(0.5 + lag, T)["dead_time"], "already at 50 %")
    assert_undefined(figures(lag, T, window=(7.0, 8.0))["ripple"], "contains fewer than 2 samples")
    assert_undefined(
        figures(lag, T, end=None, window=(7.0, 8.0))["rise_time"], "fewer than 2 samples"
    )
    assert_undefined(figures(lag, T, t_step=3.0)["rise_time"], "outside the recording, 0 to 3 s")
    assert_undefined(figures(lag[:1], T[:1])["rise_time"], "too few")
    lag[7] = math.nan
    assert all("not a number at 0.007 s" in kpi.note for kpi in figures(lag, T).values())


def test_a_wrong_signal_is_an_input_error():
    recording = recorded(T, T)
    with raises(UnknownNameError, value="q"):
        evaluate("step_response", recording, Setting("q", 1.0))
    with raises(ParameterError, name="p", value="('case', 'time')", valid="time"):
        evaluate("step_response", recording.expand_dims(case=2), Setting("p", 1.0))


def judged(y, **setting):
    """Return the figures of a response at 0..1 s to a step from 0 to 1 at time zero."""
    t = np.linspace(0.0, 1.0, y.size)
    recording = xr.Dataset({"y": ("time", y, {"units": "m"})}, {"time": t})
    chosen = step_response.Setting("y", 0.0, **{"start": 0.0, "end": 1.0, **setting})
    return evaluate("step_response", recording, chosen)


def outcomes(kpis, **limits):
    """Return the outcome of each requirement."""
    units = {name: kpi.unit for name, kpi in kpis.items()}
    return [each.outcome for each in judge(read_limits(limits, units).values(), kpis.values())]


ROWS = np.linspace(0.0, 1.0, 1001)


@pytest.mark.parametrize("level", [0.0, 0.04, 1.0])
def test_a_brake_that_does_not_move_has_no_figures_of_a_step(level):
    found = judged(np.linspace(0.0, level, 1001) if level < 1.0 else np.ones(1001))
    for name in ("dead_time", "rise_time", "settling_time", "overshoot", "ripple"):
        assert math.isnan(found[name].value), name
        assert found[name].is_open, name
        assert "hardly changes" in found[name].note, name
    assert outcomes(found, overshoot="<= 15 %", settling_time="<= 2 s") == ["undecided"] * 2
    assert outcomes(judged(np.ones(1001), end=None), overshoot="<= 15 %") == ["undecided"]


def test_a_response_that_still_moves_leaves_open_how_far_it_goes():
    rising = judged(0.5 * ROWS)  # drifts by 5 % from half to half of the last fifth
    assert (
        outcomes(rising, overshoot="<= 15 %", steady_state_error="<= 1 m", ripple="<= 1 m")
        == ["undecided"] * 3
    )
    assert "by 5 % of the step height" in rising["overshoot"].note
    assert rising["dead_time"].value == pytest.approx(0.1)
    assert outcomes(rising, settling_time="<= 0.5 s") == ["missed"]
    swinging = judged(1.0 + 0.3 * ROWS * np.sin(40.0 * ROWS))
    assert swinging["overshoot"].is_open
    without = judged(0.5 * ROWS, end=None)
    assert all(kpi.is_open for name, kpi in without.items() if name != "steady_state_error")


def test_a_response_at_rest_has_its_figures():
    rippled = judged(1.0 - np.exp(-20.0 * ROWS) + 0.03 * np.sin(2.0 * np.pi * 50.0 * ROWS))
    assert rippled["ripple"].value == pytest.approx(0.06, rel=1e-2)
    assert rippled["overshoot"].value == pytest.approx(3.0, rel=1e-2)
    stuck = judged(0.6 * (1.0 - np.exp(-20.0 * ROWS)))  # at rest, and short of the set point
    assert stuck["steady_state_error"].value == pytest.approx(0.4, rel=1e-3)
    assert outcomes(
        stuck, overshoot="<= 15 %", steady_state_error="<= 0.1 m", settling_time="<= 1 s"
    ) == ["undecided", "missed", "missed"]
    lag = judged(1.0 - np.exp(-20.0 * ROWS))
    assert outcomes(lag, overshoot="<= 15 %") == ["met"]


def test_other_families_have_no_figures_of_what_does_not_move():
    zero = np.zeros(ROWS.size)
    signals = {"y": zero, "u": np.sin(2.0 * np.pi * 5.0 * ROWS), "held": np.full(ROWS.size, 0.7)}
    recording = xr.Dataset(
        {name: ("time", values, {"units": "m"}) for name, values in signals.items()},
        {"time": ROWS},
    )
    settings = {
        "static_gain": static_gain.Setting("y", 0.0, 0.5, "A"),
        "release": release.Setting("y", 0.02),
        "sine_sweep": sine_sweep.Setting("u", "held", ((5.0, 0.2, 0.8),)),
        "hysteresis": hysteresis.Setting("u", "held"),
        "tracking": tracking.Setting("held", "u"),
    }
    found = {}
    for family, setting in settings.items():
        found |= evaluate(family, recording, setting)
    for name in (
        "static_gain",
        "time_to_empty",
        "sweep_gain",
        "sweep_peak",
        "sweep_bandwidth",
        "sweep_lag",
        "loop_width_mid",
        "loop_area",
        "tracking_lag",
    ):
        assert math.isnan(found[name].value), name
        assert found[name].is_open, name
