"""``bywire compare``: tables on standard output, one object as JSON, one page in a folder."""

from __future__ import annotations

from command_line import no_half_files, refused

QUICK = ("--set", "options.duration=40ms", "--set", "options.settle=10ms")


def test_folder_and_experiment_beside_each_other(bywire, tmp_path):
    changed = ("hard-braking", *QUICK, "--set", "motor.R_m=0.4ohm")
    bywire("run", *changed, "--out", tmp_path / "a")
    given = (tmp_path / "a", "hard-braking", *QUICK)
    outcome = bywire("compare", *given, "--out", tmp_path / "out")
    assert outcome.status == 0
    assert "motor.R_m  0.4 Ω" in outcome.out
    assert "change" in outcome.out
    assert (tmp_path / "out" / "report.html").is_file()
    no_half_files(tmp_path)
    found = bywire("compare", *given, "--json").object
    assert [row["name"] for row in found["settings"]] == ["motor.R_m"]
    assert [row["values"] for row in found["settings"]] == [[0.4, 0.35]]
    assert [each["label"] for each in found["runs"]] == ["a", "hard-braking"]


def test_what_was_run_in_a_folder_of_an_experiments_name(bywire, tmp_path, monkeypatch):
    """A result folder takes precedence over an experiment of its name. An empty folder does not."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hard-braking").mkdir()
    run_now = bywire("compare", "hard-braking", "hard-braking", *QUICK, "--json").object
    assert {each["source"] for each in run_now["runs"]} == {"hard-braking, run now"}
    bywire("run", "hard-braking", *QUICK, "--out", "hard-braking")
    kept = bywire("compare", "hard-braking", "hard-braking", "--json").object
    assert {each["source"] for each in kept["runs"]} == {"hard-braking"}


def test_what_cannot_be_compared(bywire, tmp_path):
    refused(bywire("compare", "hard-braking"), "at least two")
    refused(bywire("compare", "hard-braking", tmp_path), "not a complete result", "--out")
    refused(bywire("compare", "hard-braking", "hard-brakin"), "did you mean hard-braking?")
