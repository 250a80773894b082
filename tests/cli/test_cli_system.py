"""``--system PATH``: a user's brake in one file has every command, before and behind its name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from command_line import Outcome, refused

from bywire.bench.bench import Bench
from bywire.core import brake as registry
from bywire.core.errors import ParameterError, UnknownNameError
from bywire.server.place import Place
from bywire.server.task import tasks
from raising import raises
from systems.loading import SPRING_AXIS, forgotten, loaded

Bywire = Callable[..., Outcome]
ROOT = Path(__file__).parents[2]
SYSTEM = ("--system", SPRING_AXIS)
STEP = (
    "--set",
    "parameters=spring-axis-one",
    "--set",
    "options.input=F_set",
    "--set",
    "options.output=x",
)

OWN_EXPERIMENT = """
from bywire.bench.experiment import Case, Experiment
from bywire.core.signals import zeros
from bywire.core.parameters import ParameterSet
import numpy as np


class Options(ParameterSet):
    pass


def cases(par, options, _=None):
    return (Case("run", SpringAxis(), par, zeros(State), zeros(Memory),
                 lambda t: {"@STIMULUS@": np.full(t.shape, 10.0)}, 0.01),)


def judge(recordings, options):
    recordings["run"]["@SIGNAL@"]
    return ()


PUSH = Experiment("push", "spring-axis", "a push", Options, Options(), cases, judge, {},
                  ("time-traces",))
