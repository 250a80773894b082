"""Jumps of a staircase of pressure."""

import numpy as np
import xarray as xr

from bywire.brakes.motorcycle.staircase import jumps


def test_jumps_are_counted_with_their_heights_and_creeping_is_not() -> None:
    p = np.array([0, 0, 1, 2, 2, 2, 5, 5, 5.01, 5.01, 4, 4]) * 1e5
    stuck = np.array([1, 1, 0, 0, 1, 1, 0, 1, 0, 1, 0, 1.0])
    recording = xr.Dataset(
        {"p_mc": ("time", p), "stuck": ("time", stuck)}, coords={"time": np.arange(12.0)}
    )
    found = jumps(recording)
    np.testing.assert_allclose(found.rises, [2e5, 3e5])
    np.testing.assert_allclose(found.levels, [2e5, 5e5])
    np.testing.assert_allclose(found.times, [1.0, 5.0])
    assert jumps(recording.assign(stuck=("time", np.ones(12)))).levels.size == 0
