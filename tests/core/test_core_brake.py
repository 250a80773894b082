"""Users' brakes from files, packages and entry points, and their errors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from bywire.analysis.loop import LOOPS
from bywire.bench.experiment import EXPERIMENTS
from bywire.core import brake as brakes_module
from bywire.core.brake import BrakeWarning, brakes, load_system
from bywire.core.catalog import PARAMETER_SETS
from bywire.core.errors import FileError, InputError, ModelError, UnknownNameError
from bywire.core.model import ASSEMBLIES
from raising import raises
from systems.loading import SPRING_AXIS, forgotten

HEAD = "from bywire.core.brake import Brake\n"
OURS = {"motorcycle", "two-wheeler", "wedge"}

Write = Callable[[str, str], Path]


@pytest.fixture(autouse=True)
def _forgotten() -> Iterator[None]:
    """Remove the modules that a test loads."""
    with forgotten():
        yield


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Return a function that writes a file into a folder."""

    def write(name: str, text: str) -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    return write


def declared(name: str) -> str:
    return f'{HEAD}BRAKE = Brake("{name}", "of a test", __name__)\n'


def test_a_file_is_a_brake_with_the_standing_of_ours() -> None:
    brake = load_system(SPRING_AXIS)
    assert set(brakes()) == OURS | {"spring-axis"}
    assert load_system(SPRING_AXIS) is brake
    assert ASSEMBLIES.find("spring-axis").name == "spring-axis"
    assert PARAMETER_SETS.owner("spring-axis-one") == brake.module
    assert set(PARAMETER_SETS.of(brake.module)) == {"spring-axis-one"}
    cited = PARAMETER_SETS.find("spring-axis-one").values["m"]
    assert (cited.value, cited.kind) == (2.0, "chosen")


def test_a_package_keeps_each_kind_in_its_own_module(write: Write) -> None:
    write("axis_package/__init__.py", declared("axis-package"))
    text = SPRING_AXIS.read_text().replace("spring-axis", "packed-axis")
    write("axis_package/model.py", text.partition("VALUES =")[0])
    sets = write(
        "axis_package/sets.py",
        "from bywire.core.catalog import CitedSet\nfrom .model import Parameters\n"
        'SET = CitedSet("packed", "packed-axis", "", "a set", Parameters, dict(\n'
        "    m=2.0, k=1e4, d=60.0, F_c=5.0, k_c=200.0, T_s=1e-3))\n",
    )
    load_system(sets.parent)
    assert PARAMETER_SETS.find("packed").parameters().leaves()["k"] == 1e4
    assert "packed-axis" in ASSEMBLIES.all()


