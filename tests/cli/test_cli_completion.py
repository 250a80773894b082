"""Tab completion of names, files, and parameters of the specified bench."""

from __future__ import annotations

import subprocess
import sys

import pytest

from bywire.cli.completion import changeable, names_of, varied

BENCHES = names_of("experiments", "generic_experiments", ending=".toml")


@pytest.mark.parametrize(
    ("complete", "typed", "wanted"),
    [
        (BENCHES, "hard", "hard-braking"),
        (BENCHES, "motor-o", "motor-open-loop"),
        (names_of("loops"), "pres", "pressure"),
        (names_of("campaigns"), "mot", "motorcycle"),
        (names_of(), "dardanelli2010-m", "dardanelli2010-measured"),
    ],
)
def test_names(complete, typed, wanted):
    completed = dict(complete(typed))
    assert wanted in completed
    assert completed[wanted]  # its meaning
    assert all(name.startswith(typed) for name in completed)


def test_files_stand_beside_names(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hard.toml").touch()
    (tmp_path / "hard.csv").touch()
    (tmp_path / "harder").mkdir()
    (tmp_path / "[x].toml").touch()
    assert [name for name, _ in BENCHES("hard")] == ["hard-braking", "hard.toml", "harder/"]
    assert [name for name, _ in BENCHES("[")] == ["[x].toml"]


def test_parameters_are_those_of_the_bench():
    assert ("motor.R_m=", "0.35 in SI") in changeable(["hard-braking", "--set"], "motor.")
    assert [name for name, _ in changeable(["moment-pulses", "--set"], "wedge.mu_")] == [
        "wedge.mu_B="
    ]
    assert [name for name, _ in changeable(["hard-braking"], "options.p_")] == [
        "options.p_from=",
        "options.p_to=",
    ]
    assert [name for name, _ in varied(["hard-braking"], "motor.R")] == ["motor.R_m"]
    assert changeable(["hard-braking"], "motor.R_m=0") == []
    of_all = dict(changeable(["pressure"], ""))  # for a loop, from any set
    assert {"motor.R_m=", "wedge.mu_B="} <= of_all.keys()


def test_a_shell_gets_them(monkeypatch):
    monkeypatch.setenv("_BYWIRE_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "bywire run hard")
    monkeypatch.setenv("COMP_CWORD", "2")
    start = "import sys; sys.argv = ['bywire']; from bywire.cli.main import process; process()"
    done = subprocess.run(
        [sys.executable, "-c", start], capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.stdout.split(), done.stderr) == (["hard-braking"], "")
