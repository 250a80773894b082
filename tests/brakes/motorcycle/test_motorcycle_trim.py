"""Equilibria of the motorcycle brake: travel, admissible pressures, memory."""

from __future__ import annotations

import math
from typing import Any

import pytest

import bywire
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import (
    highest_pressure,
    holding_current,
    memory_at,
    state_at,
    travel_at,
)
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import ParameterError
from bywire.plant import brake_fluid, caliper, master_cylinder
from raising import raises
from run_once import run_once

STEPS = 40_000
TABLE = {
    "caliper.law": "table",
    "caliper.p_table": (0.0, 1e5, 3.3e5, 20e5, 50e5),
    "caliper.V_table": (0.0, 1e-7, 1.5e-7, 2.5e-7, 4e-7),
}
AIR = {"fluid.air": "entrained", "fluid.V_air": 1e-7}
LAWS: dict[str, dict[str, Any]] = {
    "linear": {},
    "compressible": {"caliper.law": "compressible"},
    "table": TABLE,
    "linear, air": AIR,
    "table, air": TABLE | AIR,
}


def brake(changes: dict[str, Any], name: str = "dardanelli2010") -> MotorcycleParameters:
    found = PARAMETER_SETS.find(name).parameters().replace(changes)
    assert isinstance(found, MotorcycleParameters)
    return found


def fine_travel(p: float, par: MotorcycleParameters, x: float) -> float:
    """Return the travel by the midpoint rule, with nodes of the table at the ends of steps."""
    cylinder, h = par.master_cylinder, p / STEPS

    def slope(x: float, p: float) -> float:
        volume = master_cylinder.volume(master_cylinder.Input(x, 0.0, 0.0), cylinder)
        chamber = brake_fluid.compliance(brake_fluid.Chamber(volume, p), par.fluid)
        return (chamber + caliper.mass(caliper.State(p), par.caliper, par.fluid)) / cylinder.A_mc

    for k in range(STEPS):
        middle = x + 0.5 * h * slope(x, (k + 0.5) * h)
        x += h * slope(middle, (k + 0.5) * h)
    return x


@pytest.mark.parametrize(
    "name", ["dardanelli2010", pytest.param("dardanelli2010-table1", marks=pytest.mark.trust)]
)
@pytest.mark.parametrize("law", LAWS)
def test_travel_is_that_of_fine_steps(law: str, name: str) -> None:
    par, p = brake(LAWS[law], name), 40e5
    expected = fine_travel(p, par, par.master_cylinder.x_rest)
    assert abs(travel_at(p, par) - expected) < 1e-9


def test_dead_stroke_comes_before_the_filling() -> None:
    par = brake({"port.law": "dead-stroke", "port.x_port": 0.8e-3})
    cylinder = par.master_cylinder
    expected = fine_travel(40e5, par, cylinder.x_rest + 0.8e-3)
    assert abs(travel_at(40e5, par) - expected) < 1e-9
    assert state_at(0.0, par).theta * par.gear.k_g == pytest.approx(cylinder.x_rest)


@pytest.mark.parametrize("changes", [{}, {"port.law": "dead-stroke"}], ids=["makeup", "dead"])
def test_start_beyond_the_end_stop_is_refused(changes: dict[str, Any]) -> None:
    par = brake(changes)
    limit = highest_pressure(par)
    assert travel_at(limit, par) == pytest.approx(par.master_cylinder.x_end, abs=1e-12)
    state_at(0.999 * limit, par)
    for p in (1.001 * limit, -1.0, math.nan):
        range_ = f">= 0 bar and <= {math.floor(limit / 1e3) / 100:g} bar"
        with raises(ParameterError, value=f"{p / 1e5:g} bar", valid=range_):
            state_at(p, par)


def test_bench_that_starts_beyond_the_end_stop_is_refused() -> None:
    stimulus = {"kind": "step", "start": 0, "end": "1 A", "t_step": 0}
    with raises(ParameterError, value="60 bar", valid="<= 51.27 bar"):
        bywire.Bench(
            "motor-open-loop", "dardanelli2010", options={"p_start": "60 bar"}, stimulus=stimulus
        ).cases()


@pytest.mark.parametrize("mode", ["current-source", "voltage-source"])
def test_memory_of_a_source_holds_no_ecu(mode: str) -> None:
    par, p = brake({"drive.mode": mode}), 20e5
    i, memory = holding_current(p, par), memory_at(p, par)
    own = (
        {"i_source": i, "i_ref": i} if mode == "current-source" else {"v_source": par.motor.R_m * i}
    )
    given = {name: value for name, value in memory._asdict().items() if value != 0.0}
    assert given == {"p_meas": p, "i_meas": i} | own


@pytest.mark.parametrize("source", ["current", "voltage"])
def test_converters_live_in_open_loop(source: str) -> None:
    bench = bywire.Bench(
        "motor-open-loop",
        "dardanelli2010",
        {"adc.noise": 1e-4},
        {"source": source, "p_start": "10 bar", "duration": "0.3 s"},
        {"kind": "step", "start": 0, "end": "6 A" if source == "current" else "3 V", "t_step": 0},
    )
    run = run_once(bench).recording
    assert float(run["p_mc"].max()) > 12e5
    late = run.isel(time=slice(10, None))
    assert float(abs(late["p_meas"] - late["p_mc"]).max()) < 2e5
    assert float(abs(late["i_meas"] - late["i"]).max()) < 2.0
    assert len(set(late["p_meas"].values.tolist())) > 50
    for name in {"duty", "p_ref", "i_star"} & set(run.data_vars):
        assert float(abs(run[name]).max()) == 0.0


@pytest.mark.parametrize("mode", ["pressure", "current", "voltage-source", "current-source"])
def test_rest_is_the_trim_without_pressure(mode: str) -> None:
    par = brake({"drive.mode": mode})
    assert MotorcycleBrake().rest(par) == (state_at(0.0, par), memory_at(0.0, par))
