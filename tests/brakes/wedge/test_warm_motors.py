"""Motors of the wedge brake heat by their own currents, and the hotter one derates both."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bywire
from bywire.bench.energy_ledger import actuator_ledger, further_ledgers
from bywire.core.catalog import PARAMETER_SETS

SET: Any = PARAMETER_SETS.find("roberts2003").parameters()
WARM = {
    "motor_heat.law": "lumped",
    "motor_heat.C_w": 1.0,
    "motor_heat.T_a": "110 degC",
    "control.derating.law": "current",
    "control.derating.C_w_hat": 1.0,
    "control.derating.T_a_hat": "110 degC",
    "flywheel.law": "driven",
    "wedge.mu_B": 0.2,
}


@pytest.fixture(scope="module")
def applied():
    """Return a moment at a low friction of the pads, which takes current, held for two seconds."""
    options = {"input": "M_set", "output": "M_B", "end": "600 N*m", "duration": "2 s"}
    bench = bywire.Bench("duty", "roberts2003", WARM, options=options)
    return bywire.run(bench, estimate_error=False)


def test_both_motors_are_limited_by_what_the_hotter_leaves(applied):
    run, law = applied.recording, SET.control.derating
    hot = np.maximum(run["T_winding_1"].values, run["T_winding_2"].values)
    assert applied.kpi("peak_winding").value == hot.max() > law.T_derate
    t_on = applied.kpi("derated_after").value
    assert 0.05 < t_on < 1.5
    assert hot[run["time"].values == t_on] == pytest.approx(law.T_derate, abs=3.0)
    share = np.clip((law.T_limit - hot) / (law.T_limit - law.T_derate), 0.0, 1.0)
    limit = law.i_least + (SET.control.position.i_max - law.i_least) * share
    # the ECU knows demands, and no cogging: within some kelvin of the windings
    for name in ("i_1_ref", "i_2_ref"):
        assert np.all(np.abs(run[name].values) < limit + 2.0)


def test_books_of_their_heat_close(applied):
    run = applied.recording
    own, heat = actuator_ledger(run), further_ledgers(run)["motor heat"]
    copper = sum(p.energy for p in own.sinks if p.label.startswith("copper"))
    assert heat.turnover == pytest.approx(copper, rel=1e-12)
    assert abs(heat.closing_error) < 1e-6 * heat.turnover
    assert abs(own.closing_error) < 1e-8 * own.turnover


def test_a_warm_winding_has_the_resistance_of_the_element(applied):
    run, heat, both = applied.recording, SET.motor_heat, 0.0
    for k, motor in (("1", SET.motor_1), ("2", SET.motor_2)):
        R = motor.R_ref * (1.0 + heat.a_R * (run[f"T_winding_{k}"].values - heat.T_ref))
        both = both + R * run[f"i_{k}"].values ** 2
    lost = float(np.trapezoid(both, run["time"].values))
    assert float(run["E_copper"][-1] - run["E_copper"][0]) == pytest.approx(lost, rel=0.02)
