"""``bywire new`` writes a package with which every command works, or nothing and says why."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from bywire.core.errors import FileError, ParameterError
from bywire.usecases.new import new

NAME = "front-caliper"


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return new(NAME, tmp_path_factory.mktemp("new")).folder


OWN_TESTS = """
import json, sys
from pathlib import Path
import bywire, pytest
check = bywire.check
def kept(*arguments):
    found = check(*arguments)
    Path(sys.argv[1]).write_text(json.dumps(found.as_object()))
    return found
bywire.check = kept
sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", "tests"]))
"""


@pytest.fixture(scope="module")
def own_tests(project: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """Return the output of the new brake's own tests, and the file that their check writes."""
    checked = tmp_path_factory.mktemp("checked") / "check.json"
    done = subprocess.run(
        [sys.executable, "-c", OWN_TESTS, str(checked)],
        capture_output=True,
        text=True,
        check=False,
        cwd=project,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout, checked


COMMANDS = """
import json, sys
from bywire.cli.main import main
for words in json.load(sys.stdin):
    sys.argv = ["bywire", *words]
    try:
        main()
    except SystemExit as ended:
        if ended.code:
            raise
    print("end of a command", flush=True)
"""


def said(project: Path, *commands: tuple[str, ...]) -> list[str]:
    """Return the output of commands for the new brake, all run in one process."""
    system = ("--system", str(project / "src" / "front_caliper"))
    done = subprocess.run(
        [sys.executable, "-c", COMMANDS],
        input=json.dumps([words + system for words in commands]),
        capture_output=True,
        text=True,
        check=False,
        cwd=project,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split("end of a command\n")


def test_everything_is_named_after_it(project: Path) -> None:
    files = [path for path in project.rglob("*") if path.is_file()]
    assert project / "pyproject.toml" in files
    assert project / "README.md" in files
    assert project / "tests" / "test_front_caliper.py" in files
    for path in files:
        assert "starter" not in str(path.relative_to(project)).lower()
        assert "starter" not in path.read_text(encoding="utf-8").lower()


def test_it_passes_the_check(own_tests: tuple[str, Path]) -> None:
    found = json.loads(own_tests[1].read_text())
    assert found["holds"]
    assert found["subject"] == NAME
    assert found["not_checked"] == 0
    subjects = {each["subject"] for each in found["findings"]}
    assert {"front_caliper.elements.spindle", "plant.dc_motor"} <= subjects
    assert {"front_caliper.laws.force_control.output", "front-caliper-example"} <= subjects
    assert "front-caliper-actuator (front-caliper-example)" in subjects


def test_commands_work_with_it(project: Path, tmp_path: Path) -> None:
    experiments, actuator, _, margins, linear, _ = said(
        project,
        ("list", "experiments"),
        ("list", "front-caliper-actuator"),
        ("run", "front-caliper-clamp", "--out", str(tmp_path / "out")),
        ("margins", "front-caliper-force"),
        ("linearize", "front-caliper-force"),
    )
    assert "front-caliper-clamp" in experiments
    assert "clamp force" in actuator
    assert (tmp_path / "out" / "report.html").is_file()
    assert "phase" in margins
    assert linear


def test_its_own_tests_pass(own_tests: tuple[str, Path]) -> None:
    assert "4 passed" in own_tests[0]


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("Front", "lowercase letters"),
        ("1st", "lowercase letters"),
        ("a--b", "lowercase letters"),
        ("../x", "lowercase letters"),
        ("", "lowercase letters"),
        ("é", "lowercase letters"),
        ("class", "Python keyword"),
        ("json", "Python has a standard module"),
        ("numpy", "installed"),
        ("wedge", "already exists"),
        ("x" * 41, "at most 40"),
    ],
)
def test_bad_names_are_refused(name: str, reason: str, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=reason):
        new(name, tmp_path)
    assert os.listdir(tmp_path) == []


def test_existing_folders_stay_as_they_are(tmp_path: Path) -> None:
    (tmp_path / NAME).mkdir()
    with pytest.raises(FileError, match="already exists"):
        new(NAME, tmp_path)
    assert os.listdir(tmp_path / NAME) == []
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="is not a folder"):
        new(NAME, tmp_path / "file")


def test_the_folder_that_it_goes_into_is_made(tmp_path: Path) -> None:
    out = tmp_path / "brakes" / "front"
    done = subprocess.run(
        [sys.executable, "-m", "bywire", "new", NAME, "--out", str(out)],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert str(out / NAME) in done.stdout
    assert os.listdir(tmp_path) == ["brakes"]
    assert (out / NAME / "src" / "front_caliper" / "__init__.py").is_file()


def test_a_failure_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "rename", full)
    with pytest.raises(FileError, match="No space left"):
        new(NAME, tmp_path)
    assert os.listdir(tmp_path) == []
