"""Stops against the figures of an independent trial, and what no scheme may get wrong."""

import math

import numpy as np
import pytest

import bywire
from bywire.bench.experiment import as_run
from bywire.brakes.two_wheeler.case import rolling_case
from bywire.simulation.run import simulate

KMH_100 = "100 km/h"
OFF = {"ecu.abs": "off", "ecu.lift": "off", "ecu.p_rate": "1e7 bar/s"}
WET = {"options.surface": "wet-asphalt"}
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
    [(KMH_100, "40 bar", {}, 52.55, 3.81), (KMH_100, "0 bar", {}, 66.36, 4.85),
     ("30 m/s", "40 bar", WET, 90.50, 6.18), ("30 m/s", "0 bar", WET, 124.46, 8.61)],
)  # fmt: skip
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


def test_a_controlled_stop_on_wet_road(controlled):
    # By speeds that the ECU estimates from pulses and an accelerometer.
    assert len(controlled.verdicts) == 4
    assert all(verdict.met for verdict in controlled.verdicts)


@pytest.mark.parametrize("surface", ["dry-asphalt", "wet-asphalt", "snow", "dry-cobble"])
def test_a_larger_slip_does_for_every_surface(surface):
    larger = {"ecu.front_slip.slip_set": "0.28", "ecu.rear_slip.slip_set": "0.28"}
    result = stopped(larger, surface=surface, v_0="30 m/s")
    assert result.kpi("braking_efficiency").value >= 85.0
    assert result.kpi("locked_time_front").value == 0.0


def test_mixed_control_sees_the_deceleration_of_its_wheel():
    run = stopped({**WET, "ecu.mix.alpha": "0.95"}, v_0="30 m/s").recording
    steady = run.sel(time=slice(1.0, 2.0))
    slowed = float(steady["v_f"][0] - steady["v_f"][-1]) / 9.81
    assert float(steady["eta_f"].mean()) == pytest.approx(slowed, rel=0.05)


def test_a_stop_is_recorded_to_its_end_on_any_surface():
    for surface in ("dry-asphalt", "snow"):
        result = stopped(OFF, surface=surface)
        last = float(result.recording["time"][-1])
        assert 0.5 * last < result.kpi("stopping_time").value < last


def test_a_slope_on_which_locked_wheels_slide_on_needs_a_duration():
    downhill = {"vehicle.road.gradient": "-0.2"}
    with pytest.raises(bywire.BywireError, match=r"give options.duration"):
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


def test_a_step_of_half_the_length_changes_a_stop_by_less_than_a_centimeter():
    for changes in (WET, {**OFF, **WET}):
        at = [
            stopped({**changes, "simulation.step": step}).kpi("stopping_distance").value
            for step in ("40 us", "20 us")
        ]
        assert abs(at[0] - at[1]) < 0.01


@pytest.mark.parametrize("gradient", ["-0.1", "0", "0.1"])
def test_it_stands_still_on_any_slope(gradient):
    result = stop("slow-stop", gradient=gradient, duration="20 s")
    run = result.recording
    end = result.kpi("stopping_time").value
    assert result.kpi("creep_speed").value < 1e-5
    late = run["x"].sel(time=slice(end + 5.0, None)).values
    assert np.ptp(late) < 1e-5 * 15.0 / 60.0
    assert not run["omega_f"].sel(time=slice(end + 0.2, None)).values.any()
    assert float(run["omega_f"].min()) == 0.0  # no wheel ever turns back


def test_a_slow_stop_rings_as_in_the_trial(slow):
    assert slow.kpi("rebound_speed").value == pytest.approx(0.151, abs=0.001)
    assert slow.kpi("ringing_time").value == pytest.approx(0.79, abs=0.01)
    assert slow.kpi("rollback").value == pytest.approx(4.35e-3, abs=0.05e-3)


def test_it_rolls_off_where_nothing_holds_it():
    par = bywire.parameters("sport600").replace(
        {"vehicle.road.gradient": 0.05, "vehicle.road.gradient_further": 0.05}
    )
    case = rolling_case(par, 1e-3, {}, 2.0)
    run = simulate(as_run(case, 20e-6))
    body, front, rear = par.vehicle.body, par.vehicle.front_wheel, par.vehicle.rear_wheel
    angle = math.atan(0.05)
    pulled = body.g * (math.sin(angle) - front.C_rr * math.cos(angle))
    inertia = body.m + front.J / front.r**2 + rear.J / rear.r**2
    a = np.diff(np.interp([0.5, 1.5], run.time, run["v"]))[0]
    assert -a == pytest.approx(pulled * body.m / inertia, rel=1e-3)


def test_lift_control_keeps_the_rear_wheel_on_the_ground():
    lifted = stop("rear-lift", {"ecu.lift": "off"})
    kept = stop("rear-lift")
    assert lifted.kpi("peak_pitch").value > math.radians(5.0)
    # The tyres' share of the deceleration at lift: what drag takes does not pitch.
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
