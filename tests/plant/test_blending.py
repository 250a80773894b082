"""Regenerating motor and friction brake at a wheel: dips of the sum, and recovered energy."""

from collections import deque

import numpy as np
import pytest

from bywire.control import blending, torque_bus
from bywire.core.errors import ParameterError
from bywire.plant import traction_battery, wheel_motor
from raising import raises

M, R, A = 400.0, 0.3, 3.0
TAU_B, T_D, T = 0.060, 0.010, 1e-3
MOTOR = {
    "T_max": 500.0,
    "P_max": 25e3,
    "eta": 1.0,
    "v_1": 15 / 3.6,
    "v_2": 5 / 3.6,
    "tau": 0.010,
}


LAW = {"category": "B", "rate": 1e5, "T_least": 0.0, "t_off": 0.05, "t_back": 0.3}


def stop(law, P_bat=25e3):
    """Return time, speed, demand, motor torque and friction torque of a stop from 100 km/h."""
    motor = wheel_motor.Parameters.create(MOTOR)
    par = blending.Parameters.create(LAW | {"law": law})
    x, state, T_b, v = wheel_motor.State(0.0), blending.State(0.0, 0.0), 0.0, 100 / 3.6
    ticks = round(T_D / T)
    reports, commands = (deque([0.0] * ticks, ticks) for _ in range(2))
    rows = []
    for k in range(12000):
        demand = M * A * R * min(k * T / 0.3, 1.0)
        ahead = v - (x.T + T_b) / (M * R) * (T_D + TAU_B)
        limits = [wheel_motor.limit(w / R, w, P_bat, motor) for w in (v, max(ahead, 0.0))]
        u = blending.Input(demand, 0.0, *limits, reports[0], 0.0)
        state, out = blending.output(state, u, T, par)
        delayed = commands[0]
        reports.append(x.T)
        commands.append(out.T_friction)
        rows.append((k * T, v, demand, x.T, T_b))
        missing = wheel_motor.balance(x, wheel_motor.Input(out.T_motor, v / R), motor)
        x = wheel_motor.State(x.T + T * missing / motor.tau)
        T_b += T * (delayed - T_b) / TAU_B
        v -= T * (x.T + T_b) / (M * R)
        if v <= 0.0:
            break
    return np.array(rows).T


def dip(law):
    """Return the largest lack of torque during the fade [N m]."""
    _, v, demand, T_m, T_b = stop(law)
    fading = (v < 15 / 3.6) & (v > 1 / 3.6)
    return float((demand - T_m - T_b)[fading].max())


@pytest.mark.parametrize(
    ("law", "lag"), [("reported", TAU_B + 2 * T_D), ("commanded", TAU_B + T_D - 0.010)]
)
def test_the_dip_while_the_motor_fades(law, lag):
    s = 500.0 * A / (10 / 3.6)
    closed = s * lag / (1.0 + s * lag / 360.0)
    assert dip(law) == pytest.approx(closed, rel=0.03)


def test_prediction_removes_most_of_the_dip():
    assert dip("predicted") <= 0.05 * 360.0
    assert dip("predicted") < 0.5 * dip("commanded")


def test_most_of_the_energy_is_recovered():
    _, v, _, T_m, T_b = stop("reported")
    motor, friction = (float(np.sum(torque * v / R) * T) for torque in (T_m, T_b))
    kinetic = 0.5 * M * (100 / 3.6) ** 2
    assert motor / kinetic == pytest.approx(0.933, rel=0.005)
    assert motor + friction == pytest.approx(kinetic, rel=2e-3)


def test_a_full_battery_leaves_the_stop_to_the_friction_brake():
    _, _, demand, T_m, T_b = stop("commanded", P_bat=0.0)
    assert np.all(T_m == 0.0)
    assert T_b[5000] == pytest.approx(demand[5000], rel=1e-6)
    assert wheel_motor.limit(0.0, 20.0, 0.0, wheel_motor.Parameters.create(MOTOR)) == 0.0


