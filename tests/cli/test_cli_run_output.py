"""Printed output of ``bywire run``, and files in its folder."""

from __future__ import annotations

import os
import stat

import pytest
from command_line import BRAKING, OPEN_LOOP, QUICK, no_half_files, refused

import bywire as package

NAMES = ["../../escaped", "/escaped", "a/b\\c", "..", "con", "x" * 300, "<script>alert(1)</script>"]
CURVE = BRAKING.replace("hard-braking", "seal-stribeck")  # the fastest result
STEP = '[stimulus]\nkind = "step"\nstart = 0\nend = "20 A"\nt_step = "10 ms"\n'
UNDEFINED = '\n[requirements]\nsettling_time = "<= 10 s"\n'


def test_json_is_one_object_of_the_promised_shape(bywire, bench, tmp_path):
    text = CURVE + '\n[requirements]\nbreakaway_apply = "<= 1 N*m"\n'
    outcome = bywire("run", bench(text), "--json", "--out", tmp_path / "out")
    assert outcome.status == 0
    assert len(outcome.out.splitlines()) == 1
    found = outcome.object
    assert {"bench", "status", "kpis", "requirements", "files"} <= found.keys()
    assert (found["bench"], found["status"]) == ("bench", "passed")
    assert all({"value", "unit"} <= kpi.keys() for kpi in found["kpis"].values())
    assert found["kpis"]["breakaway_apply"]["unit"] == "N*m"
    (requirement,) = found["requirements"]
    assert requirement["kpi"] == "breakaway_apply"
    assert requirement["met"] is True
    assert sorted(map(str, (tmp_path / "out").iterdir())) == sorted(found["files"])
    no_half_files(tmp_path)


def test_undefined_kpi_is_null_and_meets_nothing(bywire, bench):
    outcome = bywire("run", bench(BRAKING + QUICK + UNDEFINED), "--json")
    assert outcome.status == 1
    assert outcome.object["kpis"]["settling_time"]["value"] is None
    (requirement,) = outcome.object["requirements"]
    assert (requirement["value"], requirement["met"]) == (None, False)
    assert "requirement not met: settling_time is not defined, limit <= 10 s" in outcome.err
    assert "never settles" in outcome.err


@pytest.mark.parametrize("name", NAMES)
def test_name_is_text_and_never_a_path(bywire, bench, tmp_path, name):
    inner = tmp_path / "a" / "b"
    text = f"name = '{name}'\n" + CURVE
    path = bench(text)
    outcome = bywire("run", path, "--out", inner, "--json")
    assert outcome.status == 0
    assert outcome.object["bench"] == name
    found = [p for p in tmp_path.rglob("*") if p.is_file() and p != path]
    assert found
    assert all(p.parent == inner for p in found)
    page = (inner / "report.html").read_text(encoding="utf-8")
    assert "<script>alert" not in page
    assert page.count("<script") == ("<svg" in page)  # the script that zooms figures


def test_folder_is_made_with_its_parents(bywire, bench, tmp_path):
    assert bywire("run", bench(CURVE), "--out", tmp_path / "a" / "b" / "c").status == 0
    assert (tmp_path / "a" / "b" / "c" / "report.html").is_file()


