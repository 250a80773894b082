"""The truck's brake with an anti-lock system, and with a spring brake that parks it."""

from __future__ import annotations

import numpy as np
import pytest

import bywire

PANIC = {"options.p_brake": "8 bar", "options.duration": "30 s"}


def stop(surface, abs_="rules"):
    return bywire.run(
        "ebs-stop",
        overrides=PANIC
        | {"parameters": "truck-front-abs", "options.surface": surface, "slip.abs": abs_},
    )


def figures(result):
    return {figure.name: figure.value for figure in result.kpis}


@pytest.mark.parametrize("surface", ["dry-asphalt", "snow"])
def test_anti_lock_control_stops_sooner_and_without_a_locked_wheel(surface):
    with_it, without = figures(stop(surface)), figures(stop(surface, "off"))
    assert with_it["locked_time"] == 0.0
    assert without["locked_time"] > 1.0
    assert with_it["stopping_distance"] < 0.95 * without["stopping_distance"]
    assert with_it["braking_efficiency"] > 75.0
    assert with_it["air_used"] > without["air_used"]


def test_the_air_of_an_anti_lock_stop_is_balanced():
    run = stop("wet-cobble").recording
    change = sum(float(run[name][-1] - run[name][0]) for name in ("m", "m_hose"))
    fed, out = float(run["m_fed"][-1]), float(run["m_out"][-1])
    assert fed - out == pytest.approx(change, abs=1e-9 * fed)
    assert fed > 5.0 * change


def test_without_a_lock_the_modulator_hardly_delays_the_brake():
    plain = figures(bywire.run("ebs-stop"))
    through = figures(bywire.run("ebs-stop", overrides={"parameters": "truck-front-abs"}))
    assert through["stopping_distance"] == pytest.approx(plain["stopping_distance"], rel=0.02)


def test_the_spring_brake_holds_the_truck_when_all_air_is_lost():
    result = bywire.run("park")
    found = figures(result)
    assert found["rolled"] < 1e-9
    assert found["least_holding"] > 1.05
    assert found["parked_holding"] > 1.3
    assert found["park_pressure"] < 0.2e5
    assert not result.warnings


def test_a_torn_pipe_releases_the_service_brake_before_the_spring_brake_holds():
    torn = {"burst.C": "4e-7 m^3/(s*Pa)", "options.duration": "6 s"}
    slow = figures(bywire.run("park", overrides=torn | {"hand_valve.C": "2e-8 m^3/(s*Pa)"}))
    fast = figures(bywire.run("park", overrides=torn | {"hand_valve.C": "8e-8 m^3/(s*Pa)"}))
    assert slow["least_holding"] < 0.4
    assert slow["rolled"] > 0.5
    assert fast["least_holding"] > 0.9
    assert fast["rolled"] < 1e-3


def test_a_parked_clamp_force_balances_spring_friction_and_pads():
    result = bywire.run("park", overrides={"options.gradient": 0.0, "options.p_brake": "1 bar"})
    run, par = result.recording, result.bench.par
    x = float(run["x"][-1])
    spring = par.spring.F_s0 - par.spring.k_s * float(run["x_spring"][-1]) - par.spring.F_fr
    spring -= par.spring.A * float(run["p_park"][-1])
    rod = spring - par.chamber.F_s0 - par.chamber.k_s * x
    rod += par.chamber.A_table[0] * float(run["p"][-1])
    closed = par.lever.i * (rod - par.lever.F_fr) / (1.0 + par.lever.mu)
    assert float(run["F_cl"][-1]) == pytest.approx(closed, rel=2e-3)


def test_the_air_of_tank_and_chambers_is_balanced():
    run = bywire.run("park").recording
    change = sum(float(run[n][-1] - run[n][0]) for n in ("m", "m_tank", "m_park"))
    fed, out = (float(run[n][-1] - run[n][0]) for n in ("m_fed", "m_out"))
    assert fed - out == pytest.approx(change, abs=1e-12)


def test_a_broken_spring_lets_the_truck_roll():
    result = bywire.run("park", faults=["spring.broken@-5 s"])
    assert figures(result)["rolled"] > 0.1


def test_the_governor_loads_the_compressor_between_its_pressures():
    run = bywire.run(
        "ebs-stop",
        overrides={
            "parameters": "truck-rear-park",
            "options.p_brake": "8 bar",
            "options.duration": "40 s",
        },
    ).recording
    p, on = run["p_tank"].values, run["on"].values
    edges = np.flatnonzero(np.diff(on))
    assert [on[k + 1] for k in edges] == [1.0, 0.0]
    assert p[edges[0]] == pytest.approx(8.1e5, rel=5e-3)
    assert p[edges[1]] == pytest.approx(9.3e5, rel=5e-3)
