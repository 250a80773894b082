"""Commands for studies with many cases."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import BRAKING, QUICK, no_half_files, refused

from bywire.core.errors import FileError
from bywire.usecases.study import study_report
from emulated_driver import EmulatedDriver, emulated

STUDY = 'bench = "bench.toml"\n[vary]\n"motor.R_m" = "+-5 %"\n[design]\ncases = 64\n'


@pytest.fixture
def study(bench, tmp_path):
    bench(BRAKING + QUICK + '[requirements]\npeak_current = "<= 18.57 A"\n')
    path = tmp_path / "tolerances.toml"
    path.write_text(STUDY + '[requirements]\npeak_current = "<= 25 A with 90 %"\n')
    return path


def test_from_the_file_to_the_report_and_on(bywire, study, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    outcome = bywire("study", "run", study)
    assert outcome.status == 0
    assert "64 of 64" in outcome.out
    out = tmp_path / "tolerances"
    names = {path.name for path in out.iterdir()}
    assert {
        "report.html",
        "report.json",
        "study.json",
        "histograms.png",
        "convergence.png",
        "worst-peak_current.toml",
        "worst-peak_current.nc",
    } <= names
    extended = bywire("study", "extend", out, "--cases", "128", "--json").object
    assert (extended["cases"], extended["status"]) == (128, "passed")
    assert bywire("study", "resume", out).status == 0
    status = bywire("study", "status", out, "--json").object
    assert status["kpis"]["peak_current"] == extended["kpis"]["peak_current"]
    told = bywire("study", "surrogate", out, "--at", "motor.R_m=+1%", "--json").object
    assert 15.0 < told["surrogates"]["peak_current"]["value"] < 25.0
    beyond = bywire("study", "surrogate", out, "--at", "motor.R_m=9ohm")
    refused(beyond, "9 ohm", "the range of the surrogate")
    assert bywire("run", out / "worst-peak_current.toml").status == 0
    no_half_files(out)


def test_what_every_case_has_to_meet_and_one_does_not(bywire, study, tmp_path):
    study.write_text(STUDY)  # the bench's own requirement
    outcome = bywire("study", "run", study, "--out", tmp_path / "out")
    assert outcome.status == 1
    assert "bywire: requirement missed: peak_current <= 18.57 A" in outcome.lines


def test_a_choice_has_no_polynomial(bywire, study, tmp_path):
    choice = '[vary]\n"adc.law" = { values = ["ideal", "quantized"] }\n'
    study.write_text(STUDY.replace("[vary]\n", choice))
    bywire("study", "run", study, "--out", tmp_path / "out")
    for at in ((), ("--at", "adc.law=ideal"), ("--at", "motor.R_m=+1%")):
        outcome = bywire("study", "surrogate", tmp_path / "out", *at)
        refused(outcome, "adc.law", "choice", "a study for each of its values")


def test_an_unfinished_study_says_so(bywire, study, tmp_path):
    out = tmp_path / "out"
    bywire("study", "run", study, "--out", out, "--cases", "128")
    (out / "chunks" / "000001.parquet").unlink()
    outcome = bywire("study", "status", out)
    assert outcome.status == 1
    assert "64 of 128 cases are not computed yet" in outcome.err


def test_bad_input_is_one_error(bywire, study, tmp_path):
    study.write_text(STUDY.replace("motor.R_m", "motor.R_x"))
    refused(bywire("study", "run", study), "motor.R_m", str(study))
    refused(bywire("study", "status", tmp_path), "does not contain a study")
    refused(bywire("study", "tolerances.toml"), "bywire study run tolerances.toml")


@pytest.mark.parametrize(
    "command", [("resume",), ("extend", "--cases", "99"), ("report",), ("status",), ("surrogate",)]
)
def test_a_file_is_no_folder_of_a_study(bywire, study, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    name, *more = command
    texts = "is a study file, not", f"'bywire study run {study}'"
    refused(bywire("study", name, study, *more), str(study), *texts)
    for kept in (tmp_path / "results" / study.stem, tmp_path / study.stem):
        kept.mkdir(parents=True)
        (kept / "study.json").write_text("{}")
        wanted = f"Did you mean {kept.relative_to(tmp_path)}?"
        refused(bywire("study", name, study, *more), wanted)
        refused(bywire("study", name, kept / "study.json", *more), f"Did you mean {kept}?")
    with pytest.raises(FileError, match="is a study file"):
        study_report(study)


@pytest.mark.parametrize("command", ["resume", "report"])
def test_a_folder_that_cannot_be_written_has_no_option(bywire, tmp_path, command):
    (tmp_path / "file").touch()
    outcome = bywire("study", command, tmp_path / "file" / "folder")
    refused(outcome, "cannot write to the output folder", "you have write permission there")
    assert "--out" not in outcome.err


def test_a_graphics_processor_that_is_not_there_is_no_study(bywire, study, tmp_path):
    driver = EmulatedDriver()
    driver.count = 0
    with emulated(driver):
        outcome = bywire("study", "run", study, "--out", tmp_path / "out", "--engine", "cuda")
    refused(outcome, "finds no NVIDIA graphics processor", "nvidia-smi", status=3)
    assert not (tmp_path / "out").exists()
    refused(bywire("study", "run", study, "--engine", "cudo"), "did you mean 'cuda'")


def test_help_names_both_kinds_of_studies(bywire):
    outcome = bywire("study", "--help")
    assert outcome.status == 0
    assert all(word in outcome.out for word in ("run", "resume", "extend", "report", "size"))


@pytest.mark.parametrize("place", ["", "studies"])
@pytest.mark.parametrize("word", ["tolerances", "tolrances"])
def test_the_name_of_a_study_file_is_no_sizing_study(
    bywire, study, tmp_path, monkeypatch, place, word
):
    monkeypatch.chdir(tmp_path)
    there = Path(place, study.name)
    (tmp_path / place).mkdir(exist_ok=True)
    study.rename(tmp_path / there)
    (tmp_path / "tolerance.toml").write_text('life = "wedge-pads"\n')  # a similar name
    refused(bywire("study", word), f"run the study file {there}, type 'bywire study run {there}'")
    refused(bywire("study", "run", word), f"Did you mean {there}?")
    assert not (tmp_path / word).exists()


def test_a_study_that_is_nothing_says_what_is_wanted(bywire, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    texts = "unknown sizing study 'foo': valid names are actuator-sizing", "'bywire study run FILE'"
    refused(bywire("study", "foo"), *texts)
    refused(bywire("study", "drive-trian"), "did you mean 'drive-train'?")
    for name in ("foo", "foo.toml", "foo/bar.toml"):
        refused(bywire("study", "run", name), f"the study file {name} does not exist", "the path")
    assert not any(tmp_path.iterdir())
