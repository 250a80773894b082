"""Several records in one measurement, and files as methods take them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from bywire.core.errors import ParameterError, UnitError, UnknownNameError
from bywire.data.writing import write_measurement
from bywire.identification.measured import joined, measured, split
from raising import raises


def record(count: int, level: float, interval: float = 0.01) -> xr.Dataset:
    t = 5.0 + interval * np.arange(count)
    return xr.Dataset(
        {"p": ("time", level + np.sin(t), {"units": "Pa"})}, {"time": ("time", t, {"units": "s"})}
    )


def test_records_come_back_as_they_were() -> None:
    parts = {"low pressure": record(40, 1.0), "high": record(70, 9.0, 0.02)}
    whole = joined(parts)
    assert np.all(np.diff(whole["time"].values) > 0.0)
    back = split(whole)
    assert list(back) == ["low_pressure", "high"]
    for one, original in zip(back.values(), parts.values(), strict=True):
        np.testing.assert_array_equal(one["p"].values, original["p"].values)
        t = original["time"].values
        np.testing.assert_allclose(one["time"].values, t - t[0], atol=1e-11)


def test_records_survive_a_file(tmp_path: Path) -> None:
    whole = joined({"a": record(40, 1.0), "b": record(50, 2.0)})
    path = write_measurement(whole, tmp_path / "both.nc")
    found = measured([path], None, {"p": "Pa"})
    back = split(found.data)
    assert {label: one.sizes["time"] for label, one in back.items()} == {"a": 40, "b": 50}


def test_records_of_different_signals_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"signals \(q\)"):
        joined({"a": record(9, 1.0), "b": record(9, 1.0).assign(q=record(9, 1.0)["p"])})


def test_files_become_records_and_uneven_time_is_resampled_and_said(tmp_path: Path) -> None:
    t = np.cumsum(np.where(np.arange(200) % 7, 0.01, 0.013))
    uneven = xr.Dataset(
        {"p": ("time", 2.0 * t, {"units": "Pa"})}, {"time": ("time", t, {"units": "s"})}
    )
    paths = [write_measurement(uneven, tmp_path / f"{k}.nc") for k in "ab"]
    found = measured(paths, None, {"p": "Pa"})
    assert len(found.notes) == 2
    assert "resampled to" in found.notes[0]
    one = split(found.data)["a"]
    np.testing.assert_allclose(np.diff(one["p"].values), 0.02, rtol=1e-9)


def test_missing_signals_samples_and_wrong_units_are_refused(tmp_path: Path) -> None:
    data = record(50, 1.0)
    path = write_measurement(data, tmp_path / "m.nc")
    with pytest.raises(UnknownNameError, match="p_mc"):
        measured([path], None, {"p_mc": "Pa"})
    with raises(UnitError, name="p", value="Pa", valid="A"):
        measured([path], None, {"p": "A"})
    data["p"][7] = np.nan
    path = write_measurement(data, tmp_path / "gap.nc")
    with pytest.raises(ParameterError, match=r"1 sample, the first at 5\.07 s"):
        measured([path], None, {"p": "Pa"})
    assert np.isnan(measured([path], None, {"p": "Pa"}, gaps=True).data["p"]).sum() == 1


def test_records_keep_their_own_clocks_where_asked() -> None:
    """Experiments count from what happens at zero, which a joined time does not show."""
    t = 1e-3 * np.arange(50.0)
    parts = {
        name: xr.Dataset({"p": ("time", t)}, {"time": np.round(t + begin, 12)})
        for name, begin in (("a", -0.02), ("b", 3.0))
    }
    whole = joined(parts)
    for name, one in split(whole, own_clock=True).items():
        np.testing.assert_allclose(one["time"], parts[name]["time"], atol=1e-12)
    assert {float(one["time"][0]) for one in split(whole).values()} == {0.0}
