"""Sources of the open loop: the held quantity, the driven one, and omitted signals."""

from __future__ import annotations

import numpy as np
import pytest

import bywire
from bywire.core.errors import UnitError, UnknownNameError
from run_once import run_once

SET = "dardanelli2010"
IDEAL = ["current", "voltage"]
ECU = ["current-loop", "current-direct", "pressure"]
UNITS = {
    "current": "A",
    "voltage": "V",
    "current-loop": "A",
    "current-direct": "A",
    "pressure": "bar",
}
ECU_ONLY = {"p_ref", "duty", "i_star", "i_dit", "sat_current", "sat_duty"}


def held(source: str, **changes) -> bywire.Bench:
    """Return a bench that holds 20 bar with the default stimulus."""
    options = {"source": source, "add_holding": True, "p_start": "20 bar", "duration": "0.2 s"}
    stimulus = {"kind": "step", "start": 0, "end": f"0 {UNITS[source]}", "t_step": 0}
    return bywire.Bench("motor-open-loop", SET, options=options, stimulus=stimulus, **changes)


@pytest.mark.parametrize("source", [*IDEAL, *ECU])
def test_holding_holds(source):
    result = run_once(held(source))
    pressure = result.recording["p_mc"]
    assert float(abs(pressure - 20e5).max()) < 2.5e5  # dither shakes the piston
    if source in (*IDEAL, "current-direct"):
        assert float(abs(pressure - 20e5).max()) < 1.0


@pytest.mark.parametrize("source", [*IDEAL, *ECU])
def test_what_only_the_ecu_means_is_left_out_without_it(source):
    result = run_once(held(source))
    names = {kpi.name for kpi in result.kpis}
    assert "share_stuck" in names
    if source in IDEAL:
        assert not ECU_ONLY & set(result.recording.data_vars)
        assert not {"share_sat_current", "share_sat_duty"} & names
    else:
        assert set(result.recording.data_vars) >= ECU_ONLY
        assert names == set(result.bench.definition.kpis)


def test_requirement_that_the_source_leaves_out_is_refused():
    limit = {"share_sat_duty": "<= 1 %"}
    with pytest.raises(UnknownNameError, match="share_sat_duty"):
        held("current", requirements=limit)
    assert run_once(held("pressure", requirements=limit)).verdicts


@pytest.mark.parametrize("source", [*IDEAL, *ECU])
def test_unit_is_that_of_the_source(source):
    stimulus = {"kind": "step", "start": 0, "end": "1 mm", "t_step": 0}
    with pytest.raises(UnitError, match="mm cannot be"):
        bywire.Bench("motor-open-loop", SET, options={"source": source}, stimulus=stimulus)


def test_demand_to_the_current_loop_is_dithered_or_direct():
    dithered, direct = (run_once(held(s)).recording for s in ("current-loop", "current-direct"))
    assert float(abs(dithered["i_dit"]).max()) > 1.0
    assert float(abs(direct["i_dit"]).max()) == 0.0
    assert float(np.ptp(direct["i_ref"].values)) == 0.0


def test_pressure_source_is_the_set_point():
    assert float(run_once(held("pressure")).recording["p_ref"].min()) == 20e5
