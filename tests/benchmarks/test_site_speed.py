"""The time of the site is measured in a copy of the clone, or a row says why it was not."""

from __future__ import annotations

import importlib.util
import subprocess

import pytest

from benchmarks.declared import declared
from benchmarks.general import site
from benchmarks.suite import Part


def test_without_sphinx_the_reason_is_said(monkeypatch):
    assert "site" in declared(Part)
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    for each in site.measured():
        assert (each.value, each.holds) == (None, None)
        assert "'.[docs]'" in each.note


@pytest.mark.parametrize("status", [0, 2])
def test_a_clone_is_copied_and_made_twice_or_says_what_failed(tmp_path, monkeypatch, status):
    (tmp_path / "docs" / "_build").mkdir(parents=True)
    (tmp_path / "docs" / "conf.py").touch()
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: name)
    places = []

    def made(line, *, cwd, **_):
        assert line[1:4] == ["-P", "-m", "sphinx"]
        assert (cwd / "docs" / "conf.py").is_file()
        assert not (cwd / "docs" / "_build").exists()
        places.append(cwd)
        return subprocess.CompletedProcess(line, status, "", "reading\nno such theme\n")

    monkeypatch.setattr(subprocess, "run", made)
    cold, warm = site.measured(tmp_path)
    assert [each.id for each in (cold, warm)] == ["docs.build_s", "docs.rebuild_s"]
    assert tmp_path not in places
    if status:
        assert cold.note == "exit status 2: no such theme"
    else:
        assert len(places) == 2
        assert all(each.holds for each in (cold, warm))
