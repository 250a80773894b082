"""Stops against the figures of an independent trial, and what no scheme may get wrong."""

import math

import numpy as np
import pytest

import bywire
from bywire.bench.energy_ledger import actuator_ledger
from bywire.plant.road import SURFACES as SETS
from bywire.report.bench_figures import bench_figures
from raising import raises

KMH_100 = "100 km/h"
OFF = {"ecu.abs": "off", "ecu.lift": "off", "ecu.p_rate": "1e7 bar/s"}
WET = {"options.surface": "wet-asphalt"}
SURFACES = ["dry-asphalt", "wet-asphalt", "snow", "dry-cobble", "wet-cobble"]
LONG = ("snow", "wet-cobble")
SHORTER = [pytest.param(s, marks=pytest.mark.trust) if s in LONG else s for s in SURFACES]
"""where a stop takes as long as on all others; rules stop there, too"""
KNOWN = {"ecu.sees": "known", "sensors.encoder.law": "ideal"}


def stop(experiment, changes=None, **options):
    given = {f"options.{name}": value for name, value in options.items()}
    return bywire.run(experiment, {**(changes or {}), **given}, estimate_error=False)


def stopped(changes, **options):
    return stop("straight-stop", changes, **options)


@pytest.fixture(scope="module")
def locked():
    return stopped({**OFF, **WET}, v_0="30 m/s")


@pytest.fixture(scope="module")
def controlled():
    return bywire.run("benches/wet_stop.toml", estimate_error=False)


@pytest.fixture(scope="module")
def slow():
    return stop("slow-stop", gradient="0.05")


@pytest.mark.parametrize(
    ("v_0", "rear", "changes", "distance", "time"),
    [
        (KMH_100, "40 bar", {}, 52.55, 3.81),
        (KMH_100, "0 bar", {}, 66.36, 4.85),
        ("30 m/s", "40 bar", WET, 90.50, 6.18),
        ("30 m/s", "0 bar", WET, 124.46, 8.61),
    ],
)
def test_uncontrolled_stops_are_those_of_the_trial(v_0, rear, changes, distance, time):
    result = stopped({**OFF, **changes}, v_0=v_0, p_rear=rear, duration="10 s")
    assert result.kpi("stopping_distance").value == pytest.approx(distance, abs=0.01)
    assert result.kpi("stopping_time").value == pytest.approx(time, abs=0.006)


def test_energy_of_the_vehicle_closes(locked, controlled, slow):
    for result in (locked, controlled, slow):
        run = result.recording
        taken = sum(run[name] for name in run if name.startswith("E_"))
        left = (taken - run["W_slope"] - run["W_pitch"]).values
        assert np.abs(left - left[0]).max() < 1e-11 * float(run["E_vehicle"][0])
        assert float(run["E_brake_f"][-1]) > 0.0  # it is no balance of zeros


def test_a_mass_that_comes_on_top_while_it_rolls_stands_in_the_books():
    faults = [{"set": {"vehicle.body.m": "+20%"}, "onset": 1.0}]
    bench = bywire.Bench("straight-stop", "sport600", options={"duration": 2.0}, faults=faults)
    recording = bywire.run(bench, estimate_error=False).recording
    books = actuator_ledger(recording)
    v, phi = (recording[name].sel(time=1.0, method="nearest").item() for name in ("v", "phi"))
    # Its speed, and its height above that of a rear wheel that does not sink into the ground.
    height = 0.69 * math.sin(phi) - 0.62 * (1.0 - math.cos(phi))
    wanted = 53.0 * (0.5 * v * v + 9.81 * height)
    assert recording["E_change"][-1].item() == pytest.approx(wanted, rel=1e-9)
    assert abs(books.closing_error) < 1e-6 * books.turnover


def test_a_controlled_stop_on_wet_road(controlled):
    # By speeds that the ECU estimates from pulses and an accelerometer.
    assert len(controlled.verdicts) == 4
    assert all(verdict.met for verdict in controlled.verdicts)


