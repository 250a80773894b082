"""A motor at the wheel of a quarter car: dips of the torque, recovered energy, faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import bywire
from bywire.core.errors import ParameterError
from bywire.plant import traction_battery, wheel_motor
from bywire.vehicle.ideal_stop import ideal_recovery
from raising import raises
from systems.loading import loaded

FILE = Path(__file__).parents[1] / "systems" / "blended_wheel.py"
TAU_B, T_D, DEMAND = 0.060, 0.010, 360.0


@pytest.fixture(scope="module", autouse=True)
def _system():
    with loaded(FILE):
        yield


def stop(faults=(), **changes):
    overrides = {key.replace("__", "."): value for key, value in changes.items()}
    return bywire.run("blended-stop", overrides=overrides, faults=faults)


@pytest.fixture(scope="module")
def stops():
    laws = ("reported", "commanded", "predicted")
    return {law: stop(regeneration__blending__law=law) for law in laws}


def figures(result):
    return {kpi.name: kpi.value for kpi in result.kpis}


@pytest.mark.parametrize(("law", "dip"), [("reported", 38.1), ("commanded", 29.7)])
def test_the_torque_dips_while_the_motor_fades(stops, law, dip):
    assert figures(stops[law])["largest_dip"] / 100 * DEMAND == pytest.approx(dip, rel=0.03)


def test_prediction_keeps_the_dip_below_5_percent(stops):
    assert figures(stops["predicted"])["largest_dip"] < 5.0


def test_the_motor_takes_most_of_the_braking_energy(stops):
    assert figures(stops["reported"])["motor_share"] == pytest.approx(93.3, rel=0.005)
    assert figures(stops["reported"])["recovery_efficiency"] == pytest.approx(99.6, abs=0.2)


@pytest.mark.parametrize("law", ["reported", "commanded", "predicted"])
def test_the_steady_torque_is_the_demand(stops, law):
    assert figures(stops[law])["steady_error"] < 0.5


def test_motor_friction_and_tire_take_the_kinetic_energy(stops):
    run = stops["reported"].recording
    stored = run["E_body"] + run["E_wheel"]
    taken = sum(run[name] for name in ("E_brake", "E_recovered", "E_drive", "E_tyre"))
    residual = (stored + taken - float(stored[0])) / float(stored[0])
    assert float(np.abs(residual).max()) < 1e-8


def test_the_battery_stores_what_is_recovered_without_its_losses(stops):
    run = stops["reported"].recording
    residual = run["E_battery"] - run["E_battery"][0] + run["E_battery_loss"] - run["E_recovered"]
    assert float(np.abs(residual).max()) < 1e-8 * float(run["E_recovered"][-1])


def test_a_lost_motor_leaves_an_impulse_that_the_reports_delay():
    result = stop(["wheel_motor.stuck@3s"])
    run = result.recording.sel(time=slice(3.0, 4.0))
    lack = DEMAND - run["T_m"] - run["T_f"]
    T_0 = float(run["T_m"][0])
    missing = float(np.trapezoid(lack.values, run["time"].values))
    assert missing == pytest.approx(T_0 * (TAU_B + 2 * T_D), rel=0.02)
    assert float(lack[-1]) == pytest.approx(0.0, abs=0.01)


def test_only_reports_replace_a_lost_motor():
    result = stop(["wheel_motor.stuck@3s"], regeneration__blending__law="commanded")
    run = result.recording.sel(time=4.0, method="nearest")
    assert float(run["T_m"]) == pytest.approx(0.0, abs=1e-6)
    assert float(run["T_f"]) < 0.1 * DEMAND


@pytest.mark.parametrize(
    "changes",
    [
        {"regeneration__battery__law": "cells", "options__soc": 1.0},
        {"regeneration__battery__law": "cells", "regeneration__battery__T": "-20 degC"},
        {"faults": ["regeneration.battery.full"]},
    ],
)
def test_a_battery_that_accepts_nothing_at_the_top_of_a_hill(changes):
    """The friction brake then stops the car alone, over the same distance."""
    result = stop(**changes, options__gradient="-8 %", options__duration="25 s")
    found = figures(result)
    assert found["recovered_energy"] == 0.0
    assert found["largest_dip"] < 0.5
    kinetic = 0.5 * 400.0 * (100 / 3.6) ** 2
    assert float(result.recording["E_brake"][-1]) > kinetic  # and the energy of the slope


def test_a_motor_that_is_not_part_of_the_service_brake_adds_its_torque():
    result = stop(regeneration__blending__category="A", options__T_coast="80 N*m")
    run = result.recording.sel(time=2.0, method="nearest")
    assert float(run["T_m"]) == pytest.approx(80.0, rel=1e-6)
    assert float(run["T_f"]) == pytest.approx(DEMAND, rel=1e-6)


def test_the_ideal_recovery_has_a_closed_form():
    par = bywire.parameters("blended").regeneration
    motor = par.motor
    v_0, r, top = 100 / 3.6, 0.3, 25e3 / 0.9
    cells = par.battery.model_copy(update={"P_max": 25e3})
    assert traction_battery.charging_limit(traction_battery.State(0.5), cells) == 25e3
    power = min(motor.P_max, top)
    corner = power * r / DEMAND  # m/s, above which the power limits the motor
    fading = [500.0 / DEMAND / (motor.v_1 - motor.v_2), motor.v_2]  # share = a (v - v_2)
    end = motor.v_2 + 1.0 / fading[0]
    fade = fading[0] * ((end**3 - motor.v_2**3) / 3 - motor.v_2 * (end**2 - motor.v_2**2) / 2)
    whole = (corner**2 - end**2) / 2 + corner * (v_0 - corner) + fade
    assert ideal_recovery(v_0, DEMAND, r, par, 0.5) == pytest.approx(
        motor.eta * 2 * whole / v_0**2, rel=1e-6
    )
    assert wheel_motor.limit(v_0 / r, v_0, 25e3, motor) == pytest.approx(power * r / v_0)


def test_a_longer_delay_than_the_bus_holds_is_refused():
    with raises(ParameterError, name="bus.T_d", value="0.02 s", valid="<= 10 T_s = 0.01 s"):
        stop(regeneration__bus__T_d="20 ms")


def test_blending_needs_a_battery_with_a_limit():
    par = bywire.parameters("blended")
    with pytest.raises(ParameterError, match="P_max"):
        par.replace({"regeneration.battery.P_max": float("inf")})
    with pytest.raises(ParameterError, match="P_max"):
        type(par).create({k: v for k, v in par.flat().items() if not k.endswith("battery.P_max")})
