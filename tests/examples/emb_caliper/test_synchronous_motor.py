"""The caliper with a synchronous motor: figures, current control, energy, loops, export, faults."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bywire as toolkit
from bywire.bench.energy_ledger import energy_residual
from bywire.bench.experiment import Case, as_run
from bywire.core.errors import InputError, ParameterError

SYNCHRONOUS = "emb42v-pmsm"
F = 20e3
STEP = {"F_to": "20 kN"}


@pytest.fixture
def par(caliper: Path) -> Any:
    return toolkit.parameters(SYNCHRONOUS)


@pytest.fixture
def held(emb: Any) -> Callable[..., Any]:
    """Return a function that steps the current of the brake that holds 20 kN, at t = 0."""

    def call(par: Any, extra: float, duration: float = 2e-3) -> tuple[Any, float]:
        balanced = emb("trim").holding_current(F, par)
        case = emb("case").case_from_rest(
            par,
            "current",
            F,
            emb("case").step_at_zero("i_set", balanced, balanced + extra),
            duration,
            record=2e-6,
        )
        return toolkit.simulate(as_run(case, 2e-6)), balanced

    return call


def test_figures_are_close_to_the_dc_motors(caliper: Path) -> None:
    figures = {}
    for name in ("emb42v", SYNCHRONOUS):
        result = toolkit.run(toolkit.Bench("clamp-step", name, options=STEP))
        figures[name] = {each.name: each.value for each in result.kpis}
        assert float(result.recordings["run"]["F_cl"].max()) > F
    dc, synchronous = figures.values()
    for name in ("dead_time", "rise_time", "settling_time", "energy", "speed_max"):
        assert synchronous[name] == pytest.approx(dc[name], rel=0.01), name
    assert synchronous["steady_state_error"] == pytest.approx(dc["steady_state_error"], abs=10.0)


def energies(changes: dict[str, Any], step: str) -> tuple[float, Any]:
    """Return the largest residual of the energy balance as a share of the energy, and the run."""
    bench = toolkit.Bench("clamp-step", SYNCHRONOUS, changes, STEP, step=step)
    recording = toolkit.run(bench).recordings["run"]
    residual = float(np.abs(energy_residual(recording)).max())
    return residual / float(recording["E_source"][-1]), recording


@pytest.mark.parametrize(
    "changes", [{}, {"motor.iron": "drag", "motor.c_h": 10.0, "motor.c_e": 5e-3}]
)
def test_energy_closes_to_second_order(changes: dict[str, Any], caliper: Path) -> None:
    (coarse, _), (fine, recording) = (energies(changes, step) for step in ("20 us", "10 us"))
    assert fine <= 1e-9
    assert coarse / fine == pytest.approx(4.0, abs=0.8)
    assert (float(recording["E_iron"][-1]) > 0.1) == bool(changes)


def test_energy_closes_with_dead_time(caliper: Path) -> None:
    """The kinks at +-i_th need small steps, because each step has a single Newton iteration."""
    changes = {"inverter.law": "dead time", "inverter.V_f": "0.4 V"}
    (coarse, _), (fine, recording) = (energies(changes, step) for step in ("10 us", "5 us"))
    assert coarse <= 1e-6
    assert fine < coarse / 4.0
    assert float(recording["E_inverter"][-1]) > 1.0


@pytest.mark.parametrize(("step", "task"), [("40 us", "current"), ("30 us", "force")])
def test_a_step_that_does_not_divide_the_sample_time_is_refused(
    step: str, task: str, caliper: Path
) -> None:
    with pytest.raises(InputError, match=f"step = {step} does not divide the {task} interval"):
        toolkit.run(toolkit.Bench("clamp-step", SYNCHRONOUS, step=step))


def test_duties_act_one_sample_after_their_tick(held: Any, par: Any) -> None:
    run, balanced = held(par, 3.0)
    waiting = run.time < par.ecu.T_current
    assert np.abs(run["i_q"][waiting] - balanced).max() < 1e-9
    assert run["i_q"][np.searchsorted(run.time, 1.1 * par.ecu.T_current)] > balanced + 0.01


def test_a_current_step_has_the_figures_of_the_servo_motor(held: Any, par: Any) -> None:
    """The response of a linear winding depends only on L/R, which is the servo motor's."""
    run, balanced = held(par, 3.0)
    assert not run["omega"].any()  # friction holds
    share = (run["i_q"] - balanced) / 3.0
    for level, expected in ((0.1, 131e-6), (0.9, 449e-6)):
        k = int(np.argmax(share >= level))
        reached = np.interp(level, share[k - 1 : k + 1], run.time[k - 1 : k + 1])
        assert reached == pytest.approx(expected, rel=0.01)
    assert 100.0 * (share.max() - 1.0) == pytest.approx(4.55, rel=0.01)
    assert np.abs(run["i_d"]).max() < 1e-9