@pytest.mark.parametrize("surface", SHORTER)
def test_a_larger_slip_does_for_every_surface(surface):
    larger = {"ecu.front_slip.slip_set": "0.28", "ecu.rear_slip.slip_set": "0.28"}
    result = stopped(larger, surface=surface, v_0="30 m/s")
    assert result.kpi("braking_efficiency").value >= 85.0
    assert result.kpi("locked_time_front").value == 0.0


@pytest.mark.parametrize("surface", SURFACES)
def test_one_set_of_rules_does_for_every_surface(surface):
    result = stopped({"ecu.abs": "rules"}, surface=surface, v_0="30 m/s")
    assert result.kpi("braking_efficiency").value >= 85.0
    assert result.kpi("locked_time_front").value == result.kpi("locked_time_rear").value == 0.0
    assert result.kpi("lift_time").value == 0.0


def test_rules_only_lower_what_is_demanded_and_say_in_which_phase():
    run = bywire.run("benches/wet_stop_by_rules.toml", estimate_error=False).recording
    fast = run.sel(time=slice(0.0, 3.0))
    assert set(np.unique(fast["phase_f"])) == {0.0, 1.0, 2.0, 3.0}
    assert float(fast["p_f_ref"].max()) <= 40e5
    assert (fast["abs_f"] == 1).sum() > 2000
    # Pressure is built up in the first phase and in steps alone, and never within another.
    later = fast["phase_f"].values[1:]
    rises = np.diff(fast["p_f_ref"].values) > 0
    assert set(later[rises]) == {0.0, 3.0}
    # The rear brake is too weak to lock its wheel there, so the rules do not act.
    assert not fast["phase_r"].values.any()


SLIPS = {"ecu.front_slip.slip_set": 0.28, "ecu.rear_slip.slip_set": 0.28}


@pytest.mark.parametrize("changes", [{"ecu.abs": "rules"}, SLIPS], ids=["rules", "pi"])
def test_no_control_throws_the_rider_where_the_road_turns_dry(changes):
    result = stop("surface-jump", changes, first="wet-asphalt", further="dry-asphalt")
    assert result.kpi("peak_pitch").value < math.radians(0.5)
    assert result.kpi("stopping_distance").value < 52.0


def test_rules_free_a_wheel_that_locks_where_the_road_turns_into_snow():
    for place, longest in (("15 m", 0.1), ("30 m", 0.25)):
        rules = stop("surface-jump", {"ecu.abs": "rules"}, further="snow", x_change=place)
        assert rules.kpi("longest_lock_front").value < longest


def test_mixed_control_sees_the_deceleration_of_its_wheel():
    run = stopped({**WET, "ecu.mix.alpha": "0.95"}, v_0="30 m/s").recording
    steady = run.sel(time=slice(1.0, 2.0))
    slowed = float(steady["v_f"][0] - steady["v_f"][-1]) / 9.81
    assert float(steady["eta_f"].mean()) == pytest.approx(slowed, rel=0.05)


@pytest.mark.parametrize("surface", SHORTER)
def test_a_stop_is_recorded_to_its_end_on_any_surface(surface):
    result = stopped(OFF, surface=surface)
    last = float(result.recording["time"][-1])
    assert 0.5 * last < result.kpi("stopping_time").value < last


def test_a_slope_on_which_locked_wheels_slide_on_needs_a_duration():
    downhill = {"vehicle.road.gradient": "-0.2"}
    with raises(bywire.BywireError, name="options.duration", valid="> 0 s"):
        stopped({**OFF, **downhill}, surface="snow")
    result = stopped({**OFF, **downhill}, surface="snow", duration="2 s")
    assert "longer options.duration" in result.kpi("stopping_distance").note


def test_slip_alone_is_tuned_to_a_surface():
    result = stopped({}, surface="dry-cobble", v_0="30 m/s")
    assert result.kpi("braking_efficiency").value < 65.0


def test_known_speeds_give_the_stop_of_the_trial():
    result = stopped({**WET, **KNOWN}, v_0="30 m/s")
    assert result.kpi("stopping_distance").value == pytest.approx(60.14, abs=0.03)
    assert result.kpi("stopping_time").value == pytest.approx(3.96, abs=0.02)
    assert result.kpi("peak_slip_front").value == pytest.approx(0.195, abs=0.01)


