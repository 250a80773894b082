"""Generic experiments on a user's brake of one file, compared with closed forms."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import bywire
from bywire.bench.ensemble import key_figures_of
from bywire.bench.experiment import EXPERIMENTS
from bywire.bench.generic_experiment import GENERIC_EXPERIMENTS
from bywire.core.brake import load_system
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import (
    InputError,
    ModelError,
    ParameterError,
    UnitError,
    UnknownNameError,
)
from bywire.core.model import ASSEMBLIES
from bywire.core.signals import signals_of
from bywire.report.bench_figures import bench_figures
from raising import raises
from run_once import run_once
from systems.loading import SPRING_AXIS, forgotten, loaded

SET = "spring-axis-one"
K, M, D, F_C, K_C = 1e4, 2.0, 60.0, 5.0, 200.0
SMOOTH = {"F_c": 0.0, "k_c": 1e-9}
STEP = {"kind": "step", "start": 0, "end": "100 N", "t_step": 0}


@pytest.fixture(autouse=True, scope="module")
def axis() -> Iterator[None]:
    """Register the brake."""
    with loaded(SPRING_AXIS):
        yield


def bench(experiment: str, options: dict[str, Any] | None = None, **more: Any) -> bywire.Bench:
    """Return a bench of the brake, driven by its force."""
    chosen = {"input": "F_set", **(options or {})} if experiment != "stribeck" else options or {}
    return bywire.Bench(experiment, SET, options=chosen, **more)


@pytest.mark.parametrize("name", sorted(GENERIC_EXPERIMENTS.all()))
def test_every_one_runs_with_its_defaults_and_gives_what_it_declares(name: str) -> None:
    driven = name in ("open-loop", "tracking")
    made = bench(name, stimulus=STEP if driven else {})
    result = run_once(made)
    assert result.status == "done"
    assert {kpi.name: kpi.unit for kpi in result.kpis} == made.definition.kpis_with(
        made.chosen_options
    )
    for kpi in result.kpis:
        assert kpi.definition.endswith(".")
        assert math.isfinite(kpi.value) or kpi.note
    shown = {figure.name for figure in bench_figures(result)}
    assert set(made.definition.figures) == shown
    assert "energy-balance" not in shown  # it records no energy
    for recording in result.recordings.values():
        assert all(v.attrs["units"] and v.attrs["long_name"] for v in recording.variables.values())
    assert result.as_object()["kpis"].keys() == {kpi.name for kpi in result.kpis}


@pytest.mark.parametrize("name", sorted(GENERIC_EXPERIMENTS.all()))
def test_cases_side_by_side_have_the_figures_of_single_runs(name: str) -> None:
    """Exactly: sums are in the order of time, regardless of the memory layout of the rows."""
    driven = name in ("open-loop", "tracking")
    options = {"output": "x", "share": 0.5} if name == "duty" else {}
    made = bench(name, options, stimulus=STEP if driven else {})
    benches = [made, *(replace(made, overrides={"m": M * (1.0 + 0.01 * k)}) for k in range(1, 8))]
    figures = key_figures_of(benches)
    for k, each in enumerate(benches):
        assert figures.kpis(k) == bywire.run(each, estimate_error=False).kpis


@pytest.mark.parametrize("parameters", ["dardanelli2010", "roberts2003"])
@pytest.mark.parametrize("name", ["step", "ramp", "sine-sweep", "release", "open-loop"])
def test_every_stimulus_of_our_brakes_can_be_driven(name: str, parameters: str) -> None:
    model = ASSEMBLIES.find(PARAMETER_SETS.find(parameters).assembly)
    for stimulus, signal in signals_of(model.Stimulus).items():
        if stimulus.startswith("noise_"):
            continue
        driven = {"kind": "step", "start": 0, "end": 1, "t_step": 0}
        made = bywire.Bench(
            name,
            parameters,
            options={"input": stimulus},
            stimulus=driven if name == "open-loop" else {},
        )
        (case,) = made.cases()
        assert set(case.stimulus(np.zeros(1))) == {stimulus}
        output = made.chosen_options.flat()["output"]
        assert output != stimulus
        outputs = signals_of(model.Output)
        alike = any(n != stimulus and s.unit == signal.unit for n, s in outputs.items())
        assert (outputs[output].unit == signal.unit) == alike


def test_a_step_has_the_overshoot_of_a_second_order_lag() -> None:
    result = run_once(bench("step", {"output": "x", "end": "200 N"}, overrides=SMOOTH))
    damping = D / (2.0 * math.sqrt(K * M))
    expected = 100.0 * math.exp(-math.pi * damping / math.sqrt(1.0 - damping**2))
    assert result.kpi("overshoot").value == pytest.approx(expected, rel=5e-3)
    assert result.kpi("steady_state_error").note == "the experiment has no set point"
    assert result.recording["x"].values[-1] == pytest.approx(200.0 / K, rel=1e-3)
    assert result.recording["F_set"].values[-1] == 200.0  # its drive is recorded


def test_a_step_of_a_set_point_has_an_error() -> None:
    result = run_once(bench("step", {"output": "F"}))
    assert result.kpi("steady_state_error").value == pytest.approx(0.0, abs=1e-9)


def test_a_ramp_opens_the_loop_of_its_friction() -> None:
    options = {"output": "x", "end": "200 N", "slope": "50 N/s"}
    result = run_once(bench("ramp", options, overrides={"k_c": 1e-9}))
    apart = 2.0 * (F_C + D * 50.0 / K)  # friction and damping, both ways
    assert result.kpi("loop_width_mid").value == pytest.approx(apart + 50.0 * 1e-3, rel=1e-3)
    assert result.kpi("loop_width_mid").unit == "N"
    assert result.kpi("output_max").value == pytest.approx((200.0 - F_C) / K, rel=0.01)
    held = run_once(bench("ramp", {**options, "drive": "F"}, overrides={"k_c": 1e-9}))
    assert held.kpi("loop_width_mid").value == pytest.approx(apart, rel=1e-2)


def test_a_sine_sweep_has_the_gain_of_the_equation() -> None:
    options = {
        "output": "x",
        "mean": 0,
        "amplitude": "10 N",
        "f_start": "1 Hz",
        "f_end": "40 Hz",
        "n": 9,
        "n_settle": 12,
    }
    made = bench("sine-sweep", options, overrides=SMOOTH)
    result = run_once(made)
    setting = made.definition.sweep(made.chosen_options)
    from bywire.bench.kpis.sine_sweep import select

    sweep = select(result.recording, setting)
    w = 2.0 * np.pi * sweep.frequencies
    expected = 1.0 / (K - M * w**2 + 1j * D * w) * np.exp(-0.5j * w * 1e-3)  # held for 1 ms
    assert np.abs(sweep.values / expected - 1.0).max() < 0.03
    assert result.kpi("sweep_gain").value == pytest.approx(abs(expected[0]), rel=1e-2)
    w_b = math.sqrt(K / M) * math.sqrt(1 - 2 * 0.0450 + math.sqrt((1 - 2 * 0.0450) ** 2 + 1))
    assert result.kpi("sweep_bandwidth").value == pytest.approx(w_b / 2 / math.pi, rel=0.1)


def test_a_stribeck_curve_is_the_friction_of_the_model() -> None:
    options = {"along": "x", "levels": ["0 mm", "10 mm"], "speed_max": "0.2 m/s"}
    result = run_once(bench("stribeck", options))
    curve = result.recording["friction"]
    assert curve.dims == ("x", "v")
    assert curve.attrs["units"] == "N"
    assert result.kpi("breakaway_forward").value == pytest.approx(F_C + 0.01 * K_C)
    assert result.kpi("least_friction").value == pytest.approx(F_C)
    assert np.allclose(curve.values[0], np.sign(curve["v"].values + 1e-12) * F_C, atol=2 * F_C)
    assert curve.values[0, 0] == -F_C
    assert curve.values[0, -1] == F_C


def test_a_release_tells_when_it_is_empty_and_what_is_left() -> None:
    options = {"output": "x", "start": "100 N", "empty": "1 mm"}
    result = run_once(bench("release", options, overrides={"k_c": 1e-9}))
    # Without current, it sticks where the spring force is at most the friction.
    assert abs(result.kpi("residual_level").value) <= F_C / K + 1e-6
    assert 0.0 < result.kpi("time_to_empty").value < 0.2


def test_tracking_of_what_is_held_lags_half_a_sample_at_most() -> None:
    stimulus = {
        "kind": "sine",
        "mean": 0,
        "amplitude": "10 N",
        "f": "5 Hz",
        "t_start": 0,
        "phase": 0,
    }
    result = run_once(bench("tracking", {"output": "F"}, stimulus=stimulus))
    assert result.kpi("tracking_max").value < 10.0 * 2.0 * math.pi * 5.0 * 1.1e-3
    with raises(ParameterError, name="options.output", value="x", valid="an output in N"):
        bench("tracking", {"output": "x"}, stimulus=stimulus)


def test_further_stimuli_act_beside() -> None:
    beside = {"load": {"kind": "step", "start": 0, "end": "40 N", "t_step": 0}}
    driven = {"kind": "step", "start": 0, "end": "100 N", "t_step": 0}
    options = {"output": "x"}
    both = run_once(
        bench("open-loop", options, stimulus={**driven, **beside}, overrides=SMOOTH)
    ).recording
    assert both["x"].values[-1] == pytest.approx(60.0 / K, rel=1e-3)
    assert both["load"].values[-1] == 40.0
    step = run_once(bench("step", options, stimulus=beside, overrides=SMOOTH)).recording
    assert step["x"].values[-1] == pytest.approx(60.0 / K, rel=1e-3)


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        (
            {"input": "F_sett"},
            UnknownNameError,
            "stimulus of spring-axis in options.input 'F_sett': did you mean 'F_set'?",
        ),
        ({"input": "noise_x"}, UnknownNameError, "valid names are F_set, load"),
        ({"output": "y"}, UnknownNameError, "recording of spring-axis in options.output 'y'"),
        ({"input": ""}, ParameterError, "options.input is missing"),
        ({"input": 3}, ParameterError, "a stimulus of spring-axis"),
        ({"end": "2 bar"}, UnitError, "end"),
        ({"endd": "2 N"}, UnknownNameError, "did you mean 'end'?"),
        ({"duration": "-1 s"}, ParameterError, "duration = -1 s is not valid"),
    ],
)
def test_names_and_units_are_checked_against_the_model(
    options: dict[str, Any], error: type[InputError], text: str
) -> None:
    with pytest.raises(error) as caught:
        bench("step", options)
    assert text in str(caught.value)


def test_an_option_without_default_is_a_mistake_of_its_author() -> None:
    experiment = replace(GENERIC_EXPERIMENTS.find("stribeck"), defaults={"speed_max": 1.0})
    with raises(ModelError, name="levels"):
        experiment.bound(ASSEMBLIES.find("spring-axis")(), {"levels": "0 mm"})


def test_stimuli_are_checked_too() -> None:
    with raises(UnknownNameError, value="lod", valid="load"):
        bench("step", stimulus={"lod": STEP})
    with raises(UnknownNameError, value="F_set"):
        bench("step", stimulus={"F_set": STEP})  # already driven by the step
    with pytest.raises(ParameterError, match="has its own stimulus"):
        bench("step", stimulus=STEP)
    with pytest.raises(ParameterError, match=r"\[stimulus.load\] needs a kind"):
        bench("step", stimulus={"load": {"start": 0}})
    with pytest.raises(ParameterError, match=r"open-loop needs a \[stimulus\] section"):
        bench("open-loop")


def test_a_bench_file_of_any_brake_and_its_text(tmp_path: Any) -> None:
    from bywire.bench.bench_file import bench_text

    path = tmp_path / "axis.toml"
    path.write_text(
        f'experiment = "step"\nparameters = "{SET}"\nassembly = "spring-axis"\n'
        '[options]\ninput = "F_set"\noutput = "x"\nend = "150 N"\n'
        '[stimulus.load]\nkind = "step"\nstart = 0\nend = "50 N"\nt_step = 0\n'
        '[requirements]\novershoot = "<= 90 %"\n'
    )
    made = bywire.load(path)
    assert made.chosen_options.flat()["end"] == 150.0
    again = tmp_path / "again.toml"
    again.write_text(bench_text(made))
    assert bywire.load(again).chosen_stimuli == made.chosen_stimuli
    assert run_once(made).status == "passed"
    path.write_text(f'experiment = "step"\nparameters = "{SET}"\n[options]\nend = 150\n')
    with pytest.raises(InputError, match=r"options.input is missing"):
        bywire.load(path)
    path.write_text(
        f'experiment = "step"\nparameters = "{SET}"\n[options]\ninput = "F_set"\nend = 150\n'
    )
    with pytest.raises(UnitError, match="end = 150 has the wrong unit"):
        bywire.load(path)


@pytest.mark.parametrize(
    ("name", "own", "option"),
    [
        ("open-loop", "motor-open-loop", {"source": "current"}),
        ("release", "pressure-release", {"p_from": "20 bar"}),
        ("stribeck", "seal-stribeck", {"pressures": "10 bar"}),
    ],
)
def test_an_earlier_name_means_one_experiment_or_is_refused(name, own, option, monkeypatch) -> None:
    stimulus = {**STEP, "end": "1 A"} if name == "open-loop" else {}
    known = bywire.Bench(name, "dardanelli2010", options=option, stimulus=stimulus)
    assert known.definition is EXPERIMENTS.find(own)
    assert known.experiment == own
    with raises(ParameterError, name="experiment", value=name, valid=own):
        bywire.Bench(name, "dardanelli2010", stimulus=stimulus)
    signal = {"friction": "omega"} if name == "stribeck" else {"input": "i_set"}
    generic = bywire.Bench(name, "dardanelli2010", options=signal, stimulus=stimulus)
    assert generic.experiment == name
    assert set(generic.definition.kpis) != set(known.definition.kpis)
    monkeypatch.setattr("bywire.core.brake._loaded", {})  # whose only set would be taken
    with pytest.raises(ParameterError, match=f"motorcycle-brake is now called '{own}'"):
        bywire.run(name)


def test_one_name_is_one_experiment(tmp_path) -> None:
    assert not EXPERIMENTS.all().keys() & GENERIC_EXPERIMENTS.all().keys()
    file = tmp_path / "axis_twice.py"
    file.write_text(
        SPRING_AXIS.read_text().replace("spring-axis", "axis-twice")
        + "from dataclasses import replace\n"
        "from bywire.bench.experiment import EXPERIMENTS\n"
        'TAKEN = replace(EXPERIMENTS.find("hard-braking"), name="ramp", assembly="axis-twice")\n'
    )
    taken = r"axis_twice\.py, line \d+: the experiment 'ramp' is already declared in .*ramp\.py"
    with forgotten():
        load_system(file)
        with pytest.raises(ModelError, match=taken):
            bywire.Bench("ramp", "axis-twice-one", options={"input": "F_set"})
        with pytest.raises(ModelError, match=taken):
            EXPERIMENTS.all()


def test_experiment_and_parameter_set_belong_together() -> None:
    with pytest.raises(ParameterError, match="'hard-braking' tests a motorcycle-brake, but param"):
        bywire.Bench("hard-braking", SET)
    with pytest.raises(UnknownNameError, match="unknown assembly 'spring-axes'"):
        bench("step", assembly="spring-axes")
