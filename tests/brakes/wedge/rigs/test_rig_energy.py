"""Energy balances of both rigs close, with an error of second order in the step."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from rig_runs import drive, residual, rig

from bywire.brakes.wedge.rigs.screw_rig import ScrewRig
from bywire.brakes.wedge.rigs.shaft_rig import ShaftRig

STIMULI = {
    "theta_1_set": lambda t: 0.5 * (t > 0.01),
    "theta_2_set": lambda t: 0.7 * (t > 0.01),
    "i_1_set": lambda t: 8.0 * np.sin(25.0 * t),
    "i_2_set": lambda t: -6.0 * np.sin(40.0 * t),
}
RIGS = {
    "dummy": (ShaftRig(), {"rig.load": "dummy"}),
    "screw": (ShaftRig(), {"rig.load": "screw", "rig.mode_1": "current"}),
    "slipping clamp": (
        ShaftRig(),
        {"rig.clamp": "closed", "rig.mode_1": "current", "rig.T_clamp": 0.2},
    ),
    "loss by motor torque": (ScrewRig(), {"screw.law": "drive"}),
    "both by position": (ScrewRig(), {}),
    "current against position": (ScrewRig(), {"rig.mode_1": "current"}),
    "both by current": (ScrewRig(), {"rig.mode_1": "current", "rig.mode_2": "current"}),
}


@pytest.mark.parametrize("name", RIGS)
def test_energy_closes_with_the_square_of_the_step(name):
    model, changes = RIGS[name]
    par = rig(changes)
    own = {k: f for k, f in STIMULI.items() if k in model.Stimulus._fields}
    runs = [drive(model, par, 0.3, step, **own) for step in (40e-6, 20e-6, 10e-6)]
    assert np.abs(runs[1]["omega_1"]).max() > 10.0
    left = [float(np.abs(residual(run)).max()) for run in runs]
    assert left[1] < 1e-6 * runs[1]["E_source"].max()
    for coarse, fine in pairwise(left):
        assert coarse / fine == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize("name", RIGS)
def test_losses_only_grow(name):
    model, changes = RIGS[name]
    own = {k: f for k, f in STIMULI.items() if k in model.Stimulus._fields}
    run = drive(model, rig(changes), 0.3, **own)
    for loss in (n for n in run.names if n.startswith("E_") and n not in ("E_source", "E_stored")):
        assert np.diff(run[loss]).min() >= 0.0, loss
        assert run[loss][-1] > 0.0, loss