def test_wheels_alone_do_not_tell_the_speed_where_both_slip():
    lost = stopped(
        {**WET, "ecu.vehicle_speed.law": "wheels", "vehicle.road.grip": "0.5"}, v_0="30 m/s"
    )
    kept = stopped({**WET, "vehicle.road.grip": "0.5"}, v_0="30 m/s")

    def off(result):
        run = result.recording
        fast = run["v"] > 5.0
        return float(np.abs(run["v_hat"] - run["v"]).where(fast).max())

    assert off(kept) < 0.1 < off(lost)


def test_a_stop_on_tyres_that_follow_the_magic_formula():
    steep = {f"vehicle.{end}_tyre.curve": "magic-formula" for end in ("front", "rear")}
    given = {**OFF, **WET, **steep, "vehicle.body.CdA": "0", "vehicle.body.load": "rigid"}
    at = [
        stopped({**given, "simulation.step": step}, v_0="30 m/s", p_rear="80 bar")
        for step in ("40 us", "20 us")
    ]
    far = [result.kpi("stopping_distance").value for result in at]
    assert abs(far[0] - far[1]) < 1e-4
    run = at[1].recording
    taken = sum(run[name] for name in run if name.startswith("E_"))
    left = (taken - run["W_slope"] - run["W_pitch"]).values
    assert np.abs(left - left[0]).max() < 1e-11 * float(run["E_vehicle"][0])
    # With both wheels locked, the vehicle slides at mu(1) g, without drag.
    B, C, D, E = SETS["wet-asphalt"][3:]
    mu = D * math.sin(C * math.atan(B - E * (B - math.atan(B))))
    slides = run.sel(time=slice(2.0, 4.0))
    assert not slides["omega_f"].values.any()
    assert not slides["omega_r"].values.any()
    assert slides["a"].values == pytest.approx(mu * 9.81, rel=1e-9)


@pytest.mark.parametrize(
    ("gradient", "held"),
    [
        ("-0.1", 10),
        ("0", 10),
        ("0.1", 10),
        *(pytest.param(each, 60, marks=pytest.mark.trust) for each in ("-0.1", "0", "0.1")),
    ],
)
def test_it_stands_still_on_any_slope(gradient, held):
    release = f"{held + 3} s"
    result = stop("slope-hold", gradient=gradient, t_release=release, duration=f"{held + 3.1} s")
    end = result.kpi("stopping_time").value
    assert result.kpi("held_time").value > held
    assert result.kpi("creep_speed").value < 1e-5
    assert result.kpi("creep").value < 1e-5
    omega = result.recording["omega_f"].sel(time=slice(None, held + 3.0))
    assert not omega.sel(time=slice(end + 0.2, None)).values.any()
    assert float(omega.min()) == 0.0  # no wheel ever turns back


@pytest.mark.parametrize("gradient", ["0.05", "-0.05"])
def test_it_rolls_off_where_nothing_holds_it(gradient):
    result = stop("slope-hold", gradient=gradient, t_release="3 s", duration="5 s")
    body, angle = bywire.parameters("sport600").vehicle.body, math.atan(0.05)
    closed = body.g * (math.sin(angle) - 0.015 * math.cos(angle))
    closed *= body.m / (body.m + 0.50 / 0.30**2 + 0.65 / 0.31**2)
    assert result.kpi("free_roll_off").value == pytest.approx(closed, rel=1e-12)
    assert result.kpi("roll_off").value == pytest.approx(closed, rel=1e-3)


def test_a_release_after_the_end_is_refused():
    with raises(bywire.BywireError, name="options.t_release", value="30 s", valid="25 s"):
        stop("slope-hold", t_release="30 s", duration="25 s")


