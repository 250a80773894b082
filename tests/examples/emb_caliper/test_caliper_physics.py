"""The caliper's physics against closed forms: rest, breakaway, energy, order, stiffness."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import bywire as toolkit
from bywire.bench.energy_ledger import energy_residual
from bywire.bench.experiment import as_run
from bywire.core.errors import ParameterError
from bywire.plant import floating_caliper

F = 20e3


def test_rest_under_load_is_exact(hold: Any, emb: Any, par: Any) -> None:
    made = hold(F, emb("trim").holding_current(F, par))
    assert not made["omega"].any()
    assert np.ptp(made["F_cl"]) == 0.0
    assert made["F_cl"][0] == pytest.approx(F, rel=1e-12)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_breakaway_is_that_of_the_load(way: float, hold: Any, emb: Any, par: Any) -> None:
    balanced = emb("trim").holding_current(F, par)
    torque = par.friction.T_s + par.friction.G * F
    # The current may overshoot its demand a little.
    within = hold(F, balanced + way * 0.97 * torque / par.motor.K_e)
    beyond = hold(F, balanced + way * 1.01 * torque / par.motor.K_e)
    assert not within["omega"].any()
    assert way * (beyond["theta"][-1] - beyond["theta"][0]) > 0.1


def test_strokes_need_the_current_of_the_torque_balance(run: Any, emb: Any, par: Any) -> None:
    strokes = run("slow-strokes", F_top=30e3, speeds=(40.0,), record=1e-3)
    N, f = emb("ecu").travel_per_angle(par), par.friction
    for way in (1.0, -1.0):
        moving = np.flatnonzero(np.abs(strokes["omega"].values - way * 40.0) < 0.2)
        at = moving[np.argmin(np.abs(strokes["F_cl"].values[moving] - F))]
        force = float(strokes["F_cl"].values[at])
        stuck = way * (f.C + f.G * force + par.rotor.D * 40.0)
        assert float(strokes["i"].values[at]) == pytest.approx(
            (N * force + stuck) / par.motor.K_e, rel=0.02
        )


def test_friction_holds_what_the_closed_form_says(run: Any, emb: Any, par: Any) -> None:
    most = emb("experiments.power_off").held_force(par)
    assert most == pytest.approx(2595.0, abs=5.0)
    held = run("power-off", F_from=0.95 * most, duration=0.5)
    assert float(held["F_cl"][-1]) == pytest.approx(0.95 * most, rel=1e-12)
    assert float(held["omega"][-1]) == 0.0
    lost = run("power-off", F_from=1.2 * most, duration=1.5)
    assert float(lost["F_cl"][-1]) < most
    assert float(lost["omega"][-1]) == 0.0


def test_short_circuit_brakes_the_release(run: Any) -> None:
    free, braked = (run("power-off", circuit=circuit) for circuit in ("open", "short"))
    assert float(free["F_cl"][-1]) == 0.0
    assert float(braked["F_cl"][-1]) > 5e3


def test_energy_closes_to_second_order(par: Any) -> None:
    residuals = []
    for step in ("20 us", "10 us"):
        bench = toolkit.Bench("clamp-step", "emb42v", step=step)
        recording = toolkit.run(bench).recordings["run"]
        residuals.append(float(np.abs(energy_residual(recording)).max()))
        assert residuals[-1] < 1e-8 * float(recording["E_source"][-1])
    assert residuals[0] / residuals[1] == pytest.approx(4.0, abs=0.8)


def test_steps_converge_with_the_second_order(emb: Any, par: Any) -> None:
    """A voltage in series with a nonlinear spring, friction left out, pads in touch throughout."""
    smooth = par.replace({"friction.C": 0.0, "friction.T_s": 0.0, "friction.G": 0.0})
    hold = par.motor.R_m * emb("trim").holding_current(F, par)
    case = emb("case").case_from_rest(
        smooth, "voltage", F, lambda t: {"v_set": np.full(t.shape, 1.3 * hold)}, 0.2
    )
    ends = [toolkit.simulate(as_run(case, h))["F_cl"][-1] for h in (200e-6, 100e-6, 50e-6)]
    assert ends[-1] > F + 1e3
    order = np.log2((ends[0] - ends[1]) / (ends[1] - ends[2]))
    assert order == pytest.approx(2.0, abs=0.15)


def test_caliper_is_the_cubic_that_is_passed_on(emb: Any, par: Any) -> None:
    touch = (33.7 - np.sqrt(33.7**2 - 4.0 * 7.23 * 4.97)) / (2.0 * 7.23)  # mm
    for x in (touch, 0.5, 1.0, 1.4):
        told = -7.23 * x**3 + 33.7 * x**2 - 4.97 * x
        n = 1e-3 * (x - touch)
        assert 1e-3 * floating_caliper.elastic(n, par.caliper) == pytest.approx(told, abs=1e-9)
    assert floating_caliper.stiffness(1e-3, par.caliper) == pytest.approx(
        (
            floating_caliper.elastic(1e-3 + 1e-9, par.caliper)
            - floating_caliper.elastic(1e-3 - 1e-9, par.caliper)
        )
        / 2e-9,
        rel=1e-6,
    )


def test_travel_per_angle_is_what_is_passed_on(emb: Any, par: Any) -> None:
    assert 1e3 * emb("ecu").travel_per_angle(par) == pytest.approx(0.0263, abs=5e-5)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"gear.z_ring_1": 12.0}, "z_ring_1 = 12 must be > z_sun_1 = 16"),
        ({"friction.T_s": 0.01}, "T_s = 0.01 N*m must be >= C = 0.0304 N*m"),
        ({"caliper.n_max": 3.2e-3}, "must increase up to n_max"),
        ({"stop.x_end": 1e-3}, "stop.x_end = 0.001 m must be >"),
        (
            {"ecu.T_current": 3e-4},
            "T_current = 0.3 ms must divide T_force = 1 ms. For example, use T_current = 0.1 ms",
        ),
        ({"caliper.clearance": -1e-4}, "caliper.clearance"),
    ],
)
def test_brakes_that_cannot_be_are_refused(change: dict[str, float], words: str, par: Any) -> None:
    with pytest.raises(ParameterError, match=words.replace("*", r"\*")):
        par.replace(change)


def test_a_force_beyond_the_curve_is_refused(emb: Any, par: Any) -> None:
    with pytest.raises(ParameterError, match=r"50 kN is not valid.*<= 4\d"):
        emb("trim").state_at(50e3, par)
