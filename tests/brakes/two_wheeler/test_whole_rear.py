"""The two-wheeler whose rear brake is there whole: as good as its loop, and its price."""

from __future__ import annotations

import numpy as np
import pytest

import bywire
from bywire.bench.energy_ledger import actuator_ledger, further_ledgers
from bywire.bench.ensemble import key_figures_of
from bywire.bench.experiment import Case, as_run
from bywire.bench.faults.modes import modes_of
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.two_wheeler.rigs.whole_rear import TwoWheelerWholeRear
from bywire.campaigns.residual import NEVER, residuals_of
from bywire.core.errors import ModelError
from bywire.plant import brake_disc
from bywire.simulation.compiler import find_compiler
from bywire.simulation.run import simulate
from run_once import run_once

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
SET = "sport600-whole-rear"
SNOW = {"options.surface": "snow", "options.v_0": "20 m/s"}
VENTED = {"rear.actuator.port.law": "dead-stroke"}


def stop(changes=None, experiment="whole-rear-stop"):
    return bywire.run(experiment, changes or {}, estimate_error=False)


@pytest.fixture(scope="module")
def wet():
    return bywire.run("benches/wet_stop_whole_rear.toml", estimate_error=False)


def test_slip_control_over_the_whole_brake_on_wet_road(wet):
    assert len(wet.verdicts) == 5
    assert all(verdict.met for verdict in wet.verdicts)


def test_it_stops_as_the_loop_that_stands_for_it_does(wet):
    loop = bywire.run("benches/wet_stop.toml", estimate_error=False)
    for name, most in (("stopping_distance", 0.2), ("peak_slip_rear", 0.005), ("jerk", 1.0)):
        assert abs(wet.kpi(name).value - loop.kpi(name).value) < most, name


def test_books_of_vehicle_and_brake_close_apart(wet):
    books = further_ledgers(wet.recording)
    vehicle, brake = actuator_ledger(wet.recording), books["rear brake"]
    assert set(books) == {"rear brake"}
    assert "E_vehicle" in {posting.name for posting in vehicle.sinks}
    assert {posting.name for posting in brake.sources} == {"E_rear_source"}
    for each in (vehicle, brake):
        assert abs(each.closing_error) < 1e-6 * each.turnover
    assert brake.turnover > 50.0


def test_the_brake_is_the_one_that_stands_alone(wet):
    """Nothing of the vehicle acts back on it: demanded the same, it does the same."""
    run = wet.recording
    par = bywire.parameters("dardanelli2010-retuned")
    state, memory = MotorcycleBrake().rest(par)
    demand = run["p_r_ref"].values
    case = Case(
        "alone",
        MotorcycleBrake(),
        par,
        state,
        memory,
        lambda t: {"p_set": demand[np.round(t / 1e-3).astype(int)]},
        2.0,
    )
    alone = simulate(as_run(case, 20e-6))
    rows = alone.time.size
    for name in ("p_mc", "p_pd", "i", "omega", "duty", "i_dit", "T_fr"):
        got = run[f"rear_{name}"].values[:rows]
        assert np.abs(got - alone[name]).max() < 1e-9 * np.abs(alone[name]).max(), name
    assert np.abs(run["E_rear_copper"].values[:rows] - alone["E_copper"]).max() < 1e-9


def test_slip_control_keeps_the_whole_brake_from_locking_its_wheel():
    free, held = (stop({**SNOW, "ecu.rear_slip.slip_set": slip}) for slip in (1.0, 0.105))
    assert free.kpi("locked_time_rear").value > 5.0
    assert held.kpi("locked_time_rear").value == held.kpi("locked_time_front").value == 0.0
    assert held.kpi("braking_efficiency").value > 95.0
    assert held.kpi("peak_slip_rear").value < 0.15
    assert held.kpi("rear_energy").value < 0.5 * free.kpi("rear_energy").value


def test_what_fails_in_the_brake_is_known_by_its_path():
    model, par = TwoWheelerWholeRear(), bywire.parameters(SET)
    within = {name for name in modes_of(model, par) if name.startswith("rear.actuator.")}
    alone = modes_of(MotorcycleBrake(), par.value("rear.actuator"))
    demands = ("p_set", "pedal_force", "i_set", "v_set", "ecu")
    wanted = {f"rear.actuator.{name}" for name in alone if not name.startswith(demands)}
    assert within == wanted
    assert {"rear_ecu.frozen", "rear_i_set.stuck"} <= set(modes_of(model, par))
    assert "rear_p_set.stuck" not in modes_of(model, par)  # what the vehicle's ECU gives
    channel = modes_of(model, par)["rear.actuator.pressure.offset"].channel
    assert (channel.signal, channel.side) == ("rear_y_p", "reading")
    shown = alone["pressure.offset"].channel.seen(20e5, par.value("rear.actuator"))
    assert channel.seen(20e5, par) == shown


