"""The wedge brake's maneuvers: release, positioning within the clearance, stop."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import bywire
from brakes.wedge.wedge_runs import TAN_ALPHA
from bywire.bench.experiment import as_run
from bywire.bench.recording import record
from bywire.brakes.wedge import control as wedge_control
from bywire.brakes.wedge.case import FRICTIONLESS
from bywire.brakes.wedge.control import Memory, Readings, Stimulus
from bywire.brakes.wedge.model import WedgeBrake
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.simulation.run import simulate
from run_once import run_once

NAMES = ("moment-release", "position-step", "disc-stop")


@pytest.fixture(scope="module")
def results():
    return {name: run_once(bywire.Bench(name, "roberts2003")) for name in NAMES}


def values(result):
    return {kpi.name: kpi.value for kpi in result.kpis}


def run(name, options=None, **overrides):
    changes = {key.replace("__", "."): value for key, value in overrides.items()}
    bench = bywire.Bench(name, "roberts2003", changes, options or {}, step=40e-6)
    return run_once(bench)


def test_every_substep_settles_and_nothing_warns(results):
    for result in results.values():
        assert result.warnings == []
        for recording in result.recordings.values():
            assert recording.attrs["unsettled_substeps"] == 0


def test_variant_above_the_neutral_point_stops_the_disc():
    stop = values(run_once(bywire.Bench("disc-stop", "roberts2003-unstable")))
    assert math.isfinite(stop["parking_time_drop"])


@pytest.mark.parametrize("parameters", ["roberts2003-unstable", "roberts2003-steep"])
def test_variants_brake_and_let_go(parameters):
    """Above tan(alpha), and with a steeper wedge, closed loop and release work alike."""
    release, sweep = (
        values(run_once(bywire.Bench(name, parameters)))
        for name in ("moment-release", "friction-sweep")
    )
    par = bywire.parameters(parameters)
    assert isinstance(par, WedgeParameters)
    slope = 2.0 * par.wedge.mu_B * par.caliper.r_B * par.caliper.K_cal * math.tan(par.wedge.alpha)
    assert par.control.moment.slope_hat == pytest.approx(slope * par.screw.lead / (2.0 * math.pi))
    assert release["drag_moment"] == 0.0
    assert sweep["unstable"] == 0.0


# Release


def test_release_frees_the_disc(results):
    kpi = values(results["moment-release"])
    assert kpi["moment_start"] == pytest.approx(500.0, rel=0.03)  # the runout's ripple
    assert 0.0 < kpi["time_to_5"] < kpi["release_time"] < kpi["parking_time"] < 0.12
    assert kpi["drag_moment"] == 0.0
    # The free-plays are all that may be missing.
    assert kpi["clearance_nominal"] - kpi["clearance_regained"] < 20e-6 * TAN_ALPHA
    par = bywire.parameters("roberts2003")
    assert kpi["energy_in"] > par.supply.P_standby * kpi["parking_time"]


def test_drag_of_a_warped_disc_shows():
    """A runout above the clearance touches the parked pads once per revolution."""
    kpi = values(run("moment-release", flywheel__runout=0.25e-3))
    overlap = 0.25e-3 - kpi["clearance_regained"]
    par = bywire.parameters("roberts2003")
    drag = 2.0 * par.wedge.mu_B * par.caliper.K_cal * overlap * par.caliper.r_B
    assert kpi["drag_moment"] == pytest.approx(drag, rel=0.05)


# Position


def test_steps_within_the_clearance(results):
    kpi = values(results["position-step"])
    assert kpi["normal_force_low"] == kpi["normal_force_high"] == 0.0
    # "Very little difference" to preloaded screws without the wedge; a loop of low bandwidth has
    # little current to overcome the wedge's friction with, and shows it.
    assert kpi["difference_screws_high"] < 1.0
    assert 3.0 < kpi["difference_screws_low"] < 8.0
    assert kpi["difference_motors_high"] > kpi["difference_screws_high"]
    assert kpi["current_limited_high_1000mrad"] > kpi["current_limited_high_250mrad"] > 0.0
    assert kpi["current_limited_low_1000mrad"] == 0.0


def test_friction_that_a_step_leaves_behind(results):
    """Without an integral term, a shaft sticks within breakaway torque over loop stiffness.

    The wedge's friction and the screws' compression shift both shafts by little more.
    """
    par = bywire.parameters("roberts2003")
    bearing, screw = par.bearing, par.screw
    F = 600.0  # above the largest contact force of these runs
    torque = (bearing.C_0 + bearing.C_2 * F**2) * (1.0 + bearing.G_S) + par.motor_1.T_cog
    torque += (1.0 / screw.eta_f - 1.0) * F * screw.lead / (2.0 * math.pi)
    kpi = values(results["position-step"])
    for band, f_n in (("low", 12.0), ("high", 60.0)):
        stiffness = par.motor_1.J_M * (2.0 * math.pi * f_n) ** 2
        for amplitude in ("250mrad", "500mrad", "1000mrad"):
            assert 0.0 < kpi[f"steady_state_error_{band}_{amplitude}"] < torque / stiffness
    for recording in results["position-step"].recordings.values():
        assert np.abs(recording["f_1"]).max() < F


def test_step_without_friction_is_the_loop_of_second_order():
    """Rise time and overshoot follow from natural frequency and damping ratio without load."""
    zeta = 0.5
    free = FRICTIONLESS | {
        "control.position.zeta": zeta,
        "control.position.f_speed": 1500.0,
        "motor_1.T_cog": 0.0,
        "motor_2.T_cog": 0.0,
    }
    options = {"amplitudes": (0.5,), "f_high": 20.0, "delta": 0.0, "duration": 1.0}
    kpi = values(run_once(bywire.Bench("position-step", "roberts2003", free, options)))
    for band in ("low", "high"):
        found = kpi[f"overshoot_{band}_500mrad"]
        ideal = 100.0 * math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2))
        assert found == pytest.approx(ideal, abs=1.5)
        assert kpi[f"steady_state_error_{band}_500mrad"] < 1e-3
    # Rise times of one shape are as the periods.
    ratio = kpi["rise_time_low_500mrad"] / kpi["rise_time_high_500mrad"]
    assert ratio == pytest.approx(20.0 / 12.0, rel=0.03)


# Stop


def test_disc_stops_and_stays_clamped(results):
    kpi, result = values(results["disc-stop"]), results["disc-stop"]
    for reading in ("drop", "stick"):
        recording = result.recordings[reading]
        par = bywire.parameters("roberts2003")
        # The energy that remains below Omega_still is less than a joule.
        energy = 0.5 * par.flywheel.J_F * 5.0**2
        assert float(recording["W_brake"][-1]) == pytest.approx(energy, rel=1e-6)
        assert kpi[f"moment_before_stop_{reading}"] == pytest.approx(300.0, rel=0.03)
        assert abs(kpi[f"reference_change_{reading}"]) < 0.05
        assert kpi[f"force_change_{reading}"] < 1.0
        assert kpi[f"release_time_{reading}"] < 0.1
        assert math.isfinite(kpi[f"parking_time_{reading}"])
    # As the pad's friction no longer pulls the wedge in, it slides back.
    assert kpi["force_held_drop"] < kpi["force_before_stop_drop"]
    assert kpi["force_held_drop"] < 0.95 * kpi["force_held_stick"]


@pytest.mark.parametrize("reading", ["drop", "stick"])
def test_held_wedge_is_in_balance(results, reading):
    """At rest, the actuation force differs from tan(alpha) F_N by the friction at most."""
    par = bywire.parameters("roberts2003")
    last = results["disc-stop"].recordings[reading].sel(time=1.4, method="nearest")
    F_M, F_N = float(last["F_M"]), float(last["F_N"])
    squeeze = float(last["f_1"] + last["f_2"])
    bound = par.wedge_friction.mu_int * squeeze * TAN_ALPHA + par.wedge_friction.mu_R * F_N
    if reading == "stick":
        bound += par.wedge.mu_B * F_N
    assert float(last["Omega"]) == 0.0
    assert float(last["v"]) == 0.0
    assert F_N > 1000.0
    assert abs(F_M - TAN_ALPHA * F_N) <= bound * (1.0 + 1e-9)


class SensorTrusted(WedgeBrake):
    """A brake whose moment control believes that the disc turns for ever."""

    def _moment(self, x, m: Memory, u: Stimulus, par: WedgeParameters) -> Memory:
        seen = Readings(x.theta_1, x.theta_2, M=x.y_M, Omega=60.0)
        return wedge_control.moment_tick(seen, m, u, par)


def test_control_without_standstill_logic_winds_up():
    """The windup figure shows that a sensor on a disc at rest reads zero."""
    bench = bywire.Bench("disc-stop", "roberts2003")
    case = next(one for one in bench.cases() if one.label == "drop")
    made = as_run(replace(case, model=SensorTrusted()), bench.step)
    stop = record(made, simulate(made), case.settle, case.keep, {})
    found = {one.label: stop for one in bench.cases()}
    kpis = {k.name: k.value for k in bench.definition.judge(found, bench.chosen_options)}
    assert kpis["reference_change_drop"] > 5.0
    assert kpis["force_change_drop"] > 1000.0


ODD = [
    ("moment-release", {"M_hold": 2.0}),
    ("moment-release", {"duration": 0.02, "settle": 0.01}),
    ("position-step", {"amplitudes": (1e-4, 3.0), "duration": 0.05}),
    ("position-step", {"amplitudes": (0.1,), "delta": -1e-4}),
    ("disc-stop", {"Omega_0": 0.0}),
    ("disc-stop", {"Omega_0": -5.0, "t_hold": 0.3}),
    ("disc-stop", {"M_brake": 2.0, "t_hold": 0.002, "t_end": 0.002}),
]


@pytest.mark.parametrize(("name", "options"), ODD)
def test_odd_options_give_figures_or_reasons(name, options):
    result = run(name, options)
    for kpi in result.kpis:
        assert math.isfinite(kpi.value) or kpi.note, kpi.name