@pytest.fixture
def at_speed(emb: Any, par: Any) -> Callable[..., Any]:
    """Return a function that steps the current of a heavy rotor that turns, at t = 0.

    The motor is the servo motor Teknic M-2310P at 24 V. It starts without current.
    """

    def call(omega: float, **changes: Any) -> Any:
        servo = {"p": 4.0, "R": 0.36, "L_d": 0.2e-3, "L_q": 0.2e-3, "psi": 6.395e-3}
        own = {f"motor.{name}": value for name, value in servo.items()}
        own |= {"ecu.current.R_hat": 0.36, "ecu.current.L_d_hat": 0.2e-3}
        own |= {"ecu.current.L_q_hat": 0.2e-3, "ecu.current.psi_hat": 6.395e-3}
        own |= {"supply.V_bat": 24.0, "supply.R_bat": 1e-6, "rotor.J": 10.0, "drive": "current"}
        changed = par.replace(own | changes)
        middle = 4.0 * omega * 0.5 * par.ecu.T_current  # of the first sample
        emf = 4.0 * omega * 6.395e-3 / 24.0
        trim = emb("trim")
        case = Case(
            "run",
            trim.brake_with(changed),
            changed,
            trim.state_at(0.0, changed)._replace(omega=omega),
            trim.memory_at(0.0, changed)._replace(
                next_alpha=-emf * math.sin(middle), next_beta=emf * math.cos(middle)
            ),
            lambda t: {"i_set": np.full(t.shape, 5.0)},
            5e-3,
            record=5e-6,
        )
        return toolkit.simulate(as_run(case, 5e-6))

    return call


def test_a_current_step_at_speed(at_speed: Any) -> None:
    run = at_speed(200.0)
    k = int(np.argmax(run["i_q"] >= 4.5))
    reached = np.interp(4.5, run["i_q"][k - 1 : k + 1], run.time[k - 1 : k + 1])
    assert reached == pytest.approx(453e-6, rel=0.02)
    assert 100.0 * (run["i_q"].max() / 5.0 - 1.0) == pytest.approx(5.3, rel=0.02)
    assert np.abs(run["i_d"]).max() == pytest.approx(0.33, rel=0.03)


@pytest.mark.parametrize(("omega", "overshoot"), [(200.0, 10.8), (350.0, 28.8)])
def test_without_lead_the_held_voltages_turn_away(
    omega: float, overshoot: float, at_speed: Any
) -> None:
    run = at_speed(omega, **{"ecu.current.lead": 0.0})
    assert 100.0 * (run["i_q"].max() / 5.0 - 1.0) == pytest.approx(overshoot, rel=0.03)


@pytest.mark.parametrize("circuit", ["open", "short"])
def test_power_off_is_that_of_the_dc_motor(circuit: str, caliper: Path) -> None:
    options = {"circuit": circuit, "F_from": "10 kN"}
    ends = [
        float(
            toolkit.run(toolkit.Bench("power-off", name, options=options))
            .recordings["run"]["F_cl"]
            .isel(time=-1)
        )
        for name in ("emb42v", SYNCHRONOUS)
    ]
    assert ends[1] == pytest.approx(ends[0], rel=0.01)


def test_phase_margin_of_the_current_loop_is_the_closed_form(command: Any) -> None:
    (margins,) = toolkit.margins("q-current").margins
    # 90 degrees minus the phase of 1.5 sample times at omega_c = 1/(3 T).
    assert margins.phase == pytest.approx(90.0 - math.degrees(1.5 / 3.0), abs=1.0)
    assert margins.stable


@pytest.mark.parametrize(
    "loop",
    [
        "q-current",
        *(pytest.param(each, marks=pytest.mark.trust) for each in ("motor-speed-pmsm",)),
    ],
)
def test_loops_agree_with_their_linear_models(loop: str, caliper: Path) -> None:
    assert toolkit.agreement(loop).holds


def test_a_loop_has_the_margins_of_either_motor(caliper: Path) -> None:
    dc, synchronous = (
        toolkit.margins("clamp-force", parameters=name).margins[0]
        for name in ("emb42v", SYNCHRONOUS)
    )
    assert synchronous.crossover == pytest.approx(dc.crossover, rel=0.02)


def test_exported_ecu_is_equal_bit_for_bit(caliper: Path, tmp_path: Path) -> None:
    exported = toolkit.export_controller(
        "clamp-step", tmp_path, {"parameters": SYNCHRONOUS}, check=True
    )
    assert exported.holds
    hardware = (tmp_path / "emb_caliper_pmsm_io.c").read_text(encoding="utf-8")
    assert "angle_sensor_reading" in hardware


