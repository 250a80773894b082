"""Second order through impacts on a wall that the step resolves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bywire.simulation.ensemble import simulate_ensemble
from convergence.observed_order import assert_order
from systems.two_mass import PARAMETERS, State, rig

STEPS = (25e-6, 20e-6, 12.5e-6, 10e-6, 8e-6, 5e-6, 4e-6)
SLIDING = {"F_c1": 0.0, "F_r1": 0.0, "F_c2": 0.0, "mu": 0.0, "cogging": 0.0}


@pytest.mark.parametrize("tau_wall", [0.0, 20e-6])
def test_bounce(tau_wall: float) -> None:
    """Two coupled masses fly onto the wall and off again; averaged over where it stands."""
    run = rig(4e-3, k_wall=1e7, tau_wall=tau_wall, record=1e-3, **SLIDING)
    run = replace(run, state=State(1.0e-4, 0.1, 1.0e-4, 0.1), stimulus=lambda t: 0.0 * t[:, None])
    cases = {"x_wall": np.linspace(1.2e-4, 1.4e-4, 32)}
    names = ["x_1", "x_2", "F_wall"]
    exact = simulate_ensemble(replace(run, step=2e-7), cases, names)
    assert np.all(exact["F_wall"].max(axis=1) > 0.0)
    assert np.all(exact["x_2"][:, -1] < 1.2e-4)
    errors = []
    for step in STEPS:
        result = simulate_ensemble(replace(run, step=step), cases, names)
        assert not result.unsettled.any()
        error = np.abs(result.values - exact.values)[:, :, :2]
        errors.append(error.mean(axis=(0, 1)))
    for name, column in zip(names[:2], np.transpose(errors), strict=True):
        assert_order(STEPS, column, 2.0, name)
    assert errors[1][0] < 1e-2 * PARAMETERS.x_wall