@pytest.mark.parametrize(
    ("name", "text", "error", "parts"),
    [
        (
            "raises.py",
            f"{HEAD}x = 3\ny = x / 0\n",
            ModelError,
            ["raises.py, line 3: ZeroDivisionError: division by zero"],
        ),
        (
            "deep.py",
            f"{HEAD}import math\n\ndef f():\n    return math.sqrt('a')\n\nf()\n",
            ModelError,
            ["deep.py, line 5: TypeError"],
        ),
        ("syntax.py", "BRAKE = (\n", ModelError, ["syntax.py, line 1: SyntaxError"]),
        ("leaves.py", "raise SystemExit(3)\n", ModelError, ["leaves.py, line 1: SystemExit: 3"]),
        (
            "imports.py",
            "import no_such_module_at_all\n",
            ModelError,
            ["imports.py, line 1: ModuleNotFoundError", "no_such_module_at_all"],
        ),
        (
            "nothing.py",
            "x = 1\n",
            ModelError,
            ["declares no BRAKE", "BRAKE = bywire.Brake(name, summary, __name__)"],
        ),
        ("other.py", "BRAKE = 'mine'\n", ModelError, ["declares a BRAKE that is a str"]),
        (
            "wrong_module.py",
            f'{HEAD}BRAKE = Brake("wrong-module", "", "elsewhere")\n',
            ModelError,
            [
                "BRAKE is declared for the module 'elsewhere'",
                "Brake('wrong-module', ..., __name__)",
            ],
        ),
        (
            "taken.py",
            declared("motorcycle"),
            ModelError,
            ["taken.py", "a brake 'motorcycle'", "Rename one of them"],
        ),
        (
            "json.py",
            declared("json"),
            ModelError,
            ["the module name 'json' is already in use"],
        ),
        ("numpy.py", declared("numpy"), ModelError, ["the module name 'numpy' is already in use"]),
        (
            "my-brake.py",
            declared("my-brake"),
            ModelError,
            ["a name that Python can import"],
        ),
        ("brake.txt", declared("txt"), FileError, ["does not declare a brake. Use a Python file"]),
        (
            "half_typed.py",
            f"{HEAD}from typing import NamedTuple\nfrom bywire.core.signals import "
            "signals_of\n\n\nclass State(NamedTuple):\n    x: float\n\n\nsignals_of(State)\n",
            ModelError,
            [
                "half_typed.py, line 6: State.x has no Signal annotation",
                'Write x: Annotated[float, Signal("m", "what it is")]',
            ],
        ),
        (
            "unitless.py",
            f"{HEAD}from bywire.core.parameters import ParameterSet\n"
            "from bywire.core.catalog import CitedSet\n\n\nclass Parameters(ParameterSet):\n"
            '    m: float\n\n\nSET = CitedSet("u", "u", "", "", Parameters, {"m": 1.0})\n',
            ModelError,
            [
                "unitless.py, line 6: Parameters.m is a number without a unit",
                'm: Annotated[float, Unit("kg")]',
            ],
        ),
        (
            "valueless.py",
            f"{HEAD}from bywire.core.parameters import ParameterSet\n"
            "from bywire.core.quantities import Duration\n\n\nclass Options(ParameterSet):\n"
            "    t_hold: Duration\n    t_rest: Duration\n\n\nOPTIONS = Options()\n",
            ModelError,
            [
                "valueless.py, line 11: t_hold, t_rest. Set a value here, or a default in the "
                "class Options",
            ],
        ),
    ],
)
def test_what_is_wrong_with_a_file_is_said_with_its_line(
    write: Write, name: str, text: str, error: type[InputError], parts: list[str]
) -> None:
    path = write(name, text)
    with pytest.raises(error) as caught:
        load_system(path)
    for part in parts:
        assert part in str(caught.value)
    assert set(brakes()) == OURS  # nothing of it is left


def test_what_is_not_there_is_said() -> None:
    with raises(FileError, name="nowhere.py", valid="BRAKE = bywire.Brake(...)"):
        load_system("nowhere.py")


