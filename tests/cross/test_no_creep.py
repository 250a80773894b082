"""Below breakaway the shaft does not move at all, above it it does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bywire.bench.experiment import as_run, fixed
from bywire.brakes.motorcycle.case import case_from_rest
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current
from bywire.core.catalog import PARAMETER_SETS
from bywire.simulation.run import Run, Trajectory, simulate
from cross.motorcycle_reference import plant_of
from reference.event_driven import excess

P_HELD = 10e5


def held_at(share: float, sigma: int, law: str, mode: str, duration: float) -> Run:
    """Return a run from rest at 10 bar with a share of the breakaway torque applied."""
    par = PARAMETER_SETS.find("dardanelli2010").parameters().replace({"gear.law": law})
    assert isinstance(par, MotorcycleParameters)
    plant, i = plant_of(par), holding_current(P_HELD, par)
    breakaway = -excess(plant, sigma, i, P_HELD) / plant.direction(sigma)[0]
    wanted = i + sigma * share * breakaway
    level = {"i_set": wanted} if mode == "current-source" else {"v_set": par.motor.R_m * wanted}
    case = case_from_rest("held", par, mode, P_HELD, fixed(**level), duration, record=1e-3)
    current = wanted if mode == "voltage-source" else case.state.i  # its winding is at rest too
    return as_run(replace(case, state=case.state._replace(i=current)), 20e-6)


def moved(result: Trajectory) -> float:
    return float(result["theta"][-1] - result["theta"][0])


@pytest.mark.parametrize("mode", ["current-source", "voltage-source"])
@pytest.mark.parametrize("law", ["paper", "directional"])
@pytest.mark.parametrize("sigma", [1, -1])
def test_stuck_below_and_moving_above(sigma: int, law: str, mode: str) -> None:
    below = simulate(held_at(0.9, sigma, law, mode, 10.0))
    assert np.ptp(below["theta"]) == 0.0
    assert np.all(below["omega"] == 0.0)
    assert np.all(below["stuck"] == 1.0)
    assert below["t_stuck"][-1] == pytest.approx(10.0, abs=1e-9)
    assert np.ptp(below["p_mc"]) < 1e-6 * P_HELD
    above = simulate(held_at(1.02, sigma, law, mode, 1.0))
    assert sigma * moved(above) > 0.1
    assert above["t_stuck"][-1] < 0.99
