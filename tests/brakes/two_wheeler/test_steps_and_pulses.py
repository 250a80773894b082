"""What half the step changes of a stop, and what the angle at which a pulse wheel starts does."""

import math
from dataclasses import replace

import numpy as np
import pytest

import bywire
from bywire.bench.experiment import as_run
from bywire.bench.kpis.vehicle_stop import standstill
from bywire.brakes.two_wheeler.experiments.straight_stop import STRAIGHT_STOP
from bywire.simulation.ensemble import simulate_group

OFF = {"ecu.abs": "off", "ecu.lift": "off", "ecu.p_rate": "1e7 bar/s"}
KNOWN = {"ecu.sees": "known", "sensors.encoder.law": "ideal"}
RULES = {"ecu.abs": "rules"}


def stop(changes, step):
    """Return a stop on wet asphalt from 30 m/s, computed in steps [us]."""
    given = {"options.surface": "wet-asphalt", "options.v_0": "30 m/s"}
    return bywire.run(
        "straight-stop",
        {**changes, **given, "simulation.step": f"{step} us"},
        estimate_error=False,
    )


@pytest.mark.parametrize("changes", [{}, OFF], ids=["pi", "uncontrolled"])
def test_a_step_of_half_the_length_changes_a_stop_by_less_than_a_centimeter(changes):
    far = [stop(changes, step).kpi("stopping_distance").value for step in (40, 20)]
    assert abs(far[0] - far[1]) < 1e-5


def test_rules_change_nothing_else_until_a_threshold_is_met_a_tick_sooner():
    """Known speeds change the rest of the stop as another angle of the pulses would."""
    one, other = (stop({**RULES, **KNOWN}, step).recording for step in (20, 10))
    rows = min(one.sizes["time"], other.sizes["time"])
    phases = [np.stack([run[f"phase_{end}"].values[:rows] for end in "fr"]) for run in (one, other)]
    apart = int(np.argmax((phases[0] != phases[1]).any(axis=0)))
    decided = np.count_nonzero(np.diff(phases[0][0, :apart]))
    assert decided > 20
    assert np.abs(one["x"].values[:apart] - other["x"].values[:apart]).max() < 1e-4


def distances(step: float, turned: np.ndarray) -> np.ndarray:
    """Return how far stops by rules take whose pulse wheels start turned by angles, (n, 2)."""
    par = bywire.parameters("sport600").replace(RULES)
    options = STRAIGHT_STOP.defaults.replace(
        {"surface": "wet-asphalt", "v_0": 30.0, "duration": 7.0}
    )
    run = as_run(STRAIGHT_STOP.cases(par, options, None)[0], step)
    pulse, T = 2.0 * math.pi / par.sensors.encoder.pulses, par.ecu.T_s
    omega_f, omega_r = run.state.omega_f, run.state.omega_r
    runs = [
        replace(
            run,
            state=run.state._replace(theta_f=front, theta_r=rear),
            memory=run.memory._replace(
                edge_f=-pulse,
                edge_r=-pulse,
                age_f=(pulse + front) / omega_f - T,
                age_r=(pulse + rear) / omega_r - T,
            ),
        )
        for front, rear in turned
    ]
    group = simulate_group(runs, ("x", "v"))
    x, v = group.values
    ends = [standstill(group.time, each) for each in v]
    return np.array([np.interp(t, group.time, each) for t, each in zip(ends, x, strict=True)])


@pytest.mark.trust
def test_rules_scatter_with_the_angle_of_the_pulses_and_not_with_the_step():
    rng = np.random.default_rng(20261123)
    pulse = 2.0 * math.pi / 48.0
    # A nanoradian decides in which tick an edge is seen, and that how the stop goes on.
    near = distances(20e-6, 1e-9 * pulse * rng.random((32, 2)))
    assert np.ptp(near) > 1e-3
    far = [
        np.concatenate([distances(step, pulse * rng.random((512, 2))) for _ in range(8)])
        for step in (40e-6, 20e-6)
    ]
    assert all(0.2 < each.std() < 0.4 for each in far)
    uncertain = math.hypot(*(each.std() / math.sqrt(each.size) for each in far))
    assert uncertain < 0.007
    assert abs(far[0].mean() - far[1].mean()) < 0.01 + uncertain
