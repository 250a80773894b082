"""Brakes that warm up, on the vehicle: books, locked wheels, fading, stop after stop."""

import numpy as np
import pytest

import bywire
from bywire.bench.energy_ledger import actuator_ledger, further_ledgers
from bywire.bench.experiment import as_run
from bywire.bench.kpis import vehicle_stop
from bywire.brakes.two_wheeler.case import rolling_case
from bywire.brakes.two_wheeler.experiments import repeated_stops
from bywire.brakes.two_wheeler.experiments.repeated_stops import WARM, cooled
from bywire.brakes.two_wheeler.panels import PANELS
from bywire.core.catalog import PARAMETER_SETS
from bywire.plant import disc_heat
from bywire.report.time_traces import drawable
from bywire.simulation.run import simulate
from raising import raises

SPORT600 = PARAMETER_SETS.find("sport600").parameters()
OFF = {"ecu.abs": "off", "ecu.lift": "off", "ecu.p_rate": "1e7 bar/s"}
NO_LOSS = {
    **{f"front.heat.{name}": "0 W/m^2/K" for name in ("h_0", "h_1")},
    **{f"front.heat.{name}": "0 W/K" for name in ("G_dp", "G_open", "G_pf", "G_f")},
    "front.heat.epsilon": "0",
}
STOPS = 6
OFF_SI = {"ecu.abs": "off", "ecu.lift": "off", "ecu.p_rate": 1e12}


def stop(changes=None, **options):
    given = {f"options.{name}": value for name, value in options.items()}
    return bywire.run("straight-stop", {**WARM, **(changes or {}), **given}, estimate_error=False)


@pytest.fixture(scope="module")
def locked():
    return stop({**OFF, **NO_LOSS}, surface="wet-asphalt", p_rear="0 bar").recording


@pytest.fixture(scope="module")
def cold_and_warm():
    return stop({"front.heat.law": "off", "rear.heat.law": "off"}), stop()


@pytest.fixture(scope="module")
def series():
    small = {"options.stops": f"{STOPS}", "options.pause": "5 s", "front.heat.C_d": "450 J/K"}
    return bywire.run("repeated-stops", small, estimate_error=False)


def growth(run, name):
    return float(run[name][-1] - run[name][0])


def test_a_locked_wheel_heats_its_tyre_and_not_its_disc(locked):
    dt = np.diff(locked["time"].values)
    stands = np.isclose(np.diff(locked["t_locked_f"].values), dt, rtol=1e-9)
    slides = stands & (locked["v"].values[1:] > 1.0)
    assert np.count_nonzero(slides) > 1000
    for name in ("E_brake_f", "T_disc_f", "T_pads_f"):  # not one bit: nothing cools here either
        assert not np.diff(locked[name].values)[slides].any()
    assert np.all(np.diff(locked["E_tyre_f"].values)[slides] > 0.0)


def test_discs_that_lose_nothing_rise_by_the_heat_of_their_friction(locked):
    heat = SPORT600.front.heat
    rise = heat.psi * growth(locked, "E_brake_f") / heat.C_d
    assert growth(locked, "T_disc_f") == pytest.approx(rise, rel=1e-7)
    assert rise > 1.0


@pytest.mark.parametrize("changes", [{}, OFF, {"rear.heat.law": "off"}])
def test_books_of_the_heat_close(changes):
    run = stop(changes, p_front="25 bar").recording
    (name, books), *others = further_ledgers(run).items()
    assert (name, others) == ("heat", [])
    assert abs(books.closing_error) < 1e-8 * books.turnover
    discs = growth(run, "E_brake_f") + ("rear.heat.law" not in changes) * growth(run, "E_brake_r")
    assert books.turnover == pytest.approx(discs, rel=1e-9)
    # and those of the vehicle, to which the brakes' heat is one sink, close as ever
    given = growth(run, "W_slope") + growth(run, "W_pitch")
    taken = (
        "E_vehicle",
        "E_brake_f",
        "E_brake_r",
        "E_tyre_f",
        "E_tyre_r",
        "E_drag",
        "E_roll",
        "E_ground",
    )
    left = sum(growth(run, each) for each in taken) - given
    assert abs(left) < 1e-11 * float(run["E_vehicle"][0])


def test_what_changes_put_in_stands_in_the_book_of_its_store():
    # A mass that comes on top is the vehicle's, discs that hold more heat are the heat's.
    changes = {"vehicle.body.m": "+20%", "front.heat.C_d": "+50%"}
    bench = bywire.Bench(
        "straight-stop",
        "sport600",
        options={"duration": 1.5},
        overrides={"front.heat.law": "lumped"},
        faults=[{"set": changes, "onset": 1.0}],
    )
    run = bywire.run(bench, estimate_error=False).recording
    body, heat = actuator_ledger(run), further_ledgers(run)["heat"]
    T = run["T_disc_f"].sel(time=1.0).item() - SPORT600.front.heat.T_a
    assert growth(run, "E_change_heat") == pytest.approx(
        0.5 * SPORT600.front.heat.C_d * T, rel=1e-6
    )
    for books, name in ((body, "E_change"), (heat, "E_change_heat")):
        assert {p.name for p in books.sources} & {"E_change", "E_change_heat"} == {name}
        assert growth(run, name) > 1e-2 * books.turnover
        assert abs(books.closing_error) < 1e-6 * books.turnover


def test_cold_brakes_are_those_without_heat(cold_and_warm):
    cold, warm = cold_and_warm
    assert further_ledgers(cold.recording) == {}
    assert growth(cold.recording, "T_disc_f") == 0.0
    for name in ("v", "x", "omega_f", "p_f"):  # up to 350 degC no pad fades
        np.testing.assert_allclose(warm.recording[name], cold.recording[name], rtol=1e-9, atol=1e-9)


