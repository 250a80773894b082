"""``bywire new`` writes a package with which every command works, or nothing and says why."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from bywire.api.new import new
from bywire.core.errors import FileError, ParameterError

NAME = "front-caliper"


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return new(NAME, tmp_path_factory.mktemp("new")).folder


def command(project: Path, *arguments: str, status: int = 0) -> str:
    """Return what a command prints for the new brake."""
    system = ["--system", str(project / "src" / "front_caliper")]
    done = subprocess.run(
        [sys.executable, "-m", "bywire.cli", *arguments, *system],
        capture_output=True, text=True, check=False, cwd=project,
    )  # fmt: skip
    assert done.returncode == status, done.stderr
    return done.stdout


def test_everything_is_named_after_it(project: Path) -> None:
    files = [path for path in project.rglob("*") if path.is_file()]
    assert project / "pyproject.toml" in files
    assert project / "README.md" in files
    assert project / "tests" / "test_front_caliper.py" in files
    for path in files:
        assert "starter" not in str(path.relative_to(project)).lower()
        assert "starter" not in path.read_text(encoding="utf-8").lower()


def test_it_passes_the_check(project: Path) -> None:
    found = json.loads(command(project, "check", "--json"))
    assert found["holds"]
    assert found["subject"] == NAME
    assert found["not_checked"] == 0
    subjects = {each["subject"] for each in found["findings"]}
    assert {"front_caliper.elements.spindle", "plant.dc_motor"} <= subjects
    assert {"front_caliper.laws.force_control.output", "front-caliper-example"} <= subjects
    assert "front-caliper-actuator (front-caliper-example)" in subjects


def test_commands_work_with_it(project: Path, tmp_path: Path) -> None:
    assert "front-caliper-clamp" in command(project, "list", "experiments")
    assert "clamp force" in command(project, "list", "front-caliper-actuator")
    command(project, "run", "front-caliper-clamp", "--out", str(tmp_path / "out"))
    assert (tmp_path / "out" / "report.html").is_file()
    assert "phase" in command(project, "margins", "front-caliper-force")
    assert command(project, "linearize", "front-caliper-force")


def test_its_own_tests_pass(project: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "tests"],
        capture_output=True, text=True, check=False, cwd=project,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    assert "4 passed" in done.stdout


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("Front", "small letters"), ("1st", "small letters"), ("a--b", "small letters"),
        ("../x", "small letters"), ("", "small letters"), ("é", "small letters"),
        ("class", "word of Python"), ("json", "Python has a module"), ("numpy", "installed"),
        ("wedge", "there is a brake"), ("x" * 41, "at most 40"),
    ],
)  # fmt: skip
def test_bad_names_are_refused(name: str, reason: str, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=reason):
        new(name, tmp_path)
    assert os.listdir(tmp_path) == []


def test_existing_folders_stay_as_they_are(tmp_path: Path) -> None:
    (tmp_path / NAME).mkdir()
    with pytest.raises(FileError, match="exists already"):
        new(NAME, tmp_path)
    assert os.listdir(tmp_path / NAME) == []
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="is no folder"):
        new(NAME, tmp_path / "file")


def test_the_folder_that_it_goes_into_is_made(tmp_path: Path) -> None:
    out = tmp_path / "brakes" / "front"
    done = subprocess.run(
        [sys.executable, "-m", "bywire", "new", NAME, "--out", str(out)],
        capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip
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
