"""The exported ECU on other processors: bit-identical, with little memory and few instructions."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from exported_ecu import BRAKES, bench_of, needs_compiler
from typer.testing import CliRunner

from bywire.api import exports as controller_check
from bywire.api.exports import ControllerCheck, figures_of
from bywire.cli.app import app
from bywire.core.errors import CompilerError
from bywire.export.controller.target import trial
from bywire.export.controller.target.trial import (
    CROSS,
    INSTALL,
    TARGETS,
    TaskFigures,
    Trial,
    missing_tools,
)
from bywire.usecases.export import export_controller
from raising import raises

needs_targets = pytest.mark.skipif(bool(missing_tools()), reason=missing_tools() or "all there")


@needs_targets
@pytest.mark.parametrize("structure", [BRAKES[0], pytest.param(BRAKES[1], marks=pytest.mark.trust)])
def test_processors_agree_in_every_bit_and_goals_are_met(structure: str, tmp_path: Path) -> None:
    made = export_controller(bench_of(structure), tmp_path, vectors=60, check=True)
    check = made.check
    assert check is not None
    assert made.holds
    assert check.skipped == ()
    assert len(check.trials) == 2 * (1 + len(TARGETS))
    assert all(each.differing == 0 and check.is_identical(each) for each in check.trials)
    found = {(each.target, each.precision): figures_of(each) for each in check.trials}
    assert controller_check.GOALS["Cortex-M4F", "double"] == {"instructions": 10_000}
    if structure != BRAKES[0]:  # the goals are those of the pressure loop
        return
    for which, goals in controller_check.GOALS.items():
        for name, most in goals.items():
            assert 0 < found[which][name] <= most


@needs_compiler
def test_what_is_missing_is_skipped_and_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    find, any_program = trial.find_program, shutil.which("true")

    def without_cross(name: str) -> str | None:
        return None if name == CROSS else find(name) or any_program

    monkeypatch.setattr(trial, "find_program", without_cross)
    with pytest.warns(match=re.escape(INSTALL)):
        made = export_controller(bench_of(BRAKES[1]), tmp_path, vectors=5, check=True)
    assert made.check is not None
    assert [each.target for each in made.check.trials] == ["host", "host"]
    monkeypatch.setattr(controller_check, "find_compiler", lambda: None)
    with raises(CompilerError, name="check", valid="bywire[compiler]"):
        export_controller(bench_of(BRAKES[1]), tmp_path, vectors=5, check=True)


def test_other_bits_do_not_hold() -> None:
    tasks = {"only": TaskFigures(401, 300, 64)}
    first = Trial("host", "single", 0, 17, 0)
    same = Trial("Cortex-M4F", "single", 0, 17, 0, 2000, 64, tasks)
    check = ControllerCheck((first, same), 10, ())
    assert check.holds
    row = check.table().table.rows[1]
    assert [(cell.text, cell.verdict) for cell in row[4:]] == [
        ("the same", "good"),
        ("2000 (<= 2048)", "good"),
        ("64 (<= 128)", "good"),
        ("64 (<= 128)", "good"),
        ("401 (> 400)", "bad"),
    ]
    assert not replace(check, trials=(first, replace(same, bits=18))).holds
    assert replace(check, trials=(first, replace(same, bits=18)), inexact=("single",)).holds
    assert not replace(check, trials=(first, replace(same, differing=1))).holds
    assert not replace(check, trials=(first, replace(same, breaches=1))).holds


@needs_compiler
def test_command_checks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "missing_tools", lambda: "no tools")
    words = ["export", "controller", "moment-pulses", "--out", str(tmp_path), "--vectors", "5"]
    done = CliRunner().invoke(app(), [*words, "--check", "--json"])
    assert done.exit_code == 0, done.output
    check = json.loads(done.stdout.splitlines()[-1])["check"]
    assert check["holds"]
    assert check["skipped"] == ["Cortex-M3, M4F and M7 were skipped: no tools"]
    assert [each["precision"] for each in check["trials"]] == ["double", "single"]
