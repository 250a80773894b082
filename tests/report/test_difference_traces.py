"""Differences of recordings over time: at the times of the first, without rounding and modes."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from bywire.report.time_traces import difference_figure, differences_from_first


def ramp(slope: float, step: float, end: float) -> xr.Dataset:
    """Return a rising pressure, a constant temperature and a mode."""
    time = np.arange(0.0, end, step)
    signals = {
        "p": ("time", slope * time, {"units": "Pa", "long_name": "pressure"}),
        "T": ("time", np.full(time.size, 300.0 + slope), {"units": "K", "long_name": "warmth"}),
        "stuck": ("time", (time > slope).astype(float), {"units": "1"}),
    }
    return xr.Dataset(signals, coords={"time": time})


def test_differences_stand_at_the_times_of_the_first_as_far_as_both_go() -> None:
    apart = differences_from_first({"a": ramp(1.0, 0.1, 3.0), "b": ramp(3.0, 0.07, 2.0)})
    (less,) = apart.values()
    assert list(apart) == ["b minus a"]
    assert set(less.data_vars) == {"p", "T"}
    assert float(less["time"][-1]) == pytest.approx(1.9)
    np.testing.assert_allclose(less["p"].values, 2.0 * less["time"].values, atol=1e-12)
    assert (less["T"].attrs["units"], float(less["T"][0])) == ("delta_degC", 2.0)


def test_what_differs_by_rounding_or_shares_no_time_has_no_figure() -> None:
    first = ramp(1.0, 0.1, 3.0)
    assert difference_figure({"a": first, "b": first * (1.0 + 1e-13)}) is None
    later = first.assign_coords(time=first["time"] + 10.0)
    assert differences_from_first({"a": first, "b": later}) == {}
