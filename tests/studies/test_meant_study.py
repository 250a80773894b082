"""A study file that is not there: Python names the one that was meant, as the command does."""

from __future__ import annotations

from pathlib import Path

import pytest

import bywire
from bywire.core.errors import FileError
from raising import raises

STUDY = 'bench = "hard-braking"\n[vary]\n"motor.R_m" = "+-5 %"\n'


@pytest.mark.parametrize("named", ["studies/rar.toml", "rar.toml", "rare"])
def test_the_study_that_was_meant_is_named(tmp_path, monkeypatch, named):
    monkeypatch.chdir(tmp_path)
    there = Path("studies", "rare.toml")
    there.parent.mkdir()
    there.write_text(STUDY)
    Path("studies", "rars.toml").write_text('life = "wedge-pads"\n')  # near, and no study
    with raises(FileError, name=str(named), valid=str(there)):
        bywire.run_study(named)
    assert [each.name for each in tmp_path.iterdir()] == ["studies"]


def test_nothing_near_is_no_suggestion(tmp_path):
    (tmp_path / "tolerances.toml").write_text(STUDY)
    with raises(FileError, name="none.toml"):
        bywire.run_study(tmp_path / "none.toml")
