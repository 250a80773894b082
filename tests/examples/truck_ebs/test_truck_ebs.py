"""The pneumatic brake at a truck wheel, against closed forms."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import bywire
from bywire.core.errors import InputError
from bywire.plant import air

FOLDER = Path(__file__).parents[3] / "examples" / "truck_ebs"
QUICK = {  # without the delays of valve, rod and pedal
    "relay.tau": "0.01 ms",
    "relay.overlap": "0",
    "relay.p_full": "0.001 bar",
    "ecu.control": "feedforward",
    "ecu.T_bus": "0 s",
    "ecu.T_s": "1 ms",
    "rod.m": "1e-3 kg",
    "rod.d": "1 N*s/m",
    "lever.F_fr": "0 N",
    "lever.mu": "0",
    "caliper.tau": "0 s",  # a damped contact acts before the pads touch, by tau times the speed
    "options.t_pedal": "0 s",
    "options.p_brake": "8.5 bar",
    "options.duration": "160 ms",
    "simulation.record": "0.02 ms",
}


def first(level, values, t):
    """Return when a signal first reaches a level; the massless rod makes it oscillate a little."""
    return float(np.interp(level, np.maximum.accumulate(values), t))


def test_a_chamber_fills_and_moves_as_its_closed_forms():
    result = bywire.run("ebs-response", overrides=QUICK)
    run, par = result.recording, result.bench.par
    t, p, x = (run[name].values for name in ("time", "p", "x"))
    p_a, p_s = par.gas.p_atm, par.p_s + par.gas.p_atm
    flow = par.feed.C * par.gas.p_ref * p_s  # choked, over p_ref: volume times pressure per time
    yields = par.chamber.F_s0 / par.chamber.A_table[0]
    fill = par.chamber.V_0 * yields / flow
    assert yields == pytest.approx(0.3e5)
    assert fill == pytest.approx(4.3e-3, rel=0.01)
    # The rod moves at nearly constant pressure until the pads touch.
    gap = par.caliper.clearance * par.lever.i
    p_end = (par.chamber.F_s0 + par.chamber.k_s * gap) / par.chamber.A_table[0]
    V_end = par.chamber.V_0 + par.chamber.A_table[0] * gap
    contact = (V_end * (p_end + p_a) - par.chamber.V_0 * p_a) / flow
    assert first(yields, p, t) == pytest.approx(4.35e-3, rel=0.01)
    touched = first(gap, x, t)
    assert touched == pytest.approx(contact, rel=0.005)
    assert touched == pytest.approx(11.35e-3, rel=0.02)
    # The stiffness of the pads, 40 kN/mm (1 + y/2 mm), determines the rest.
    at_5_bar = first(5e5, p, t)
    assert at_5_bar == pytest.approx(149.3e-3, rel=2e-3)
    x_5 = float(np.interp(at_5_bar, t, x))
    assert x_5 == pytest.approx(32.9e-3, rel=2e-3)
    y = x_5 / par.lever.i - par.caliper.clearance
    force = par.chamber.A_table[0] * 5e5 - par.chamber.F_s0 - par.chamber.k_s * x_5
    assert 4e7 * y * (1.0 + y / 2e-3) == pytest.approx(par.lever.i * force, rel=2e-3)


def test_the_chamber_takes_23_times_more_air_per_pressure_while_its_rod_moves():
    par = bywire.run("ebs-response", overrides={"options.duration": "1 ms"}).bench.par
    smooth = par.replace({"lever.F_fr": 0.0, "lever.mu": 0.0})
    trim = import_module("truck_ebs.trim")
    touch = par.chamber.F_s0 + par.chamber.k_s * par.caliper.clearance * par.lever.i
    p = touch / par.chamber.A_table[0]

    def travel_per_pressure(p: float, dp: float = 1.0) -> float:
        return (trim.rod_travel(p + dp, smooth) - trim.rod_travel(p, smooth)) / dp

    ratio = travel_per_pressure(p - 10.0) / travel_per_pressure(p + 10.0)
    k_pads = par.caliper.k_1 / par.lever.i**2
    assert ratio == pytest.approx((par.chamber.k_s + k_pads) / par.chamber.k_s, rel=2e-3)
    assert ratio == pytest.approx(23.0, rel=0.02)


def test_pressure_control_has_its_margins_before_and_after_contact():
    for at, crossover in (("0.34 bar", 1.05), ("3 bar", 1.56)):
        row = bywire.margins("chamber-pressure", at=at).tables()["Margins"].iloc[0]
        assert row["phase margin"] > 65.0
        assert row["crossover"] == pytest.approx(crossover, rel=0.02)
    # The integral of a unity plant crosses 1 near k_i/(2 pi).


def test_pressure_control_removes_the_crack_pressure_of_the_relay_valve():
    overrides = {"relay.law": "mechanical", "options.p_brake": "5 bar", "options.duration": "4 s"}
    left = {}
    for control in ("feedforward", "closed-loop"):
        result = bywire.run("ebs-response", overrides=overrides | {"ecu.control": control})
        left[control] = float(result.recording["p"][-1]) - 5e5
        par = result.bench.par
    # The feed seat closes at this difference, and the last air still enters meanwhile.
    closes = par.relay.p_crack + par.relay.overlap * par.relay.p_full - par.relay.p_fr
    assert -closes - 2 * par.relay.p_fr < left["feedforward"] < -0.5 * closes
    assert abs(left["closed-loop"]) < 1.1 * par.ecu.pressure.p_dead


def test_slow_strokes_show_the_friction_of_the_lever():
    result = bywire.run("ebs-hysteresis", overrides={"options.duration": "40 s"})
    run, par = result.recording, result.bench.par
    t, p, F = (run[name].values for name in ("time", "p", "F_cl"))
    mu, F_fr, i = par.lever.mu, par.lever.F_fr, par.lever.i
    for rows, sign in (((t > 2.0) & (t < 18.0), 1.0), ((t > 24.0) & (t < 38.0), -1.0)):
        p_there, F_there = p[rows], F[rows]
        order = np.argsort(p_there)
        force = float(np.interp(4e5, p_there[order], F_there[order]))
        x = float(np.interp(4e5, p_there[order], run["x"].values[rows][order]))
        rod = par.chamber.A_table[0] * 4e5 - par.chamber.F_s0 - par.chamber.k_s * x
        assert force == pytest.approx(i * (rod - sign * F_fr) / (1.0 + sign * mu), rel=2e-3)


@pytest.mark.parametrize("law", ["isothermal", "heat"])
def test_the_energy_of_the_air_is_balanced(law):
    result = bywire.run("ebs-response", overrides={"volume.law": law})
    run, par = result.recording, result.bench.par
    E = {name: float(run[name][-1]) for name in run if str(name).startswith("E_")}
    sinks = ("E_throttling", "E_exhaust", "E_walls", "E_rod", "E_friction", "E_caliper", "E_stop")
    stored = float(run["E_stored"][-1] - run["E_stored"][0])
    pressed = par.chamber.F_s0**2 / (2.0 * par.stop.k_stop)  # energy of the stop at the start
    out = sum(E[name] for name in sinks) + stored + pressed
    assert out == pytest.approx(E["E_source"], rel=1e-6)
    assert not result.warnings
    mass = float(run["m"][-1] - run["m"][0])
    assert float(run["m_fed"][-1] - run["m_out"][-1]) == pytest.approx(mass, rel=1e-12)
    if law == "heat":
        return
    assert E["E_throttling"] > 0.3 * E["E_source"]


def test_the_response_meets_its_times():
    result = bywire.run(FOLDER / "benches" / "response.toml")
    assert result.status == "passed"


def test_air_that_warms_fills_faster_and_sags():
    isothermal = bywire.run("ebs-response").recording
    heat = bywire.run("ebs-response", overrides={"volume.law": "heat"}).recording
    assert float(heat["T"].max()) > 330.0
    assert float(heat["T"][-1]) < 310.0
    assert heat["F_cl"].max() > 0.9 * isothermal["F_cl"].max()


def test_the_kinetic_energy_goes_to_brake_and_tire():
    result = bywire.run("ebs-stop")
    run, par = result.recording, result.bench.par
    v = 80.0 / 3.6
    kinetic = 0.5 * par.corner.body.m * v**2 + 0.5 * par.wheel.J * (v / par.wheel.r) ** 2
    assert float(run["E_brake"][-1] + run["E_tyre"][-1]) == pytest.approx(kinetic, rel=1e-4)
    assert float(run["omega"][-1]) == 0.0
    assert air.gas_constant(par.gas) == pytest.approx(287.87, rel=1e-4)


def test_every_contract_holds():
    assert bywire.check("truck-ebs").holds


def test_pressure_control_detects_a_dead_pilot_valve_but_not_a_lost_demand():
    outcome = bywire.run_faults("truck-ebs").tables()["Faults"].set_index("fault")
    assert outcome.loc["pilot.stuck 0 bar", "class"] == "covered"
    assert outcome.loc["pilot.gain 0.5", "class"] == "covered"
    assert outcome.loc["p_set.stuck 0 bar", "class"] == "undetected"
    assert outcome.loc["ecu.dead", "class"] == "covered"


@pytest.mark.parametrize(
    ("overrides", "faults", "message"),
    [
        ({"feed.b": 1.0}, [], r"feed\.b = 1 is not valid: it must be > 0 and < 1"),
        ({"p_s": "-2 bar"}, [], r"p_s = -2 bar is not valid: it must be > 0 bar"),
        ({"gas.p_atm": "-1 bar"}, [], r"gas\.p_atm = -1 bar is not valid: it must be > 0 bar"),
        ({"chamber.V_0": "0 l"}, [], r"chamber\.V_0 = 0 l is not valid: it must be > 0 l"),
        (
            {},
            ["pilot.stuck=-2 bar@0.1 s"],
            r"pressure = -2 bar .* must be > -1\.013 bar, .* vacuum",
        ),
        ({"caliper.clearance": "6 mm"}, [], r"They must move farther than caliper\.clearance"),
    ],
)
def test_impossible_values_are_rejected(overrides, faults, message):
    with pytest.raises(InputError, match=message):
        bywire.run("ebs-response", overrides=overrides, faults=faults)
