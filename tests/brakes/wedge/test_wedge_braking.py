"""The wedge brake in closed loop: numbers of the paper's tests, energy, steps, modes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from wedge_runs import IDEAL, brake, drive, residual

import bywire
from bywire.brakes.wedge.laws.moment_control import GAP, MOMENT, PARKED, RETRACTING
from run_once import run_once

NAMES = ("moment-pulses", "moment-ramp", "moment-pulse-950", "power-off-hold")


@pytest.fixture(scope="module")
def results():
    return {name: run_once(bywire.Bench(name, "roberts2003")) for name in NAMES}


def test_every_substep_settles(results):
    for result in results.values():
        assert result.recording.attrs["unsettled_substeps"] == 0
        assert result.warnings == []


def test_pulses(results):
    """Contact is at 39 ms as in the trial, and 90 % is reached after 74 ms (91 in the trial)."""
    kpi = results["moment-pulses"].kpi
    assert kpi("contact_time").value == pytest.approx(0.039, abs=0.002)
    assert kpi("time_to_90").value == pytest.approx(0.074, abs=0.002)
    assert kpi("hold_moment").value == pytest.approx(200.0, abs=2.0)
    assert kpi("hold_ripple").value == pytest.approx(30.0, abs=3.0)
    # Standby and some 5 W against 11 kW.
    assert kpi("hold_power").value - 20.0 == pytest.approx(5.0, abs=1.0)
    assert kpi("brake_power").value > 11e3


def test_large_pulse(results):
    kpi = results["moment-pulse-950"].kpi
    assert kpi("time_to_90").value == pytest.approx(0.1, abs=0.01)
    assert kpi("disc_share").value == pytest.approx(96.0, abs=2.0)
    assert kpi("peak_power_filtered").value == pytest.approx(60.0, abs=8.0)
    assert kpi("parking_time").value < 0.2


def test_modes_follow_each_other(results):
    mode = results["moment-pulse-950"].recording["mode"].values
    changes = mode[np.flatnonzero(np.diff(mode, prepend=-1.0))]
    assert changes.tolist() == [PARKED, GAP, MOMENT, RETRACTING, PARKED]


def test_brake_without_power_does_not_creep(results):
    kpi = results["power-off-hold"].kpi
    assert kpi("drift").value == 0.0
    assert abs(kpi("relaxation").value) < 1e-6
    assert kpi("preload_end").value > 300.0


@pytest.mark.parametrize(("mu_B", "moment", "holds"), [(0.45, 500.0, True), (0.6, 950.0, False)])
def test_power_off_above_the_neutral_point(mu_B, moment, holds):
    run = drive(
        brake(mu_B=mu_B),
        2.0,
        M_set=lambda t: moment + 0.0 * t,
        power_off=lambda t: np.where(t > 0.8 - 1e-9, 1.0, 0.0),
    )
    assert (run["F_end"].max() == 0.0) == holds


def test_energy_and_travel_converge_with_the_square_of_the_step():
    par = brake(IDEAL)
    runs = [
        drive(par, 0.3, step, M_set=lambda t: np.where(t < 0.2, 200.0, 160.0))
        for step in (40e-6, 20e-6, 10e-6)
    ]
    left = [float(np.abs(residual(run)).max()) for run in runs]
    assert left[1] < 1e-6 * runs[1]["E_source"].max()
    for coarse, fine in pairwise(left):
        assert coarse / fine == pytest.approx(4.0, rel=0.15)
    rms = [float(np.sqrt(np.mean((a["x"] - b["x"]) ** 2))) for a, b in pairwise(runs)]
    assert rms[1] < 0.5e-9
    assert rms[0] / rms[1] == pytest.approx(4.0, rel=0.25)


def test_contacts_only_lose_energy():
    run = drive(brake(), 0.3, M_set=lambda t: np.where(t < 0.2, 400.0, 0.0))
    for name in ("E_heart", "E_caliper", "E_copper", "E_damping", "E_shaft", "E_wedge"):
        assert np.diff(run[name]).min() > -1e-7, name


def test_both_directions_are_alike():
    still = IDEAL | {"flywheel.runout": 0.0}
    forward, backward = (
        drive(brake(still | {"flywheel.Omega_0": Omega}), 0.3, M_set=lambda t: 200.0 + 0.0 * t)
        for Omega in (60.0, -60.0)
    )
    np.testing.assert_allclose(backward["x"], -forward["x"], atol=1e-12)
    np.testing.assert_allclose(backward["M_B"], -forward["M_B"], atol=1e-4)


@pytest.mark.parametrize("reading", ["drop", "stick"])
def test_disc_stops_and_the_control_does_not_wind_up(reading):
    par = brake({"flywheel.Omega_0": 5.0, "wedge_friction.stopped_disc": reading})
    run = drive(par, 1.5, M_set=lambda t: np.where(t < 1.2, 300.0, 0.0))
    stopped = run.time > 0.7
    assert not run["Omega"][stopped].any()
    held = stopped & (run.time < 1.19)
    assert np.ptp(run["F_N"][held]) < 0.1 * run["F_N"][held].mean()
    assert run["mode"][-1] == PARKED
    assert run["F_N"][-1] == 0.0


def test_motors_share_the_load_where_they_work_together():
    """Far from the neutral point the scheduled offset saves power against a constant preload."""
    power = []
    for law in ("preload", "scheduled"):
        run = drive(
            brake({"control.offset.law": law}, mu_B=0.2), 2.0, M_set=lambda t: 0.0 * t + 500
        )
        late = run.time > 1.5
        assert run["M_B"][late].mean() == pytest.approx(500.0, abs=2.0)
        power.append(run["P_in"][late].mean())
        assert (run["f_12"][late].max() > 0.0) == (law == "scheduled")
    assert power[1] < 0.8 * power[0]


def test_reference_waits_while_the_motors_cannot_follow():
    """A demand out of reach causes no windup, and the release stays quick."""
    limits = {"drive.i_max": 1.5, "control.position.i_max": 1.5}
    run = drive(brake(limits, mu_B=0.2), 1.5, M_set=lambda t: np.where(t < 1.0, 900.0, 0.0))
    before = run.time < 1.0
    assert run["y_M"][before][-1] < 0.2 * 900.0
    assert np.abs(run["theta_ref"] - run["theta_1"])[before].max() < 1.0
    parked = run.time[(run.time > 1.0) & (run["mode"] == PARKED)]
    assert parked[0] - 1.0 < 0.25
