"""Plain rows have the same content as a recording."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from bywire.bench.recording import Rows

TIME = np.array([-0.1, 0.0, 0.1, 0.2])
SIGNALS = {"x": np.array([1.0, 2.0, 3.0, 5.0]), "y": np.array([0.0, 1.0, 0.0, -1.0])}


@pytest.fixture
def rows():
    return Rows(TIME, SIGNALS, {"x": {"units": "m"}, "y": {"units": "N"}})


def test_what_figures_and_warnings_ask_for(rows):
    assert {"x", "y"} <= set(rows)
    assert "x" in rows
    assert "z" not in rows
    assert (rows["x"].dims, rows["x"].size, rows["x"].ndim, len(rows["x"])) == (("time",), 4, 1, 4)
    assert rows["time"].values is TIME
    assert rows["y"].attrs["units"] == "N"
    assert rows.sizes["time"] == 4
    assert {name: each.values.tolist() for name, each in rows.items()} == {
        name: values.tolist() for name, values in SIGNALS.items()
    }
    assert "dataset" not in vars(rows)  # none was made


@pytest.mark.parametrize(("begin", "end"), [(-1e-9, None), (None, 0.1), (0.05, 0.15), (0.2, 0.0)])
def test_windows_sums_and_extremes_are_those_of_a_dataset(rows, begin, end):
    recording, window = rows.dataset, slice(begin, end)
    del rows.dataset
    power = rows["x"] * rows["y"] + 1.0
    np.testing.assert_array_equal(power, SIGNALS["x"] * SIGNALS["y"] + 1.0)
    seen, same = (each.sel(time=window) for each in (rows, recording))
    assert seen["time"].values.tolist() == same["time"].values.tolist()
    assert seen["x"].values.tolist() == rows["x"].sel(time=window).values.tolist()
    assert seen.sizes["time"] == same.sizes["time"]
    assert seen["y"].attrs == same["y"].attrs
    if same.sizes["time"]:
        for name in ("max", "min", "mean"):
            assert float(getattr(seen["x"], name)()) == float(getattr(same["x"], name)())
    assert np.abs(rows["y"]).values.tolist() == [0.0, 1.0, 0.0, 1.0]
    assert float(np.abs(rows["y"]).max()) == 1.0
    more = rows.assign(z=("time", TIME, {"units": "s"}), y=0.0 - rows["y"])
    assert list(more) == ["x", "y", "z"]
    assert more["y"].values.tolist() == [0.0, -1.0, 0.0, 1.0]
    assert more.isel(time=slice(None, 2))["z"].values.tolist() == [-0.1, 0.0]
    assert "dataset" not in vars(rows)  # none was made


def test_a_missing_value_is_left_out_of_extremes(rows):
    holed = rows.assign(x=("time", np.array([1.0, np.nan, 3.0, 5.0])))["x"]
    assert [float(holed.max()), float(holed.min()), float(holed.mean())] == [5.0, 1.0, 3.0]


def test_whatever_else_is_asked_for_a_dataset_answers(rows):
    assert isinstance(rows["x"] * rows.dataset["y"], xr.DataArray)
    assert rows["x"].sel(time=0.1) == 3.0
    assert rows["x"].cumsum().values.tolist() == [1.0, 3.0, 6.0, 11.0]
    assert "z" in rows.assign(z=rows["x"].copy())
    assert rows[["x"]].sizes["time"] == 4
    assert np.asarray(rows["x"]).tolist() == [1.0, 2.0, 3.0, 5.0]
    with pytest.raises(KeyError):
        rows["z"]
    with pytest.raises(AttributeError):
        getattr(rows, "nothing")  # noqa: B009
