"""Key figures of step responses against the closed forms of lags of first and second order."""

import math

import numpy as np
import pytest
import xarray as xr

from bywire.bench.kpis.registry import evaluate
from bywire.bench.kpis.step_response import Setting
from bywire.core.errors import ParameterError, UnknownNameError


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
    assert found["rise_time"].note == "of the moving average over 0.02 s"
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
    assert_undefined(figures(0.5 + lag, T)["dead_time"], "already at 50 %")
    assert_undefined(figures(lag, T, window=(7.0, 8.0))["ripple"], "holds < 2 samples")
    assert_undefined(figures(lag, T, end=None, window=(7.0, 8.0))["rise_time"], "< 2 samples")
    assert_undefined(figures(lag, T, t_step=3.0)["rise_time"], "outside 0 to 3 s")
    assert_undefined(figures(lag[:1], T[:1])["rise_time"], "too few")
    lag[7] = math.nan
    assert all("not a number at 0.007 s" in kpi.note for kpi in figures(lag, T).values())


def test_a_wrong_signal_is_an_input_error():
    recording = recorded(T, T)
    with pytest.raises(UnknownNameError, match="'q'"):
        evaluate("step_response", recording, Setting("q", 1.0))
    with pytest.raises(ParameterError, match="select one case"):
        evaluate("step_response", recording.expand_dims(case=2), Setting("p", 1.0))