def test_slip_control_takes_the_motor_out_within_its_time():
    par = blending.Parameters.create(LAW | {"law": "commanded"})
    state, u = blending.State(300.0, 0.0), blending.Input(360.0, 0.0, 300.0, 300.0, 300.0, 1.0)
    for _ in range(50):
        state, out = blending.output(state, u, T, par)
    assert out.T_motor == pytest.approx(0.0, abs=1e-9)
    assert out.T_friction == pytest.approx(360.0)


def test_the_motor_waits_after_slip_control():
    par = blending.Parameters.create(LAW | {"law": "commanded"})
    state, u = blending.State(300.0, 0.0), blending.Input(360.0, 0.0, 300.0, 300.0, 300.0, 0.0)
    torques = []
    for k in range(500):
        state, out = blending.output(state, u._replace(slip=1.0 if k < 10 else 0.0), T, par)
        torques.append(out.T_motor)
    assert torques[300] == 0.0  # 0.3 s after the last tick of slip control
    assert torques[320] == 300.0


def test_outside_the_service_brake_the_motor_adds_to_the_friction_demand():
    par = blending.Parameters.create(LAW | {"category": "A", "law": "reported"})
    u = blending.Input(360.0, 80.0, 300.0, 300.0, 80.0, 0.0)
    state, out = blending.output(blending.State(0.0, 0.0), u, T, par)
    assert out == (80.0, 360.0)
    _, within = blending.output(state, u, T, par.replace({"category": "B"}))
    assert within == (180.0, 360.0)  # 440 N m of both demands, of which 80 N m are reported


def test_the_torque_must_fade_at_a_lower_speed():
    with raises(ParameterError, name="v_1", valid="> v_2"):
        wheel_motor.Parameters.create(MOTOR | {"v_1": 1.0})


# --- Charging limit of the battery

CELLS = {
    "law": "cells",
    "P_max": 25e3,
    "Q": 1.35e5,
    "V_0": 320.0,
    "V_1": 410.0,
    "V_max": 410.0,
    "R": 0.4,
    "I_max": 75.0,
    "T": 298.15,
    "T_cold": 263.15,
    "T_warm": 283.15,
}


@pytest.mark.parametrize(
    ("soc", "changes", "power"),
    [
        (1.0, {}, 0.0),  # full
        (0.9, {}, 22.5 * 410.0),  # by the largest terminal voltage
        (0.3, {"P_max": 1e6}, 75.0 * (347.0 + 0.4 * 75.0)),  # by the largest current
        (0.3, {}, 25e3),
        (0.3, {"T": 273.15}, 37.5 * (347.0 + 0.4 * 37.5)),
        (0.3, {"T": 253.15}, 0.0),
        (1.0, {"law": "constant"}, 25e3),
    ],
)
def test_the_charging_limit_follows_from_charge_and_temperature(soc, changes, power):
    par = traction_battery.Parameters.create(CELLS | changes)
    limit = traction_battery.charging_limit(traction_battery.State(soc), par)
    assert limit == pytest.approx(power, rel=1e-12)


def test_the_battery_needs_a_finite_limit():
    with raises(ParameterError, name="P_max", value="inf"):
        traction_battery.Parameters.create(CELLS | {"P_max": float("inf")})
    with pytest.raises(ParameterError, match="P_max"):
        traction_battery.Parameters.create({k: v for k, v in CELLS.items() if k != "P_max"})


def test_a_bus_delays_by_whole_sample_times():
    par = torque_bus.Parameters(T_d=T_D)
    state, seen = torque_bus.State(*[0.0] * torque_bus.SLOTS), []
    for k in range(20):
        state, out = torque_bus.output(state, torque_bus.Input(float(k)), T, par)
        seen.append(out.T_received)
    assert seen == pytest.approx([0.0] * 10 + list(range(10)), abs=1e-9)
