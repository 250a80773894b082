"""Every test runs in some recipe of ``tasks.py``, and what is published can be made again."""

from __future__ import annotations

import re
import runpy
import sys

import pytest
from repository_sources import PACKAGE, PROJECT, ROOT

TASKS = runpy.run_path(str(ROOT / "tasks.py"))
MARKERS = [text.split(":")[0] for text in PROJECT["tool"]["pytest"]["ini_options"]["markers"]]
TIERS = [*TASKS["CHECKS"].values(), *TASKS["TRUST"].values()]


def runs(command: list[str], marker: str) -> bool:
    """Return whether a command runs the tests of one marker, or with "" those of none."""
    if command[0] != "pytest":
        return False
    if "-m" not in command:
        return True
    wanted = re.fullmatch(r"(not )?(\w+)", command[command.index("-m") + 1])
    assert wanted, f"{command}: only NAME and not NAME are understood here"
    return (wanted[2] == marker) != bool(wanted[1])


@pytest.mark.parametrize("marker", ["", *MARKERS])
def test_every_tier_is_run_by_one_recipe(marker: str) -> None:
    assert sum(runs(command, marker) for command in TIERS) == 1


def test_the_gate_of_tiers_can_fail() -> None:
    assert not runs(["pytest", "-m", "not slow"], "slow")
    assert not runs(["pytest", "-m", "slow"], "")
    assert not runs(["ruff", "check"], "")
    assert runs(["pytest", "-m", "not slow"], "")
    assert runs(["pytest"], "slow")


@pytest.mark.parametrize("marker", MARKERS)
def test_every_marker_is_used(marker: str) -> None:
    texts = (path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    assert any(f"mark.{marker}" in text for text in texts)


def test_recipe_holds_the_lints_that_tests_rely_on() -> None:
    assert ["ruff", "check", "."] in TIERS
    assert TASKS["TYPES"] == ["mypy"]
    assert ["lint-imports"] in TIERS


def test_what_failed_runs_again_with_rewritten_assertions() -> None:
    """They tell the values; the whole tier is run without them, in less time."""
    (title, again), (*_, last) = *TASKS["AGAIN"].items(), TASKS["CHECKS"]
    assert title == last
    assert "--assert=plain" in TASKS["CHECKS"][title]
    assert "--assert=plain" not in again
    assert "--last-failed" in again


def test_the_newest_python_runs_tests_that_are_there_of_every_room() -> None:
    paths = [ROOT / name for name in TASKS["NEWEST_TESTS"]]
    assert all(path.exists() for path in paths)
    rooms = {path.relative_to(ROOT / "tests").parts[0] for path in paths}
    assert {path.name for path in PACKAGE.iterdir() if path.is_dir()} - rooms <= {
        "__pycache__",
        "authoring",
        "brakes",
        "control",
        "export",
        "template",
    }  # declared in the others' tests, or minutes long


@pytest.mark.parametrize("works", [True, False])
def test_a_python_that_does_not_run_is_not_the_newest(tmp_path, monkeypatch, works) -> None:
    """The newest that pyproject.toml names, and newer than the one that asks."""
    newest = max(int(c[-2:]) for c in PROJECT["project"]["classifiers"] if "Python :: 3." in c)
    python = tmp_path / f"python3.{newest}"
    python.write_text(f"#!/bin/sh\necho 3.{newest}.9\n" if works else "#!/bin/sh\nexit 127\n")
    python.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(sys, "version_info", (3, newest - 1))
    found = TASKS["newest_python"]()
    assert found == ((f"3.{newest}.9", str(python)) if works else None)
    monkeypatch.setattr(sys, "version_info", (3, newest))
    assert TASKS["newest_python"]() is None


def test_every_published_study_can_be_made_again() -> None:
    published = {path.stem for path in (ROOT / "docs" / "trust").glob("*.json")}
    assert published == set(TASKS["STUDIES"])
