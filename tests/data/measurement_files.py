"""What the tests of measurement files share: a measurement, and a file of it in every format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from bywire.data.writing import write_measurement

NEEDS = {"parquet": "pyarrow", "mat73": "h5py", "mdf4": "asammdf"}
FORMATS = {
    "csv": ".csv",
    "tsv": ".tsv",
    "parquet": ".parquet",
    "mat": ".mat",
    "mat73": ".mat",
    "mdf4": ".mf4",
    "netcdf": ".nc",
}


def measurement(size: int = 400, seed: int = 0) -> xr.Dataset:
    """Return two noisy signals on one uneven time axis, one with a hole."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.5, 1.5, size)) * 1e-3
    pressure, way = rng.standard_normal((2, size))
    pressure[5:9] = np.nan
    return xr.Dataset(
        {
            "p_mc": ("time", 1e5 * pressure, {"units": "Pa", "long_name": "pressure"}),
            "x_mc": ("time", way, {"units": "m", "long_name": "way"}),
        },
        coords={"time": ("time", time, {"units": "s", "long_name": "time"})},
    )


def with_slow_signal(dataset: xr.Dataset) -> xr.Dataset:
    """Return a measurement with one more signal on instants of its own."""
    time, values = np.arange(50) * 0.02, np.random.default_rng(1).standard_normal(50)
    slow = ("time_T", values, {"units": "K", "long_name": "temperature"})
    return dataset.assign(T=slow).assign_coords(time_T=("time_T", time, {"units": "s"}))


def file_of(folder: Path, name: str, dataset: xr.Dataset | None = None) -> Path:
    """Write a measurement in a format and return its path."""
    chosen = measurement() if dataset is None else dataset
    return write_measurement(chosen, folder / f"run{FORMATS[name]}", format=name, overwrite=True)