def test_what_the_brakes_ecu_can_see_it_sees_in_the_vehicle_too(wet):
    known = residuals_of(TwoWheelerWholeRear())
    alone = residuals_of(MotorcycleBrake())
    within = {f"rear.actuator.{name}" for name in alone}
    assert set(known) == {"slip-front", "slip-rear", "speed"} | within
    par = bywire.parameters(SET)
    for name, each in alone.items():
        held = known[f"rear.actuator.{name}"]
        signals = {n: wet.recording[n].values[None, :] for n in held.signals}
        own = {n: wet.recording[f"rear_{n}"].values[None, :] for n in each.signals}
        got = held.lasted(signals, par, wet.recording["time"].values)
        wanted = each.lasted(own, par.value("rear.actuator"), wet.recording["time"].values)
        assert np.array_equal(got, wanted)
        assert got.max() > NEVER, name  # the demand rests for long enough to be looked at


def test_warnings_of_many_stops_are_those_of_each():
    benches = [
        bywire.Bench(
            "whole-rear-stop", SET, {"rear.actuator.motor.R_m": R}, {"p_rear": p, "duration": 0.5}
        )
        for R, p in ((0.35, 40e5), (0.3, 60e5))
    ]
    said = key_figures_of(benches).warnings
    assert said == tuple(tuple(run_once(bench).warnings) for bench in benches)
    assert said[0] == ()
    assert said[1][0].startswith("rear brake: the piston reached its end stop")


def test_two_ecus_are_not_exported_as_one(tmp_path):
    with pytest.raises(ModelError, match=r"motorcycle-brake \(rear brake\) with its own ECU"):
        bywire.export_controller("whole-rear-stop", out=tmp_path / "ecu")


def test_brake_without_battery_leaves_the_front_to_stop():
    bench = bywire.Bench(
        "whole-rear-stop",
        SET,
        options={"duration": 1.5},
        faults=[{"fault": "rear.actuator.battery.lost", "onset": 0.8}],
    )
    run = bywire.run(bench, estimate_error=False).recording
    before, after = (float(run["rear_p_mc"].sel(time=t, method="nearest")) for t in (0.79, 1.5))
    assert before == pytest.approx(40e5, abs=1e5)
    assert after < 5e5
    assert float(run["p_f"].sel(time=1.5, method="nearest")) > 10e5
    assert (run["rear_i"].sel(time=slice(0.81, None)) == 0.0).all()


@pytest.mark.parametrize("force", [60.0, 150.0])
def test_caliper_that_sticks_drags_by_its_friction(force):
    bench = bywire.Bench(
        "rear-drag",
        SET,
        VENTED,
        options={"duration": 1.5},
        faults=[{"fault": "rear.actuator.piston.stuck", "value": f"{force} N"}],
    )
    result = bywire.run(bench, estimate_error=False)
    par = bywire.parameters(SET)
    pressure = force / par.value("rear.actuator.caliper.A_pd")
    assert result.kpi("residual_pressure").value == pytest.approx(pressure, rel=1e-3)
    drag = brake_disc.torque_per_pressure(par.value("rear.disc")) * pressure
    assert result.kpi("drag").value == pytest.approx(drag, rel=1e-3)


def test_caliper_that_does_not_stick_lets_go():
    result = stop({}, "rear-drag")
    assert result.kpi("drag").value < 0.1
    assert 0.02 < result.kpi("release_time").value < 0.1


def test_drag_of_a_loop_acts_below_its_pressure_alone():
    bench = bywire.Bench(
        "straight-stop",
        "sport600",
        options={"duration": 0.3, "p_rear": 0.0},
        faults=[{"fault": f"{end}.disc.dragging", "value": "12 N*m"} for end in ("front", "rear")],
    )
    run = bywire.run(bench, estimate_error=False).recording
    assert (run["T_r"] == 12.0).all()
    assert float(run["E_brake_r"][-1]) == pytest.approx(
        12.0 * float(np.trapezoid(run["omega_r"], run["time"])), rel=1e-4
    )
    pressed = run["p_f"].values > 10e5
    k = brake_disc.torque_per_pressure(bywire.parameters("sport600").value("front.disc"))
    assert run["T_f"].values[pressed] == pytest.approx(k * run["p_f"].values[pressed], rel=1e-12)