@pytest.mark.parametrize("out", ["", " "])
def test_no_folder_is_not_the_current_one(bywire, bench, tmp_path, monkeypatch, out):
    path = bench()
    monkeypatch.chdir(tmp_path)
    refused(bywire("run", path, "--out", out), "--out", "Specify a folder")
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_file_in_place_of_the_folder(bywire, bench, tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("mine", encoding="utf-8")
    refused(bywire("run", bench(), "--out", taken), "output folder", "File exists", "--out")
    refused(bywire("run", bench(), "--out", taken / "below"), "Not a directory", "--out")
    assert taken.read_text(encoding="utf-8") == "mine"


@pytest.mark.skipif(not os.path.isdir("/proc"), reason="Linux only")
def test_folder_that_no_user_can_make(bywire, bench):
    refused(bywire("run", bench(), "--out", "/proc/bywire"), "output folder /proc/bywire", "--out")


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write anywhere")
def test_folder_without_permission(bywire, bench, tmp_path):
    closed = tmp_path / "closed"
    closed.mkdir()
    closed.chmod(stat.S_IRUSR | stat.S_IXUSR)
    refused(bywire("run", bench(), "--out", closed), "Permission denied", "--out")


@pytest.mark.parametrize(
    "blocked", ["curve.nc", "stribeck-curve.png", "report.html", "result.json"]
)
def test_results_are_shown_even_when_a_file_cannot_be_written(bywire, bench, tmp_path, blocked):
    out = tmp_path / "out"
    (out / blocked).mkdir(parents=True)
    outcome = bywire("run", bench(CURVE), "--out", out, "--json")
    assert outcome.status == 2
    assert outcome.object["kpis"]["breakaway_apply"]["value"] > 0
    assert "error: cannot write" in outcome.err
    assert blocked in outcome.err
    no_half_files(out)


def test_older_results_stay_when_the_new_bench_is_refused(bywire, bench, tmp_path):
    out = tmp_path / "out"
    bywire("run", bench(CURVE), "--out", out)
    before = {p.name: p.read_bytes() for p in out.iterdir()}
    refused(bywire("run", bench(BRAKING + "[set]\nmotor.R_m = 0\n"), "--out", out))
    assert {p.name: p.read_bytes() for p in out.iterdir()} == before


@pytest.mark.usefixtures("drawn")
def test_end_stop_is_a_warning_and_the_run_is_done(bywire, bench, tmp_path):
    text = OPEN_LOOP + '[options]\nduration = "200 ms"\n' + STEP
    outcome = bywire("run", bench(text), "--out", tmp_path / "out", "--json")
    assert outcome.status == 0
    assert "bywire: warning: the piston reached its end stop at t = 0." in outcome.err
    assert any("end stop" in text for text in outcome.object["warnings"])
    recording = package.read_recording(tmp_path / "out" / "run.nc")
    assert recording.attrs["status"] == "done"
    assert any("end stop" in text for text in recording.attrs["warnings"])
    assert float(recording["F_stop"].max()) > 0
    assert "end stop" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_warnings_of_a_library_come_as_messages(bywire, bench, monkeypatch):
    import warnings

    from bywire.usecases import use_cases
    from bywire.usecases.run import run

    def noisy(*arguments, **settings):
        warnings.warn("seeded", RuntimeWarning, stacklevel=1)
        return run(*arguments, **settings)

    monkeypatch.setitem(vars(use_cases()["run"]), "function", noisy)
    outcome = bywire("run", bench(), "--json")
    assert (outcome.status, outcome.lines) == (0, ["bywire: warning: seeded"])


def test_an_experiment_runs_by_its_name(bywire):
    outcome = bywire("run", "hard-braking", "--json", "--set", "simulation.seed=1")
    assert outcome.status == 0
    assert outcome.object["bench"] == "hard-braking"
    assert outcome.object["kpis"]


def test_a_file_comes_before_an_experiment_of_its_name(bywire, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hard-braking").write_text("nothing = 1")
    refused(bywire("run", "hard-braking"), "unknown key of a bench file 'nothing'")
    # A folder is not a bench file, so the previous result folder does not interfere.
    (tmp_path / "seal-stribeck").mkdir()
    assert bywire("run", "seal-stribeck").status == 0


def test_misspelled_experiment(bywire):
    refused(
        bywire("run", "moment-pulse"),
        "did you mean moment-pulses? Names of your own brake or of an example need --system PATH",
    )


def test_what_a_run_did_instead_stands_above_its_key_figures(bywire, bench):
    weak = ("seal.T_pr=0.15 N*m", "ecu.dither.waveform=off", "ecu.pressure.k_i=0")
    changes = [part for text in ("options.duration=0.2 s", *weak) for part in ("--set", text)]
    above = " ".join(bywire("run", bench(), *changes).out.partition("name  ")[0].split())
    for text in (
        "changed from dardanelli2010: ",
        "seal.T_pr = 0.15 N·m (was 0.002 N·m)",
        "ecu.dither.waveform = off (was ",
        "misses its set point: p_mc ends ",
        "40.3 % of the step",
    ):
        assert text in above
    shown = bywire("run", bench(), *changes, "--json").object
    assert shown["status"] == "done"  # no requirements
    assert any(text.startswith("misses its set point") for text in shown["remarks"])
    plain = bywire("run", bench(BRAKING))
    assert plain.out.startswith("name  ")
