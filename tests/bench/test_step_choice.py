"""The step that a stated numerical error determines."""

from dataclasses import replace
from pathlib import Path

import pytest

import bywire
from bywire.bench import step_choice
from bywire.bench.bench import Bench
from bywire.bench.bench_file import bench_text, read
from bywire.bench.running import run
from bywire.bench.step_choice import exceeded, permitted_steps, scales_of, with_chosen_step
from bywire.core.errors import InputError, StepError

LIMITED = {"overshoot": "<= 15 %", "steady_state_error": "<= 0.1 bar"}


@pytest.fixture(scope="module")
def stated() -> Bench:
    """Return hard braking with a stated error of 1 %."""
    return Bench("hard-braking", requirements=LIMITED, error="1 %")


@pytest.fixture(scope="module")
def chosen(stated: Bench) -> Bench:
    """Return the same bench with the step that bywire chooses."""
    return with_chosen_step(stated)


def test_the_true_errors_are_smaller(chosen: Bench) -> None:
    """Compare with a step of 2 us, relative to the pressure and to the step's height."""
    coarse, fine = run(chosen), run(replace(chosen, step=2e-6))
    scales = scales_of(chosen, coarse.recordings).full
    assert scales["steady_state_error"] == pytest.approx(float(coarse.recording["p_mc"].max()))
    assert chosen.step > 50e-6
    for name in LIMITED:
        apart = abs(coarse.kpi(name).value - fine.kpi(name).value)
        assert apart <= 0.01 * scales[name]


def test_the_choice_depends_only_on_the_bench(stated: Bench, chosen: Bench) -> None:
    """Choose again, and keep a choice; another step or error ends it."""
    again = with_chosen_step(replace(stated, name="again"))
    assert (again.step, again.choice) == (chosen.step, chosen.choice)
    assert with_chosen_step(chosen) is chosen
    assert chosen.choice is not None
    assert chosen.choice.reached <= 0.01
    assert replace(chosen, step=1e-5).error is None
    other = replace(chosen, error="2 %")
    assert other.choice is None
    assert other.step != other.step
    assert chosen.without_choice() == stated
    assert f'step = "{chosen.step} s"' in bench_text(chosen)
    assert 'error = "1 %"' in bench_text(stated)


def test_the_steps_and_their_doubles_divide_the_sample_times() -> None:
    """Include sample times that are not whole microseconds."""
    bench = Bench("moment-pulses", error="1 %")
    steps = list(permitted_steps([bench]))
    assert steps[0] == pytest.approx(100e-6)
    assert steps[-1] == pytest.approx(1e-6)
    for step in (*steps[:3], *(2.0 * each for each in steps[:3])):
        assert replace(bench, error=None, step=step).cases()


def test_contacts_rule_out_a_step_that_the_key_figures_permit() -> None:
    """The wedge brake's contacts oscillate too fast for 100 us, at which its figures are exact."""
    limits = {"time_to_90": "<= 0.1 s"}
    chosen = with_chosen_step(Bench("moment-pulses", requirements=limits, error="5 %"))
    assert chosen.step == pytest.approx(50e-6)
    assert not run(chosen).warnings


def test_an_error_that_no_step_reaches(monkeypatch: pytest.MonkeyPatch) -> None:
    """State the figure, the error that was reached, and what to type."""
    monkeypatch.setattr(step_choice, "FINEST", 20e-6)
    with pytest.raises(StepError, match=r"0\.0001 % cannot be reached.*overshoot|steady") as raised:
        with_chosen_step(Bench("hard-braking", requirements=LIMITED, error="0.0001 %"))
    assert '"simulation.error": "0.0' in str(raised.value)
    assert str(raised.value.valid).startswith(">= 0.0")


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"simulation.step": "20us", "simulation.error": "1%"}, "exclude each other"),
        ({"simulation.error": "20 %"}, "<= 10 %"),
        ({"simulation.error": "0"}, ">= 0.0001 %"),
        ({"simulation.error": "1 bar"}, "wrong unit"),
        ({"error": "1 %"}, "it is a setting of the simulation"),
        ({"simulation.error": "1%", "simulation.record": "7us"}, "recording intervals 0.007 ms"),
        ({"simulation.error": "1%", "ecu.T_s": "0.33333ms"}, "multiples of each other"),
    ],
)
def test_errors_that_are_not_valid(changes: dict[str, str], match: str) -> None:
    """Each has one sentence."""
    with pytest.raises(InputError, match=match):
        read("hard-braking", changes)


def test_a_change_replaces_the_other_setting(tmp_path: Path) -> None:
    """A file states one of both, and a change the other one."""
    file = tmp_path / "bench.toml"
    text = 'experiment = "hard-braking"\nparameters = "dardanelli2010"\n[simulation]\n'
    file.write_text(text + 'error = "1 %"\n', "utf-8")
    assert read(file, {}).error == 0.01
    assert read(file, {"simulation.step": "10 us"}).error is None
    file.write_text(text + 'step = "10 us"\n', "utf-8")
    assert read(file, {"simulation.error": "1 %"}).error == 0.01
    file.write_text(text + 'step = "10 us"\nerror = "1 %"\n', "utf-8")
    with pytest.raises(StepError, match="exclude each other"):
        read(file, {})
    with pytest.raises(StepError, match="exclude each other"):
        Bench("hard-braking", step="10 us", error="1 %")  # type: ignore[arg-type]


def test_a_bench_without_a_chosen_step_does_not_run(stated: Bench) -> None:
    """No command uses a step that nobody chose."""
    with pytest.raises(StepError, match="does not choose a step"):
        run(stated)


def test_results_show_the_step(stated: Bench, tmp_path: Path) -> None:
    """In the terminal and the report, in JSON, and in the recording."""
    result = bywire.run(stated, estimate_error=False)
    step = result.bench.step
    assert result.as_object()["step"]["value"] == step
    assert result.as_object()["step"]["stated_error"] == 0.01
    assert "us, chosen for simulation.error = 1 %" in str(result)
    assert result.recording.attrs["step"] == step
    assert result.recording.attrs["stated_error"] == 0.01


def test_a_range_warns_where_its_values_exceed_the_error(stated: Bench) -> None:
    """The step is chosen for all values; a smaller error is then exceeded at all of them."""
    shown = bywire.run(stated, over="motor.R_m=0.3 ohm, 0.4 ohm")
    assert shown.bench.choice is not None
    assert shown.bench.choice.benches == 3
    assert not any("exceed" in text for text in shown.warnings)
    first = shown.results[0]
    assert first.bench.choice is not None
    choice = replace(first.bench.choice, stated=1e-6)
    smaller = replace(first, bench=replace(first.bench, error=1e-6, choice=choice))
    assert "exceed simulation.error = 0.0001 %: overshoot" in exceeded(smaller)