def test_a_slow_stop_rings_as_in_the_trial(slow):
    assert slow.kpi("rebound_speed").value == pytest.approx(0.151, abs=0.001)
    assert slow.kpi("ringing_time").value == pytest.approx(0.79, abs=0.01)
    assert slow.kpi("rollback").value == pytest.approx(4.35e-3, abs=0.05e-3)


def test_lift_control_keeps_the_rear_wheel_on_the_ground():
    lifted = stop("rear-lift", {"ecu.lift": "off"})
    kept = stop("rear-lift")
    assert lifted.kpi("peak_pitch").value > math.radians(5.0)
    # Only the tires' part of the deceleration pitches the vehicle, drag does not.
    run = lifted.recording
    k = int(np.argmax(run["support"].values <= 0))
    force = float(run["F_f"][k] + run["F_r"][k])
    assert force / 265.0 == pytest.approx(lifted.kpi("flat_limit").value, rel=0.04)
    assert kept.kpi("air_time").value == 0.0


def test_a_jump_of_the_surface_is_caught():
    result = stop("surface-jump")
    assert result.kpi("peak_slip_front").value < 0.25
    assert result.kpi("locked_time_front").value == 0.0
    assert result.kpi("recovery_time").value < 0.3
    # 15 m on dry road is shorter than a wet stop, and longer than a dry one.
    assert 47.0 < result.kpi("stopping_distance").value < 60.0


def test_quicker_brakes_stop_shorter():
    result = stop("bandwidths", f_n="2 Hz, 10 Hz, 40 Hz")
    distances = [result.kpi(f"stopping_distance_{f}Hz").value for f in (2, 10, 40)]
    assert distances[0] > distances[1] > distances[2]
    assert distances[0] - distances[2] == pytest.approx(64.57 - 59.56, rel=0.1)


def test_the_road_shows_where_tyres_slide_on_what():
    jump = {"further": "snow", "x_change": "30 m", "duration": "13 s"}
    result = stop("surface-jump", {"ecu.abs": "rules"}, **jump)
    figure = next(each.figure for each in bench_figures(result) if each.name == "road-marks")
    _, road = figure.axes
    legend = {text.get_text() for text in road.get_legend().get_texts()}
    assert {"dry asphalt", "snow", "wheel locked"} < legend
    assert len(legend) == 4
    # Of the lanes' bars, the front wheel's are below: it stands from the change of the road on.
    lanes = {each.get_label(): each for each in road.collections}
    bars = [path.get_extents() for path in lanes["wheel locked"].get_paths()]
    run = result.recording
    stands = (run["omega_f"] == 0) & (run["v"] > 5.0)
    locked = run["x"].values[stands.values]
    assert 30.0 < locked[0] < 32.0
    assert bars[0].x0 == pytest.approx(locked[0], abs=0.1)
    assert bars[0].x1 == pytest.approx(locked[-1], abs=0.1)


def test_a_rider_who_asks_for_less_than_the_road_holds_gets_all_of_it():
    gentle = {"kind": "table", "times": "0 s, 0.3 s, 9 s", "values": "0 bar, 6 bar, 6 bar"}
    result = bywire.run(
        "rider-trace",
        {
            **{f"stimulus.p_f_set.{key}": value for key, value in gentle.items()},
            "stimulus.p_f_set.between": "linear",
            "options.duration": "14 s",
        },
        estimate_error=False,
    )
    # All but what is still under way to the brake.
    assert 98.0 < result.kpi("rider_share_front").value < 100.0
    assert "demand is zero" in result.kpi("rider_share_rear").note
    assert result.kpi("rider_share").value == result.kpi("rider_share_front").value


def test_a_rider_who_asks_for_more_gets_a_share():
    result = bywire.run("benches/rider_trace.toml", estimate_error=False)
    run = result.recording.sel(time=slice(0.0, result.kpi("stopping_time").value))
    share = float(run["p_f"].mean() / run["p_f_set"].mean())
    assert result.kpi("rider_share_front").value == pytest.approx(100.0 * share, abs=0.1)
    assert result.kpi("rider_share_front").value < 50.0 < result.kpi("rider_share_rear").value
    assert all(verdict.met for verdict in result.verdicts)