def test_a_parked_brake_cools_by_the_same_equations_in_substeps_and_by_a_fine_integrator():
    par = SPORT600.replace({**WARM, **OFF_SI})
    heat = {
        "front_heat": disc_heat.State(700.0, 500.0, 350.0),
        "rear_heat": disc_heat.State(600.0, 320.0, 300.0),
    }
    run = simulate(as_run(rolling_case(par, 0.0, {}, 20.0, heat=heat), 2e-5))
    fine = cooled(heat, par, 0.0, np.array([0.0, 20.0]))
    for name in ("T_disc_f", "T_pads_f", "T_fluid_f", "T_disc_r", "T_fluid_r"):
        assert run[name][-1] == pytest.approx(fine[name][-1], rel=1e-9)


def test_hot_pads_hold_what_their_friction_leaves():
    par = SPORT600.replace({**WARM, **OFF_SI})
    hot = {
        "front_heat": disc_heat.State(475.0 + 273.15, 400.0, 300.0),
        "rear_heat": disc_heat.State(293.15, 293.15, 293.15),
    }
    case = rolling_case(par, 20.0, {"p_f_set": 10e5, "p_r_set": 10e5}, 0.3, heat=hot)
    run = simulate(as_run(case, 2e-5))
    discs = par.front.disc
    cold = discs.faces * discs.mu_pad * discs.A_cal * discs.r_eff * run["p_f"][-1]
    now = disc_heat.friction(run["T_disc_f"][-1], par.front.heat)
    assert 0.75 < now < 0.8
    assert run["T_f"][-1] == pytest.approx(now * cold, rel=1e-6)


def test_stops_that_repeat_warm_up_and_fade(series):
    value = {kpi.name: kpi.value for kpi in series.kpis}
    before = [value[f"disc_before_{k}"] for k in range(1, STOPS + 1)]
    assert before == sorted(before)
    assert value["distance_last"] > 1.05 * value["distance_first"]
    assert value["pressure_hot"] > 1.1 * value["pressure_cold"]
    assert value["fluid_peak"] > value["fluid_last"] + 20.0
    assert 100.0 < value["fluid_peak_time"] < 600.0


def test_the_last_stop_begins_where_the_one_before_and_the_way_left_it(series):
    course = series.recordings["course-temperatures"]
    last = series.recordings["last"]
    t, number = course["time"].values, course["stop"].values
    assert np.all(np.diff(t) > 0.0)
    begin = int(np.flatnonzero(number == STOPS)[0])
    end = int(np.flatnonzero(number == STOPS - 1)[-1])
    assert t[begin] - t[end] == pytest.approx(5.0)
    for name in ("T_disc_f", "T_pads_f", "T_fluid_f", "T_disc_r", "T_pads_r", "T_fluid_r"):
        assert float(last[name][0]) == pytest.approx(float(course[name][begin]), rel=1e-12)
        inside = last[name].sel(time=1.0).item()
        assert inside == pytest.approx(np.interp(t[begin] + 1.0, t, course[name].values), rel=1e-9)


def test_a_rider_who_presses_more_keeps_the_deceleration():
    options = {
        "options.stops": "5",
        "options.pause": "1 s",
        "options.v_pause": "0 m/s",
        "front.heat.C_d": "500 J/K",
    }
    held, more = (
        bywire.run("repeated-stops", {**options, "options.hold": hold}, estimate_error=False)
        for hold in ("pressure", "deceleration")
    )
    assert held.kpi("longer").value > 2.0 * more.kpi("longer").value > 0.0


def test_fluid_that_gets_too_hot_is_reported():
    old = {"options.stops": "2", "front.heat.T_wet": "22 degC"}
    result = bywire.run("repeated-stops", old, estimate_error=False)
    (text,) = [text for text in result.warnings if text.startswith("course-temperatures")]
    assert "front brake: the brake fluid exceeds the boiling point of wet fluid, 22 degC" in text


def test_the_time_of_the_peak_is_that_of_the_fluid_and_not_of_a_row():
    short, long, brief = (
        bywire.run(
            "repeated-stops", {"options.stops": "1", "options.parked": parked}, estimate_error=False
        ).kpi("fluid_peak_time")
        for parked in ("900 s", "2000 s", "30 s")
    )
    assert short.value == pytest.approx(long.value, abs=0.02)
    assert "Increase options.parked" in brief.note


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"vehicle.road.gradient": "-0.9", "options.v_0": "10 m/s"}, "stop 1"),
        ({"options.stops": "2.5"}, "stops"),
        ({"options.share": "1.2"}, "share"),
        ({"options.pause": "0 s"}, "pause"),
    ],
)
def test_series_that_make_no_sense_are_refused(changes, name):
    with raises(bywire.BywireError, name=name):
        bywire.run("repeated-stops", {"options.stops": "2", **changes}, estimate_error=False)


def test_the_series_is_told_to_the_substep():
    options = repeated_stops.EXPERIMENT.defaults.replace({"stops": 2.0, "pause": 5.0})
    course = repeated_stops.static(SPORT600, options)["course-temperatures"]
    last = repeated_stops.cases(SPORT600, options)[1]
    run = simulate(as_run(last, 1e-5))
    end = float(course["T_disc_f"].values[course["stop"].values == 2.0][-1])
    still = vehicle_stop.standstill(run.time, run["v"])
    assert np.interp(still, run.time, run["T_disc_f"]) == pytest.approx(end, abs=1e-5)


def test_time_traces_show_temperatures_that_move(cold_and_warm):
    shown = [
        {panel.quantity for panel, _ in drawable(each.recording, PANELS.panels)}
        for each in cold_and_warm
    ]
    assert shown[1] - shown[0] == {"discs", "pads"}
