"""Pedal tracking: the lag with the best fit, and cases without one."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr

import bywire
from bywire.bench.experiment import EXPERIMENTS
from bywire.brakes.motorcycle.experiments import pedal_tracking
from bywire.core.errors import ParameterError
from raising import raises

SET = "dardanelli2010"
T = np.arange(0.0, 10.0, 1e-3)


def judged(lag: float, demand=lambda t: 20e5 + 5e5 * np.sin(2.0 * np.pi * 0.4 * t)) -> dict:
    """Return the KPIs of a pressure that follows its set point with a delay [s]."""
    signals = {"p_ref": demand(T), "p_mc": demand(T - lag)}
    variables = {name: ("time", y, {"units": "Pa"}) for name, y in signals.items()}
    run = xr.Dataset(variables, coords={"time": ("time", T, {"units": "s"})})
    experiment = EXPERIMENTS.find("pedal-tracking")
    options = experiment.defaults.replace({"smoothing": 0.0})
    return {kpi.name: kpi for kpi in experiment.judge({"run": run}, options)}


@pytest.mark.parametrize("lag", [0.003, 0.05, 0.1234, 0.29])
def test_lag_is_found(lag):
    found = judged(lag)
    assert found["tracking_lag"].value == pytest.approx(lag, abs=2e-3)
    assert found["tracking_rms_without_lag"].value < 0.3 * found["tracking_rms"].value


@pytest.mark.parametrize(
    ("lag", "reason"),
    [
        (0.4, "not below 0.3 s"),
        (0.3, "not below 0.3 s"),
        (-0.1, "a delay of zero"),
        (0.0, "a delay of zero"),
    ],
)
def test_lag_on_the_edge_of_the_search_is_none(lag, reason):
    found = judged(lag)
    for name in ("tracking_lag", "tracking_rms_without_lag"):
        assert math.isnan(found[name].value)
        assert reason in found[name].note
    assert math.isfinite(found["tracking_rms"].value)


def test_set_point_that_does_not_move_has_no_lag():
    found = judged(0.1, lambda t: np.full(t.shape, 20e5))
    for name in ("tracking_lag", "tracking_rms_without_lag"):
        assert math.isnan(found[name].value)
        assert found[name].note == "the set point does not change"


def test_built_in_ride_beyond_a_shorter_pedal_is_refused():
    with raises(ParameterError, name="pedal", value="37 mm", valid="30 mm"):
        bywire.Bench("pedal-tracking", SET, {"pedal.x_max": "30 mm"})
    assert max(pedal_tracking._TRAVELS) == 37
