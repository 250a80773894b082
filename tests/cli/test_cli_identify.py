"""``bywire identify``: tables, reports, files that go on, studies, refusals."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import Outcome, no_half_files, page_text, refused

from bywire.api.identification import parameter_file
from bywire.bench.bench_file import load
from bywire.core.catalog import parameters
from bywire.core.scratch import UNFINISHED
from bywire.identification.method import METHODS

Bywire = Callable[..., Outcome]


@pytest.mark.usefixtures("drawn")
def test_a_simulated_measurement_can_be_fed_back(bywire: Bywire, tmp_path: Path) -> None:
    out = tmp_path / "first"
    first = bywire("identify", "seal-friction", "--synthetic", "2", "--out", out, "--json")
    assert first.status == 0
    assert {Path(f).name for f in first.object["files"]} == {
        "measurement.nc",
        "report.html",
        "estimate.json",
        "friction.png",
        "strokes.png",
        "loops.png",
        "residuals.png",
        "correlation.png",
    }
    assert all(Path(f).stat().st_size > 500 for f in first.object["files"])
    no_half_files(out)
    again = bywire("identify", "seal-friction", out / "measurement.nc", "--json")
    assert again.status == 0
    assert first.object["put_in"]["A"] == 4.9e-4
    assert again.object["put_in"] == {}  # measured, as far as bywire can determine
    for name in ("estimates", "figures", "checks"):
        assert again.object[name] == first.object[name]
    assert json.loads((out / "estimate.json").read_text())["estimates"] == again.object["estimates"]
    page = page_text(out / "report.html")
    for text in ("All checks passed.", "loop_half_width_at_0", "Residuals", "simulated experiment"):
        assert text in page


def test_a_bench_file_says_what_failed_and_what_it_cannot_do(
    bywire: Bywire, tmp_path: Path
) -> None:
    arguments = ("identify", "motor-winding", "--synthetic", "1", "--option", "duration=0.2 s")
    good = bywire(*arguments, "--out", tmp_path / "good")
    assert good.status == 0
    assert "voltage source" in good.err
    said = (tmp_path / "good" / "parameters.toml").read_text()
    assert "CHECK FAILED" not in said
    assert "voltage source" in said
    data = tmp_path / "good" / "measurement.nc"
    other = ("--set", "anti_alias.f_aa=120 Hz", "--out", tmp_path / "wrong")
    wrong = bywire("identify", "motor-winding", data, *other, "--json")
    assert wrong.status == 1
    first = (tmp_path / "wrong" / "parameters.toml").read_text().splitlines()[0]
    assert first.startswith("# CHECK FAILED, do not use this file: residual_over_noise = ")
    assert wrong.object["options"] == {}  # all of them affect only simulations
    refused(
        bywire("identify", "motor-winding", data, "--option", "rotor=turning"),
        "rotor",
        "affects only simulated",
    )


@pytest.mark.parametrize(
    ("given", "texts"),
    [
        ("F_set", ("unknown stimulus 'F_set'", "did you mean 'v_set'", "Valid names are p_set, ")),
        (
            "frequency=p_mc",
            ("unknown stimulus 'frequency': valid names are p_set, pedal_force, i_set",),
        ),
        ("Demand=p_set", ("Write --input p_set=Demand",)),
        ("p_set=", ("--input p_set= is not valid. Write STIMULUS=SIGNAL", "p_set=p_ref")),
    ],
)
def test_an_input_that_is_none_is_refused_with_those_that_are(
    bywire: Bywire, given: str, texts: tuple[str, ...]
) -> None:
    asked = ("--bench", "hard-braking", "--output", "p_mc", "--unknown", "motor.R_m")
    outcome = bywire("identify", "output-error", *asked, "--synthetic", "1", "--input", given)
    refused(outcome, *texts)


def test_options_that_only_simulate_are_options() -> None:
    for method in METHODS.all().values():
        assert set(method.simulated) <= set(method.options.model_fields), method.name
        assert method.simulated


def test_an_older_result_does_not_stay_beside_a_new_one(bywire: Bywire, tmp_path: Path) -> None:
    seal = ("identify", "seal-friction")
    assert bywire(*seal, "--synthetic", "1", "--out", tmp_path).status == 0
    data, other = tmp_path / "measurement.nc", tmp_path / "notes.txt"
    other.write_text("the user's own")
    refused(
        bywire("identify", "friction-model", "--synthetic", "1", "--out", tmp_path),
        "contains a result of seal-friction",
        "--out",
    )
    assert (tmp_path / "strokes.png").exists()
    bad = tmp_path / "still.csv"
    bad.write_text("t [s],F [N],x [m],p [Pa]\n" + "".join(f"{k},1,0,2\n" for k in range(50)))
    refused(bywire(*seal, bad, "--out", tmp_path))
    assert {path.name for path in tmp_path.iterdir()} == {"notes.txt", "still.csv"}
    assert bywire(*seal, "--synthetic", "1", "--out", tmp_path).status == 0
    again = bywire(*seal, data, "--out", tmp_path)
    assert again.status == 0
    assert data.exists()
    assert "no parameters.toml" in again.err


def test_a_study_keeps_out_of_other_folders(bywire: Bywire, tmp_path: Path) -> None:
    law = ("--option", "duration=4 s", "--option", "law=stribeck-pressure", "--out", tmp_path)
    file = tmp_path / "study.json"
    file.write_text('{"method": "seal-friction"}')
    for wanted in (("--study", "2"), ("--synthetic", "1")):
        refused(
            bywire("identify", "friction-model", *wanted, *law),
            "contains a study of seal-friction",
            "study.json",
        )
    file.unlink()
    found = bywire("identify", "friction-model", "--synthetic", "1", *law, "--json")
    assert found.status == 0
    assert found.object["put_in"]["F_c"] == 20.0
    assert found.object["start"] == {}  # it needs no stimulus
    refused(
        bywire("identify", "seal-friction", "--study", "2", "--out", tmp_path),
        "contains a result of friction-model",
    )
    page = page_text(tmp_path / "report.html")
    assert "true value" in page
    assert ">start<" not in page


def test_what_was_put_in_stands_beside_the_start(bywire: Bywire) -> None:
    arguments = ("identify", "motor-winding", "--option", "duration=0.2 s", "--synthetic", "3")
    found = bywire(*arguments, "--json").object
    truth = parameters("dardanelli2010").leaves()
    for name, estimate in found["estimates"]["winding"]["parameters"].items():
        assert found["put_in"][name] == truth[name]
        assert 0.0 < abs(found["start"][name] / truth[name] - 1.0) < 0.31
        low, high = estimate["interval_95"]
        assert abs(estimate["value"] - truth[name]) < high - low
    assert "true value" in bywire(*arguments).out


def test_a_failed_check_is_status_1(bywire: Bywire) -> None:
    outcome = bywire(
        "identify",
        "friction-model",
        "--synthetic",
        "1",
        "--option",
        "law=viscous",
        "--option",
        "duration=4 s",
    )
    assert outcome.status == 1
    assert "check failed: misfit_over_friction" in outcome.err
    assert "failed" in outcome.out


def test_a_study_is_stored_with_its_seeds(bywire: Bywire, tmp_path: Path) -> None:
    arguments = ("identify", "seal-friction", "--study", "4", "--seed", "30", "--out", tmp_path)
    found = bywire(*arguments, "--json")
    assert found.status == 0
    stored = json.loads((tmp_path / "study.json").read_text())
    assert stored["seeds"] == list(range(30, 34))
    assert set(stored["recovered"]) == {"A", "F_0", "f"}
    assert len((tmp_path / "experiments.jsonl").read_text().splitlines()) == 4
    again = bywire(*arguments, "--json")  # from the store
    assert again.object["recovered"] == found.object["recovered"]
    assert len((tmp_path / "experiments.jsonl").read_text().splitlines()) == 4


def test_refusals(bywire: Bywire, tmp_path: Path) -> None:
    refused(bywire("identify", "seal-frictio"), "seal-friction")
    refused(bywire("identify", "seal-friction"), "needs measurement files", "F [N], x [m], p [Pa]")
    refused(bywire("identify", "seal-friction", "--synthetic", "1", "--study", "5"), "only one of")
    for flag in ("--map", "--holdout"):
        refused(
            bywire("identify", "seal-friction", "--study", "5", flag, "x.csv"),
            f"{flag} applies only to measurement files",
        )
    refused(bywire("identify", "seal-friction", "--synthetic", "1", "--set", "a.b=1"), "--set")
    refused(
        bywire("identify", "seal-friction", "--synthetic", "1", "--option", "x_lo=1 mm"),
        "x_low",
        "'bywire list seal-friction'",
    )
    for text, said in (
        ("3", "'20 bar'"),
        ("1 bar, 3", "pressures.1 = '3'"),
        ("x", "commas"),
        ("1 bar", "must have at least 2 values, got '1 bar'"),
        ("-1 bar, 1 bar", ">= 0 bar"),
    ):
        refused(
            bywire(
                "identify", "seal-friction", "--synthetic", "1", "--option", f"pressures={text}"
            ),
            "pressures",
            said,
        )
    refused(
        bywire("identify", "friction-ramp", "--synthetic", "1", "--parameters", "roberts2003"),
        "wedge-brake",
    )
    refused(bywire("identify", "friction-ramp", "a.csv", "b.csv"), "one measurement, not 2")
    refused(bywire("identify", "seal-friction", tmp_path / "no.csv"), "no.csv")
    data = tmp_path / "x.csv"
    data.write_text("t [s],F [N],p [bar]\n" + "".join(f"{k},1,2\n" for k in range(50)))
    refused(bywire("identify", "seal-friction", data), "'x'", "--map")


@pytest.mark.parametrize("dither", ["off", "sine"])
def test_parameters_go_on_as_a_bench_file(tmp_path: Path, dither: str) -> None:
    """A parameter that the experiment sets becomes a comment, not a setting."""
    par = parameters("dardanelli2010")
    changes = {"ecu.dither.waveform": dither, "seal.T_pr": 0.0123, "motor.R_m": 0.321}
    path = tmp_path / "parameters.toml"
    path.write_text(parameter_file("friction-ramp", "dardanelli2010", par, changes, "from a file"))
    bench = load(path)
    leaves = bench.par.leaves()
    assert leaves["seal.T_pr"] == 0.0123
    assert leaves["motor.R_m"] == 0.321
    other = parameter_file("hard-braking", "dardanelli2010", par, {"drive.mode": "current-source"})
    assert "# without effect in this experiment: drive.mode" in other
    path.write_text(other)
    load(path)
    driven = parameter_file("motor-open-loop", "dardanelli2010", par, {"motor.R_m": 0.321})
    assert "# experiment 'motor-open-loop' needs more than this file contains" in driven
    path.write_text(driven)
    assert load(path).par.leaves()["motor.R_m"] == 0.321


def test_values_lie_beside_their_checks_when_the_report_is_interrupted(
    bywire: Bywire, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    out = tmp_path / "out"
    arguments = (
        "identify",
        "motor-winding",
        "--synthetic",
        "1",
        "--option",
        "duration=0.1 s",
        "--out",
        out,
    )
    with monkeypatch.context() as stop:
        stop.setattr("bywire.report.drawing.save_figure", stopped)
        outcome = bywire(*arguments)
    assert outcome.status == 130
    assert f"the report in {out} is incomplete" in outcome.err
    kept = {"measurement.nc", "parameters.toml", "estimate.json"}
    assert {p.name for p in out.iterdir()} == {*kept, UNFINISHED}
    left = json.loads((out / "estimate.json").read_text())
    assert [check["holds"] for check in left["checks"]]
    assert {Path(f).name for f in left["files"]} > kept
    assert bywire(*arguments).status == 0
    assert {Path(f).name for f in left["files"]} == {p.name for p in out.iterdir()}
