"""Plain rows answer what a recording answers."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from bywire.bench.rows import Rows

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
    assert "dataset" not in vars(rows)  # none was made


def test_whatever_else_is_asked_for_a_dataset_answers(rows):
    power = rows["x"] * rows["y"] + 1.0
    assert isinstance(power, xr.DataArray)
    np.testing.assert_array_equal(power, SIGNALS["x"] * SIGNALS["y"] + 1.0)
    assert float(rows["x"].max()) == 5.0
    assert np.abs(rows["y"]).values.tolist() == [0.0, 1.0, 0.0, 1.0]
    assert rows.sel(time=slice(-1e-9, None)).sizes["time"] == 3
    assert rows["x"].sel(time=0.1) == 3.0
    assert "z" in rows.assign(z=rows["x"].copy())
    assert rows[["x"]].sizes["time"] == 4
    assert np.asarray(rows["x"]).tolist() == [1.0, 2.0, 3.0, 5.0]
    with pytest.raises(KeyError):
        rows["z"]
    with pytest.raises(AttributeError):
        getattr(rows, "nothing")  # noqa: B009