"""


@pytest.fixture(autouse=True)
def _forgotten() -> Iterator[None]:
    """Unload the brakes that a command loads."""
    with forgotten():
        registry._loaded.clear()  # brakes of other tests also provide parameter sets
        yield


def test_list_knows_it(bywire: Bywire) -> None:
    found = bywire("list", *SYSTEM, "--json").object
    assert "spring-axis" in found["assemblies"]
    assert "spring-axis-one" in found["parameter_sets"]
    assert "step" in found["generic_experiments"]
    for name in ("spring-axis", "spring-axis-one", "F_set", "k_c", "sine-sweep"):
        assert name in bywire(*SYSTEM, "list", name).out


@pytest.mark.parametrize("front", [True, False], ids=["before", "behind"])
def test_run_with_requirements_and_a_report(bywire: Bywire, tmp_path: Path, front: bool) -> None:
    command = (
        "run",
        "step",
        *STEP,
        "--set",
        "requirements.overshoot=<= 1 %",
        "--json",
        "--out",
        tmp_path / "out",
    )
    done = bywire(*SYSTEM, *command) if front else bywire(*command, *SYSTEM)
    assert done.status == 1  # it overshoots, as expected
    assert done.object["kpis"]["overshoot"]["value"] > 1.0
    page = (tmp_path / "out" / "report.html").read_text()
    assert "a mass on a spring" not in page.partition("<body")[0]
    assert (tmp_path / "out" / "time-traces.png").is_file()
    assert (tmp_path / "out" / "run.nc").is_file()


def test_a_bench_file_names_it_and_never_loads_it(bywire: Bywire, tmp_path: Path) -> None:
    path = tmp_path / "axis.toml"
    path.write_text(
        'experiment = "step"\nparameters = "spring-axis-one"\n'
        '[options]\ninput = "F_set"\nend = "150 N"\n'
    )
    refused(bywire("run", path), "unknown parameter set 'spring-axis-one'")
    assert bywire("run", path, *SYSTEM).status == 0
    path.write_text(f'system = "{SPRING_AXIS}"\n{path.read_text()}')
    refused(bywire("run", path), "unknown key of a bench file 'system'")


def test_output_error_finds_its_parameters(bywire: Bywire, tmp_path: Path) -> None:
    bench = tmp_path / "axis.toml"
    bench.write_text(
        'experiment = "open-loop"\nparameters = "spring-axis-one"\n'
        '[options]\ninput = "F_set"\noutput = "x"\nrecord = "1 ms"\nduration = "0.5 s"\n'
        '[stimulus]\nkind = "multisine"\nmean = 0\namplitude = "60 N"\nf_base = "2 Hz"\nn = 12\n'
        't_start = 0\n[set]\nF_c = 0\nk_c = "0.001 N/m"\n'
    )
    out = tmp_path / "out"
    other = ("--set", "k=9000 N/m", "--set", "d=50 N*s/m")
    assert bywire("run", bench, "--out", out, *other, *SYSTEM).status == 0
    on_bench = ("--bench", bench, "--input", "F_set=F_set")
    done = bywire(
        "identify",
        "output-error",
        out / "run.nc",
        *on_bench,
        "--output",
        "x=1 um",
        "--unknown",
        "k=8000 N/m..12000 N/m",
        "--unknown",
        "d=30 N*s/m..90 N*s/m",
        "--json",
        *SYSTEM,
    )
    assert done.status == 0, done.err
    assert done.object["parameters"] == pytest.approx({"k": 9000.0, "d": 50.0}, rel=1e-6)
    beside = bywire("replay", out / "run.nc", *on_bench, *other, "--json", *SYSTEM)
    assert beside.status == 0, beside.err


def test_what_it_does_not_declare_is_said(bywire: Bywire) -> None:
    refused(bywire("margins", "travel", *SYSTEM), "declares no loop", "docs/modeling.md")
    refused(bywire("linearize", "travel", *SYSTEM), "declares no loop or plant")
    refused(bywire("study", "travel", *SYSTEM), "declares no study")


def test_an_experiment_of_any_brake_takes_the_only_parameter_set(
    bywire: Bywire, tmp_path: Path
) -> None:
    refused(
        bywire("run", "step"), "works with any brake. Specify a parameter set", "dardanelli2010"
    )
    plain = ("--set", "options.input=F_set", "--set", "options.output=x")
    done = bywire("run", "step", *plain, *SYSTEM, "--json")
    assert done.status == 0, done.err
    assert done.object["kpis"] == bywire("run", "step", *STEP, *SYSTEM, "--json").object["kpis"]
    bench = tmp_path / "axis.toml"
    bench.write_text('experiment = "step"\n[options]\ninput = "F_set"\noutput = "x"\n')
    assert bywire("run", bench, *SYSTEM, "--json").object["kpis"] == done.object["kpis"]
    simulated = ("--output", "x=1 um", "--unknown", "k", "--synthetic", 1, "--starts", 1)
    fitted = bywire("identify", "output-error", "--bench", bench, *simulated, *SYSTEM, "--json")
    assert fitted.object["parameters"] == pytest.approx({"k": 1e4}, rel=1e-3)


def test_a_choice_of_parameter_sets_is_the_systems_own(bywire: Bywire, tmp_path: Path) -> None:
    two = "\nSECOND = CitedSet('two', 'spring-axis', '', '', Parameters, VALUES)\n"
    system = written(tmp_path, "two_springs", two.replace("'two'", "'spring-axis-two'"))
    several = bywire("run", "step", "--system", system)
    assert "(spring-axis-one, spring-axis-two)" in several.err


def test_python_and_forms_take_the_only_parameter_set(tmp_path: Path) -> None:
    with loaded(SPRING_AXIS):
        options = {"input": "F_set", "output": "x"}
        assert Bench("step", options=options).parameters == "spring-axis-one"
        changes = "\n".join(f"options.{name}={value}" for name, value in options.items())
        asked = tasks()["run"].read({"bench": "step", "set": changes}, Place(tmp_path))
        assert asked["bench"] == "step"
    with raises(ParameterError, name="parameters", valid="dardanelli2010"):
        Bench("step")
    with pytest.raises(UnknownNameError, match="unknown experiment 'stepp': did you mean 'step'"):
        Bench("stepp")
    assert Bench("hard-braking").parameters == "dardanelli2010"


def test_what_the_option_itself_lacks_is_said(bywire: Bywire, tmp_path: Path) -> None:
    refused(bywire("list", "--system"), "--system needs the path")
    refused(
        bywire("list", "--system", tmp_path / "none.py"),
        "none.py does not exist, so it does not declare a brake",
    )
    assert "list" in bywire(*SYSTEM).out  # the help


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / f"{name}.py"
    path.write_text(SPRING_AXIS.read_text() + text)
    return path


def test_what_it_prints_is_no_result(bywire: Bywire, tmp_path: Path) -> None:
    path = written(tmp_path, "prints_a_lot", "\nprint('hello')\n")
    done = bywire("list", "--system", path, "--json")
    assert "spring-axis" in done.object["assemblies"]
    assert "hello" in done.err


@pytest.mark.parametrize(
    ("stem", "stimulus", "signal", "parts"),
    [
        (
            "wrong_stimulus",
            "F_sett",
            "x",
            [
                "wrong_stimulus.py, line 1",
                "experiment 'push': unknown stimulus of spring-axis "
                "'F_sett': did you mean 'F_set'?",
            ],
        ),
        ("wrong_signal", "F_set", "xx", ["wrong_signal.py, line 1", "xx"]),
    ],
)
def test_an_experiment_that_names_what_the_model_lacks(
    bywire: Bywire, tmp_path: Path, stem: str, stimulus: str, signal: str, parts: list[str]
) -> None:
    text = OWN_EXPERIMENT.replace("@STIMULUS@", stimulus).replace("@SIGNAL@", signal)
    path = written(tmp_path, stem, text)
    refused(bywire("run", "push", "--system", path), *parts)


def test_its_own_experiment_runs_by_its_name(bywire: Bywire, tmp_path: Path) -> None:
    text = OWN_EXPERIMENT.replace("@STIMULUS@", "F_set").replace("@SIGNAL@", "x")
    path = written(tmp_path, "own_experiment", text)
    assert bywire("run", "push", "--system", path, "--out", tmp_path / "out").status == 0
    assert (tmp_path / "out" / "time-traces.png").is_file()


def test_its_own_names_come_first(bywire: Bywire) -> None:
    assert next(iter(bywire("list", "--json", *SYSTEM).object["brakes"])) == "spring-axis"
    caliper = ("--system", ROOT / "examples" / "emb_caliper")
    refused(
        bywire("margins", "xyzzy", *caliper), "unknown loop 'xyzzy': valid names are clamp-force"
    )
    faults = bywire("list", "faults", "--json", *caliper).object["faults"]
    assert "emb-caliper, " in next(iter(faults.values()))


def test_a_set_for_an_assembly_that_does_not_exist_is_said(bywire: Bywire, tmp_path: Path) -> None:
    text = SPRING_AXIS.read_text()
    wrong = text.replace('"spring-axis-one", "spring-axis"', '"spring-axis-one", "spring-axes"')
    assert wrong != text
    (tmp_path / "odd_axis.py").write_text(wrong)
    system = ("--system", tmp_path / "odd_axis.py")
    line = wrong[: wrong.index('CitedSet("')].count("\n") + 1
    for _ in range(2):  # rebuilt, then cached
        done = bywire("list", "--json", *system)
        assert f"odd_axis.py, line {line}: parameter set 'spring-axis-one'" in done.err
        assert "did you mean 'spring-axis'?" in done.err
        assert "spring-axes" not in done.object["assemblies"]
        assert "spring-axis" in done.object["assemblies"]


def test_the_example_in_one_file_is_a_brake(bywire: Bywire) -> None:
    servo = ("--system", ROOT / "examples" / "servo_axis.py")
    assert "servo-1" in bywire("list", *servo, "--json").object["parameter_sets"]
    assert bywire("run", "step", "--set", "parameters=servo-1", *servo).status == 0
