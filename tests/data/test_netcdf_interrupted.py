"""Ctrl-C while a recording is written."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import bywire


@pytest.mark.parametrize("write", [bywire.write_recording, bywire.write_measurement])
def test_ctrl_c_waits_until_the_library_has_let_go_of_its_locks(
    write: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps = []
    to_netcdf = xr.Dataset.to_netcdf

    def interrupted(self: xr.Dataset, *args: Any, **kwargs: Any) -> Any:
        signal.raise_signal(signal.SIGINT)
        steps.append("goes on")
        return to_netcdf(self, *args, **kwargs)

    monkeypatch.setattr(xr.Dataset, "to_netcdf", interrupted)
    time = ("time", np.linspace(0.0, 1.0, 3), {"units": "s"})
    signals = {"p": ("time", np.zeros(3), {"units": "Pa"})}
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            write(xr.Dataset(signals, coords={"time": time}), tmp_path / "run.nc")
    finally:
        signal.signal(signal.SIGINT, before)
    assert steps == ["goes on"]
    assert not (tmp_path / "run.nc").exists()  # nothing half
