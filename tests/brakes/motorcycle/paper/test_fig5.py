"""Jumps of the pressure staircase in Fig. 5."""

import numpy as np
import xarray as xr

from bywire.brakes.motorcycle.paper.friction import _jump_levels


def test_jumps_are_listed_with_their_levels_and_creeping_is_not() -> None:
    p = np.array([0, 0, 1, 2, 2, 2, 5, 5, 5.01, 5.01, 4, 4]) * 1e5
    stuck = np.array([1, 1, 0, 0, 1, 1, 0, 1, 0, 1, 0, 1.0])
    recording = xr.Dataset(
        {"p_mc": ("time", p), "stuck": ("time", stuck)}, coords={"time": np.arange(12.0)}
    )
    np.testing.assert_allclose(_jump_levels(recording), [2e5, 5e5])
    assert _jump_levels(recording.assign(stuck=("time", np.ones(12)))).size == 0