def test_a_file_beside_a_script_or_notebook_loads(
    write: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write("beside.py", declared("beside"))
    monkeypatch.syspath_prepend(str(path.parent))  # as Python puts the folder of what it runs
    assert load_system(path).name == "beside"
    other = write("below/beside_two.py", declared("beside-two"))
    write("beside_two.py", declared("beside-two"))
    with raises(ModelError, name=str(other), value="beside_two"):
        load_system(other)


def test_the_folder_of_a_project_is_its_package(write: Write) -> None:
    package = write("project/src/packed_in_src/__init__.py", declared("packed-in-src")).parent
    project = package.parents[1]
    assert load_system(project) is load_system(package)
    write("project/src/another/__init__.py", declared("another"))
    with raises(FileError, name=str(project), valid="BRAKE = bywire.Brake(...)"):
        load_system(project)


def test_a_file_that_was_mended_loads(write: Write) -> None:
    path = write("mended.py", "1 / 0\n")
    with pytest.raises(ModelError, match="ZeroDivisionError"):
        load_system(path)
    path.write_text(declared("mended"))
    assert load_system(path).name == "mended"


@pytest.mark.parametrize(
    ("stem", "line", "kind", "text"),
    [
        (
            "same_set",
            'S = CitedSet("roberts2003", "a", "", "", ParameterSet, {})',
            PARAMETER_SETS,
            r"same_set.py, line 6: the parameter set 'roberts2003' is already declared in .*rob",
        ),
        (
            "twice",
            'S = CitedSet("s", "a", "", "", ParameterSet, {})\n'
            'T = CitedSet("s", "b", "", "", ParameterSet, {})',
            PARAMETER_SETS,
            r"twice.py, line 7: the parameter set 's' is already declared in .*twice.py, line 6[.] "
            "Rename it",
        ),
        (
            "same_test",
            'E = Experiment("hard-braking", "a", "", ParameterSet, ParameterSet(), '
            "None, None, {}, ())",
            EXPERIMENTS,
            r"same_test.py, line 6: the experiment 'hard-braking' is already declared in "
            r".*hard_braking.py, line \d\d",
        ),
    ],
)
def test_a_name_that_is_taken_is_refused(
    write: Write, stem: str, line: str, kind: object, text: str
) -> None:
    imports = (
        "from bywire.core.catalog import CitedSet\n"
        "from bywire.core.parameters import ParameterSet\n"
        "from bywire.bench.experiment import Experiment\n"
    )
    load_system(write(f"{stem}.py", f"{declared(stem)}{imports}{line}\n"))
    with pytest.raises(ModelError, match=text):
        kind.all()  # type: ignore[attr-defined]


def test_a_module_of_a_package_that_fails_is_named(write: Write) -> None:
    package = write("broken_loops/__init__.py", declared("broken-loops")).parent
    write("broken_loops/loops.py", "\n\nx = {}['no']\n")
    load_system(package)
    with pytest.raises(ModelError, match=r"broken_loops.loops.py, line 3: KeyError: 'no'"):
        LOOPS.all()


def test_what_a_brake_does_not_declare_is_said_with_how_it_is_declared() -> None:
    load_system(SPRING_AXIS)
    with pytest.raises(UnknownNameError) as caught:
        LOOPS.find("travel")
    for words in ("the brake 'spring-axis' declares no loop", "Declare a Loop", "docs/modeling.md"):
        assert words in str(caught.value)


@pytest.fixture
def installed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Iterator[Callable[[str, str], None]]:
    """Return a function that installs a single-file brake next to ours."""
    real = brakes_module.entry_points(group=brakes_module.GROUP)
    added: list[EntryPoint] = []
    monkeypatch.syspath_prepend(tmp_path)

    def install(name: str, text: str) -> None:
        (tmp_path / f"{name}.py").write_text(text)
        added.append(EntryPoint(name, name, brakes_module.GROUP))
        brakes_module._installed.cache_clear()

    monkeypatch.setattr(brakes_module, "entry_points", lambda group: [*real, *added])
    yield install
    brakes_module._installed.cache_clear()


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("broken_at_import", "x = 1\nx.no\n", r"broken_at_import.py, line 2: AttributeError"),
        ("without_declaration", "x = 1\n", "declares no BRAKE"),
        ("with_our_name", declared("wedge"), "declare a brake 'wedge'"),
    ],
)
def test_a_broken_entry_point_is_reported_once_and_left_out(
    installed: Callable[[str, str], None], name: str, text: str, reason: str
) -> None:
    installed(name, text)
    with pytest.warns(BrakeWarning, match=reason) as caught:
        first = set(brakes())
    assert first == set(brakes()) == OURS
    (warning,) = caught
    assert Path(warning.filename).name == f"{name}.py"
    assert warning.lineno == (2 if name == "broken_at_import" else 1)


def test_what_an_installed_brake_breaks_is_left_out_and_the_others_stay(
    installed: Callable[[str, str], None],
) -> None:
    installed(
        "clashing",
        f"{declared('clashing')}from bywire.core.catalog import CitedSet\n"
        "from bywire.core.parameters import ParameterSet\n"
        'SETS = (CitedSet("roberts2003", "a", "", "", ParameterSet, {}),)\n',
    )
    with pytest.warns(BrakeWarning, match="'clashing': .*'roberts2003'"):
        known = PARAMETER_SETS.all()
    assert known["roberts2003"].assembly == "wedge-brake"
    assert set(brakes()) == OURS | {"clashing"}


def test_a_name_taken_within_a_tuple_or_by_a_class_has_its_line(write: Write) -> None:
    load_system(
        write(
            "held.py",
            f"{declared('held')}from bywire.core.catalog import CitedSet\n"
            "from bywire.core.parameters import ParameterSet\n"
            'A = CitedSet("a", "x", "", "", ParameterSet, {})\n'
            'SETS = (\n    CitedSet("b", "x", "", "", ParameterSet, {}),\n'
            '    CitedSet("c", "x", "", "", ParameterSet, {}),\n)\n',
        )
    )
    lines = {name: PARAMETER_SETS.place(name)[1] for name in "abc"}
    assert lines == {"a": 5, "b": 7, "c": 8}
    file, line = ASSEMBLIES.place("motorcycle-brake")
    assert Path(file).read_text().splitlines()[line - 1].startswith("class MotorcycleBrake")


def test_a_brake_shows_itself_in_a_notebook(write: Write) -> None:
    brake = load_system(write("shown.py", declared("shown").replace("of a test", "a < b")))
    assert "<td>shown</td>" in brake._repr_html_()
    assert "a &lt; b" in brake._repr_html_()
    assert str(brake.file) in brake._repr_html_()
