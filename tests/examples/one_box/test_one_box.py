"""The one-box brake: pressure control, valves, anti-lock stops, and the balances of both."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import bywire
from bywire.bench.energy_ledger import actuator_ledger, further_ledgers
from bywire.bench.experiment import as_run
from bywire.simulation.run import simulate
from systems.loading import loaded

FOLDER = Path(__file__).parents[3] / "examples" / "one_box"
BAR, CM3 = 1e5, 1e-6


@pytest.fixture(scope="module", autouse=True)
def brake():
    with loaded(FOLDER):
        yield


@pytest.fixture(scope="module")
def applied():
    return bywire.run("pedal-apply")


@pytest.fixture(scope="module")
def stopped():
    return bywire.run("abs-stop", estimate_error=False)


def kpis(result) -> dict[str, float]:
    return {kpi.name: kpi.value for kpi in result.kpis}


def test_the_pedal_sets_the_pressure(applied):
    run, par = applied.recording, applied.bench.par
    hold = int(np.searchsorted(run["time"].values, 0.99))
    x = float(run["x_rod"][hold])
    force = par.rod.i * 80.0 - par.rod.F_0
    simulator = par.simulator
    beyond = max(x - simulator.x_1, 0.0)
    assert simulator.k_1 * x + simulator.k_2 * beyond == pytest.approx(force, rel=1e-6)
    V = par.ecu.V_ref * x / par.ecu.x_span
    p = float(np.interp(V, par.ecu.pedal_map.V_nodes, par.ecu.pedal_map.p_nodes))
    assert float(run["p"][hold]) == pytest.approx(p, rel=1e-3)
    assert not applied.warnings


@pytest.mark.parametrize("name", ["apply", "pressure_step", "wet_stop"])
def test_benches_meet_their_requirements(name):
    assert bywire.run(FOLDER / "benches" / f"{name}.toml").status == "passed"


def test_energy_and_volume_of_an_application_are_balanced(applied):
    ledger = actuator_ledger(applied.recording)
    assert abs(ledger.closing_error) < 1e-6 * ledger.turnover
    # The volume of stiffening calipers has the step's error, that of linear ones only rounding.
    assert kpis(applied)["volume_error"] < 1e-5 * CM3


def test_the_loops_are_stable_with_their_bandwidths():
    names = ("pressure", "position", "current")
    loops = {name: bywire.margins(f"plunger-{name}").margins[0] for name in names}
    assert all(margins.stable for margins in loops.values())
    # The line to the other brakes hides a part of their volume at this frequency.
    assert loops["pressure"].crossover == pytest.approx(60.0 / (2.0 * math.pi), rel=0.1)


def test_a_stop_without_anti_lock_control_locks_the_wheel():
    locked = kpis(bywire.run("abs-stop", overrides={"antilock.abs": "off"}, estimate_error=False))
    assert locked["locked_time"] > 3.0
    assert locked["braking_efficiency"] < 70.0
    assert math.isnan(locked["cycle_rate"])


@pytest.mark.parametrize(
    ("surface", "duration", "efficiency"),
    [("dry-asphalt", 5.0, 80.0), ("snow", 22.0, 80.0), ("wet-cobble", 12.0, 85.0)],
)
def test_every_surface_uses_most_of_its_adhesion(surface, duration, efficiency):
    options = {"options.surface": surface, "options.duration": f"{duration} s"}
    found = kpis(bywire.run("abs-stop", overrides=options, estimate_error=False))
    assert found["braking_efficiency"] > efficiency
    assert found["locked_time"] < 0.05
    assert 2.0 < found["cycle_rate"] <= 12.0


def test_energy_and_volume_of_a_stop_are_balanced(stopped):
    run = stopped.recording
    ledger = actuator_ledger(run)
    assert abs(ledger.closing_error) < 1e-6 * ledger.turnover
    vehicle = further_ledgers(run)["vehicle"]
    assert abs(vehicle.closing_error) < 1e-6 * vehicle.turnover
    duration = float(run["time"][-1])
    assert kpis(stopped)["volume_error"] < 1e-6 * CM3 * duration


def test_volume_is_conserved_with_linear_brakes():
    linear = dict.fromkeys(
        (
            "caliper.V_1",
            "others.V_1",
            "valves.caliper.V_1",
            "ecu.pressure.brakes.V_1",
        ),
        "0 ml",
    )
    run = bywire.run("abs-stop", overrides=linear, estimate_error=False).recording
    lost = float(abs(run["V_missing"]).max())
    assert lost < 1e-9 * CM3 * float(run["time"][-1])


def test_the_pump_returns_what_the_valve_released(stopped):
    run, par = stopped.recording, stopped.bench.par
    left = float(run["V_acc"][-1] - run["V_acc"][0])
    stroke = 0.5 * math.pi * par.pump.d_p**2 * par.pump.e
    released, pumped = (float(run[name][-1]) for name in ("V_released", "V_pumped"))
    assert released - pumped - left == pytest.approx(0.0, abs=1.01 * stroke)
    assert float(run["p"].min()) >= -1e-3 * BAR
    assert float(run["V_acc"].max()) < 0.5 * CM3


def test_a_valve_cycle_agrees_with_an_independent_simulation():
    """The reference has a constant pressure of 120 bar and an ideal pump."""
    soft = {
        "separation.seat.d": "3 mm",
        "separation.lift": "1.1 mm",
        "others.c": "0.1 ml/bar",
        "ecu.pressure.brakes.c": "0.11 ml/bar",
    }
    found = kpis(bywire.run("valve-cycle", overrides=soft, estimate_error=False))
    assert found["plunger_low"] > 115.0 * BAR
    volumes = {
        "given_volume": 4.208,
        "pumped_volume": 2.653,
        "accumulator_end": 0.467,
        "accumulator_max": 0.720,
        "wheel_volume": 1.089,
    }
    for name, value in volumes.items():
        assert found[name] / CM3 == pytest.approx(value, rel=0.05), name
    assert found["pressure_low"] / BAR == pytest.approx(35.9, rel=0.03)
    assert found["pressure_high"] / BAR == pytest.approx(76.7, rel=0.03)


def test_a_run_does_not_depend_on_the_step():
    """Threshold decisions of anti-lock control scatter, so this is a run with fixed commands."""
    from one_box.experiments import valve_cycle

    par = bywire.parameters("one-box-corner")
    (case,) = valve_cycle.cases(par, valve_cycle.EXPERIMENT.defaults)
    fine, coarse = (simulate(as_run(case, step), ("p",))["p"] for step in (5e-6, 20e-6))
    assert np.abs(coarse - fine).max() < 100.0


def test_the_brakes_keep_their_pressure_while_the_plunger_refills():
    run = bywire.run(
        "pedal-apply",
        overrides={"options.t_hold": "4 s"},
        faults=["port.leaking=1e-12 m^3/(s*Pa)"],
        estimate_error=False,
    ).recording
    t, p, phase = (run[name].values for name in ("time", "p_o", "refill"))
    held = (t > 0.5) & (t < 4.0)
    assert np.unique(phase[held]).tolist() == [0.0, 1.0, 2.0]
    assert float(run["p_mc"].values[held].min()) == 0.0
    assert p[held].min() > 0.96 * p[held].max()
    assert abs(run["V_missing"].values).max() < 1e-5 * CM3


@pytest.mark.parametrize("name", ["inlet.stuck-closed", "outlet.stuck-open", "pump_motor.hot"])
def test_faults_act(name):
    result = bywire.run("abs-stop", faults=[f"{name}@1 s"], estimate_error=False)
    assert np.isfinite(result.recording["p"].values).all()


def test_every_element_fault_is_listed():
    from one_box.rigs.corner import OneBoxCorner

    from bywire.bench.faults.modes import modes_of

    par = bywire.parameters("one-box-corner")
    places = {mode.partition(".")[0] for mode in modes_of(OneBoxCorner(), par)}
    expected = {
        "inlet",
        "outlet",
        "check",
        "accumulator",
        "pump",
        "pump_motor",
        "caliper",
        "others",
    }
    assert (
        expected | {"motor", "supply", "seal", "port", "simulator", "separation", "fluid"} <= places
    )
