"""A warming motor in the whole brake: closed forms, energy balance, and derating."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import xarray as xr

import bywire
from bywire.bench.energy_ledger import actuator_ledger, further_ledgers
from bywire.bench.experiment import as_run
from bywire.bench.recording import record
from bywire.brakes.motorcycle.case import case_from_rest
from bywire.control import derating
from bywire.core.catalog import PARAMETER_SETS
from bywire.plant import motor_heat
from bywire.plant.motor_heat import Input, State
from bywire.simulation.run import simulate
from run_once import run_once

BRAKE: Any = PARAMETER_SETS.find("dardanelli2010-retuned").parameters()
WARM = {"motor_heat.law": "lumped", "motor_heat.C_w": 2.0, "motor_heat.C_h": 20.0}
HEAT = BRAKE.replace(WARM).motor_heat
KNOWN = {"ecu.derating.law": "current", "ecu.derating.C_w_hat": 2.0, "ecu.derating.C_h_hat": 20.0}


def held(i: float, duration: float, **changes: Any) -> xr.Dataset:
    """Return a run in which an ideal source drives a current [A] from the start."""
    case = case_from_rest(
        "run",
        BRAKE,
        "current-source",
        0.0,
        lambda t: {"i_set": np.full(t.shape, i)},
        duration,
        {**WARM, **changes},
    )
    run = as_run(case, 2e-5)
    return record(run, simulate(run), 0.0, 0.0, {})


def duty(options: dict[str, Any], **changes: Any) -> bywire.Result:
    bench = bywire.Bench("duty", "dardanelli2010-retuned", changes, options=options)
    return bywire.run(bench, estimate_error=False)


@pytest.mark.parametrize("a_R", [0.0, 3.93e-3])
def test_a_constant_current_warms_the_winding_exponentially(a_R: float) -> None:
    # With a housing at constant temperature: C T' = R(T) i^2 - G (T - T_a), linear in T.
    i, T_ref = 12.0, 300.0
    changes = {"motor_heat.C_h": 1e15, "motor_heat.a_R": a_R, "motor_heat.T_ref": T_ref}
    run = held(i, 6.0, **changes)
    R, C, G = BRAKE.motor.R_m, HEAT.C_w, HEAT.G_wh
    rate = (G - R * a_R * i * i) / C
    steady = HEAT.T_a + R * (1.0 + a_R * (HEAT.T_a - T_ref)) * i * i / (C * rate)
    t = run["time"].values
    wanted = steady + (HEAT.T_a - steady) * np.exp(-rate * t)
    assert wanted[-1] - wanted[0] > 60.0
    rise = wanted[-1] - HEAT.T_a
    np.testing.assert_allclose(run["T_winding"], wanted, rtol=0, atol=1e-6 * rise)


def test_a_steady_winding_solves_a_linear_equation() -> None:
    # Resistance increases with temperature, and heat with resistance: T_w - T_a = R(T_w) i^2 / G.
    i = 6.0
    G = 1.0 / (1.0 / HEAT.G_wh + 1.0 / HEAT.G_ha)
    P_ref = BRAKE.motor.R_m * i * i
    ref = HEAT.T_ref - HEAT.T_a
    rise = P_ref * (1.0 - HEAT.a_R * ref) / (G - P_ref * HEAT.a_R)
    P = P_ref * motor_heat.warmth(State(HEAT.T_a + rise, HEAT.T_a), HEAT).R
    x = State(HEAT.T_a + rise, HEAT.T_a + P / HEAT.G_ha)
    assert motor_heat.balance(x, Input(P), HEAT) == pytest.approx((0.0, 0.0), abs=1e-9 * P)
    assert motor_heat.power_loss(x, HEAT) == pytest.approx(P)
    run = held(i, 20.0, **{"motor_heat.C_h": 0.05, "motor_heat.C_w": 0.05})
    assert run["T_winding"].values[-1] == pytest.approx(HEAT.T_a + rise, rel=1e-6)
    assert run["T_housing"].values[-1] == pytest.approx(HEAT.T_a + P / HEAT.G_ha, rel=1e-6)


def test_resistance_and_torque_constant_follow_the_temperatures() -> None:
    run = held(10.0, 4.0, **{"motor_heat.C_w": 0.5})
    T_w, T_h = run["T_winding"].values, run["T_housing"].values
    assert (T_w[-1] > 350.0, T_h[-1] > 295.0) == (True, True)
    K = BRAKE.motor.K_e * (1.0 - HEAT.a_K * (T_h - HEAT.T_ref))
    np.testing.assert_allclose(run["torque"], K * 10.0, rtol=1e-12)
    R = BRAKE.motor.R_m * (1.0 + HEAT.a_R * (T_w - HEAT.T_ref))
    np.testing.assert_allclose(run["voltage"], R * 10.0 + K * run["omega"], rtol=1e-9)
    power = np.diff(run["E_copper"].values) / np.diff(run["time"].values)
    np.testing.assert_allclose(power, 0.5 * (R[1:] + R[:-1]) * 100.0, rtol=1e-6)


def test_books_close_beside_each_other() -> None:
    result = duty(
        {"input": "p_set", "end": 30e5, "period": 0.5, "share": 0.5, "duration": 2.0}, **WARM
    )
    own, heat = actuator_ledger(result.recording), further_ledgers(result.recording)["motor heat"]
    assert {p.label for p in heat.sinks} == {"winding", "housing", "air"}
    assert abs(own.closing_error) < 1e-7 * own.turnover
    assert abs(heat.closing_error) < 2e-6 * heat.turnover
    copper = sum(p.energy for p in own.sinks if p.label.startswith("copper"))
    assert heat.turnover == pytest.approx(copper, rel=1e-12)
    off = duty({"input": "p_set", "end": 30e5, "duration": 0.2})
    assert "motor heat" not in further_ledgers(off.recording)
    assert float(np.ptp(off.recording["T_winding"].values)) == 0.0


def test_a_derated_motor_settles_where_heat_out_is_heat_in() -> None:
    # Constant resistance: R i(T)^2 = G (T - T_a) with the limit i(T) is a quadratic equation.
    no_growth = {"motor_heat.a_R": 0.0, "motor_heat.a_K": 0.0, "ecu.derating.a_R_hat": 0.0}
    slim = {
        "motor_heat.C_w": 0.4,
        "motor_heat.C_h": 0.4,
        "motor_heat.G_ha": 0.52,
        "ecu.derating.C_w_hat": 0.4,
        "ecu.derating.C_h_hat": 0.4,
        "ecu.derating.G_ha_hat": 0.52,
    }
    changes = {**WARM, **KNOWN, **no_growth, **slim, "drive.mode": "current-direct"}
    options = {"input": "i_set", "output": "i", "end": 18.0, "duration": 12.0}
    result = duty(options, **changes)
    law, i_0, R = BRAKE.ecu.derating, BRAKE.ecu.pressure.i_max, BRAKE.motor.R_m
    G, span = 0.26, law.T_limit - law.T_derate
    slope = (i_0 - law.i_least) / span
    at_T_a = law.i_least + slope * (law.T_limit - HEAT.T_a)
    # R (at_T_a - slope y)^2 - G y = 0 in the rise y
    roots = np.roots([R * slope**2, -2.0 * R * slope * at_T_a - G, R * at_T_a**2])
    rise = float(np.min(roots.real))
    run = result.recording
    assert law.T_derate < HEAT.T_a + rise < law.T_limit
    assert run["T_winding"].values[-1] - HEAT.T_a == pytest.approx(rise, rel=2e-3)
    assert run["i"].values[-100:].mean() == pytest.approx(at_T_a - slope * rise, rel=5e-3)
    value = {kpi.name: kpi.value for kpi in result.kpis}
    assert value["peak_winding"] == pytest.approx(float(run["T_winding"].max()))
    assert value["derated_after"] + value["time_derated"] == pytest.approx(12.0, abs=0.03)
    assert 0.1 < value["derated_after"] < 3.0


def test_derating_keeps_a_motor_below_its_limit_that_would_pass_it() -> None:
    options = {
        "input": "p_set",
        "output": "p_mc",
        "end": "45 bar",
        "period": "0.25 s",
        "share": 0.5,
        "duration": "15 s",
    }
    hot = {**WARM, "motor_heat.T_a": "100 degC"}
    known = {**KNOWN, "ecu.derating.T_a_hat": "100 degC"}
    free, derated = duty(options, **hot), duty(options, **hot, **known)
    assert any("the winding exceeds 155 degC, its limit, at t = " in w for w in free.warnings)
    assert not any("winding" in w for w in derated.warnings)
    assert free.kpi("time_derated").value == 0.0
    assert free.kpi("derated_after").note == "the motor is never derated"
    law = BRAKE.ecu.derating
    assert law.T_derate < derated.kpi("peak_winding").value < law.T_limit
    assert free.kpi("peak_winding").value > HEAT.T_most
    # the cost: the pressure follows less
    assert derated.kpi("final_output").value < 0.97 * free.kpi("final_output").value


def test_the_ecus_model_is_that_of_the_motor() -> None:
    par = BRAKE.replace(KNOWN).ecu.derating
    x, T, i = derating.State(0.0, 0.0), 1e-3, 12.0
    for _ in range(4000):
        x, out = derating.output(x, derating.Input(i, 20.0), T, par)
    run = held(i, 4.0, **{"motor_heat.T_ref": par.T_ref_hat})
    assert float(run["T_winding"][-1]) == pytest.approx(out.T, rel=1e-4)
    off = derating.output(x, derating.Input(i, 20.0), T, BRAKE.ecu.derating)
    assert off == (x, (20.0, par.T_a_hat, 0.0))


@pytest.mark.parametrize(
    ("T", "left"), [(20.0, 20.0), (120.0, 20.0), (132.5, 11.0), (145.0, 2.0), (200.0, 2.0)]
)
def test_the_limit_falls_between_two_temperatures(T: float, left: float) -> None:
    par = BRAKE.replace({"ecu.derating.law": "current", "ecu.derating.T_a_hat": 293.15}).ecu
    x = derating.State(T - 20.0, T - 20.0)
    _, out = derating.output(x, derating.Input(0.0, 20.0), 1e-12, par.derating)
    assert out.i_max == pytest.approx(left, abs=1e-9)
    assert out.derated == (1.0 if left < 20.0 else 0.0)
    assert math.isclose(out.T, T + 273.15)
    # a limit below the minimum is unchanged
    _, small = derating.output(x, derating.Input(0.0, 1.0), 1e-12, par.derating)
    assert small.i_max == 1.0


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ("ecu.derating.T_derate=150 degC", "T_derate = 150 degC must be < T_limit = 145 degC"),
        (
            "motor_heat.a_K=0.02 1/K",
            "not positive at T_most = 155 degC",
        ),
        ("motor_heat.C_w=0", "must be > 0"),
        ("motor_heat.T_a=20", "cannot be converted to K"),
        ("motor_heat.law=hot", "lumped"),
    ],
)
def test_impossible_heat_of_a_motor_is_refused(change: str, text: str) -> None:
    name, _, value = change.partition("=")
    with pytest.raises(bywire.BywireError, match=text):
        run_once("pressure-step", {name: value})