def test_new_elements_can_fail(command: Any) -> None:
    _, out, _ = command("list", "faults")
    for name in ("encoder.turned", "inverter.slow-driver", "motor.demagnetized"):
        assert name in out, name
    code, _, err = command(
        "run",
        "clamp-step",
        "--set",
        f"parameters={SYNCHRONOUS}",
        "--set",
        "options.duration=0.3 s",
        "--fault",
        "encoder.turned=0.1 rad@0.1 s",
    )
    assert code == 0, err


@pytest.mark.parametrize("eps", [0.0175, -0.1])
def test_a_turned_sensor_turns_the_current(eps: float, held: Any, par: Any) -> None:
    turned = par.replace({"encoder.law": "real", "encoder.eps_0": eps, "encoder.counts": 1e7})
    run, balanced = held(turned, 0.5, 20e-3)
    assert not run["omega"].any()
    angle = par.motor.p * eps
    assert run["i_q"][-1] == pytest.approx((balanced + 0.5) * math.cos(angle), rel=1e-4)
    assert run["i_d"][-1] == pytest.approx(-(balanced + 0.5) * math.sin(angle), rel=1e-4)


def test_weaker_magnets_need_more_current(caliper: Path) -> None:
    currents = []
    for changes in ({}, {"motor.psi": "-30 %"}):
        bench = toolkit.Bench("slow-strokes", SYNCHRONOUS, changes, {"speeds": (40.0,)})
        figures = {each.name: each.value for each in toolkit.run(bench).kpis}
        currents.append(figures["current_apply"])
    assert currents[1] / currents[0] == pytest.approx(1.0 / 0.7, rel=1e-3)


def test_an_experiment_tests_only_its_variants(caliper: Path) -> None:
    assert toolkit.Bench("clamp-step", SYNCHRONOUS).system == "emb-caliper-pmsm"
    with pytest.raises(ParameterError, match="Its parameter sets are strathmann2015"):
        toolkit.Bench("approach", SYNCHRONOUS)
    with pytest.raises(ParameterError, match=r"Its parameter sets are .*emb42v-pmsm"):
        toolkit.Bench("clamp-step", "strathmann2015")
    with pytest.raises(ParameterError, match="needs parameters of a emb-caliper, but"):
        toolkit.margins("motor-current", parameters=SYNCHRONOUS)


def test_field_weakening_reaches_the_speed_limit_at_a_low_voltage(caliper: Path) -> None:
    """The back EMF reaches the usable voltage of 24 V at 298 rad/s."""
    figures = []
    for k_fw in (0.0, 300.0):
        changes = {"supply.V_bat": "24 V", "ecu.current.k_fw": k_fw}
        result = toolkit.run(toolkit.Bench("clamp-step", SYNCHRONOUS, changes, STEP))
        figures.append({each.name: each.value for each in result.kpis})
    plain, weakened = figures
    assert plain["speed_max"] < 270.0
    assert weakened["speed_max"] > 295.0
    assert weakened["rise_time"] < 0.9 * plain["rise_time"]


def test_the_compiled_ecu_drives_the_same_run(caliper: Path) -> None:
    python, compiled = (
        toolkit.run(
            toolkit.Bench("clamp-step", SYNCHRONOUS, options=STEP, engine=engine)
        ).recordings["run"]
        for engine in ("auto", "sil")
    )
    for name in ("F_cl", "i_d", "i_q", "omega"):
        np.testing.assert_allclose(compiled[name], python[name], rtol=0.0, atol=1e-9)


def test_a_campaign_injects_the_faults_of_the_new_elements(command: Any, tmp_path: Path) -> None:
    (tmp_path / "clamp.toml").write_text(
        f'experiment = "clamp-step"\nparameters = "{SYNCHRONOUS}"\n[options]\nduration = "0.3 s"\n'
    )
    campaign = tmp_path / "campaign.toml"
    campaign.write_text(
        'bench = "clamp.toml"\n[campaign]\nonly = ["motor.*", "encoder.*", "inverter.*"]\n'
        'healthy = 4\nonset = "0.15 s"\n[[criteria]]\nname = "loss"\nsignal = "F_cl"\n'
        'below_share = "80 %"\nlasting = "20 ms"\n'
    )
    code, out, err = command("faults", campaign, "--json")
    assert code == 0, err
    assert {each["fault"] for each in json.loads(out)["faults"]} == {
        "motor.hot",
        "motor.demagnetized",
        "encoder.turned",
        "inverter.slow-driver",
        "inverter.gates-off",
    }
