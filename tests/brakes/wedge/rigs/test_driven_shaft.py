"""The shaft alone, under the current and force of a whole rig, moves as it does there."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from bywire.bench.experiment import Case
from bywire.brakes.wedge.experiments import run_down
from bywire.brakes.wedge.experiments.screw_efficiency import LOAD_SWEEP
from bywire.brakes.wedge.rigs.shaft_rig import DrivenShaft, Load
from bywire.core.catalog import parameters
from bywire.identification.output_error import trial
from bywire.identification.trust import Sensor, sensed
from bywire.simulation.run import simulate

STEP = 20e-6


def moved(case: Case, own: xr.Dataset, step: float) -> np.ndarray:
    """Return the angle of the shaft alone."""
    first = own.isel(time=0)
    one = trial(
        DrivenShaft(),
        case.par,
        own,
        {"i": "i", "F": "F"},
        {"theta": 1.0},
        step=step,
        state=DrivenShaft.State(float(first["theta"]), float(first["omega"])),
        memory=Load(float(first["i"]), float(first["F"])),
    )
    return simulate(one.run, ("theta",))["theta"]


def test_coasting_on_the_single_motors_rig() -> None:
    """From 180 rad/s to rest."""
    par = parameters("roberts2003")
    case = run_down.EXPERIMENT.cases(par, run_down.EXPERIMENT.defaults, None)[0]
    sensors = {"theta": Sensor("theta_1"), "omega": Sensor("omega_1"), "i": Sensor("i_1")}
    own = sensed(case, sensors, np.random.default_rng(1)).isel(time=slice(20, None))
    own["F"] = 0.0 * own["i"]
    theta = moved(case, own, STEP)
    assert float(own["omega"][-1]) == 0.0
    travel = float(np.ptp(own["theta"].values))
    assert np.abs(theta - own["theta"].values).max() < 2e-4 * travel


def test_under_the_force_of_the_other_screw() -> None:
    """A stroke of 6 rad that the screw drives against a force: friction and load have their signs.

    The current and the force hold for a millisecond each, which is what the difference shows.
    """
    par = parameters("roberts2003").replace({"rig.load": "screw"})
    options = LOAD_SWEEP.defaults.replace({"levels": 1, "i_drive": 6.0})
    case = LOAD_SWEEP.cases(par, options, None)[0]
    sensors = {
        "theta": Sensor("theta_1"),
        "omega": Sensor("omega_1"),
        "i": Sensor("i_1"),
        "F": Sensor("F"),
    }
    own = sensed(case, sensors, np.random.default_rng(1)).sel(time=slice(0.4, 0.65))
    axis = own["time"].values - own["time"].values[0]
    own = own.assign_coords(time=("time", axis)).assign(F=("time", -own["F"].values))
    theta = moved(case, own, STEP)
    travel = float(np.ptp(own["theta"].values))
    assert travel > 2.0
    assert np.abs(theta - own["theta"].values).max() < 0.05 * travel
    wrong = moved(case, own.assign(F=-own["F"]), STEP)
    assert np.abs(wrong - own["theta"].values).max() > 0.5 * travel


@pytest.mark.parametrize("load", ["dummy", "screw"])
def test_the_dummy_shaft_counts_where_it_is_mounted(load: str) -> None:
    par = parameters("roberts2003").replace({"rig.load": load})
    J = DrivenShaft().mass(DrivenShaft.State(0.0, 0.0), par).omega
    more = par.rig.J_dummy if load == "dummy" else 0.0
    assert pytest.approx(par.motor_1.J_M + more) == J
