"""``bywire identify``: tables, reports, files that go on, studies, refusals."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import Outcome, no_half_files, refused

from bywire.bench.bench_file import load
from bywire.catalog.registry import parameters
from bywire.identification.parameter_file import parameter_file

Bywire = Callable[..., Outcome]


def test_a_simulated_measurement_can_be_fed_back(bywire: Bywire, tmp_path: Path) -> None:
    out = tmp_path / "first"
    first = bywire("identify", "seal-friction", "--synthetic", "2", "--out", out, "--json")
    assert first.status == 0
    assert {Path(f).name for f in first.object["files"]} == {
        "measurement.nc", "report.html", "estimate.json", "friction.png", "strokes.png",
        "residuals.png", "correlation.png",
    }  # fmt: skip
    assert all(Path(f).stat().st_size > 500 for f in first.object["files"])
    no_half_files(out)
    again = bywire("identify", "seal-friction", out / "measurement.nc", "--json")
    assert again.status == 0
    for name in ("estimates", "figures", "checks"):
        assert again.object[name] == first.object[name]
    assert json.loads((out / "estimate.json").read_text())["estimates"] == again.object["estimates"]
    page = (out / "report.html").read_text()
    for text in ("All checks hold.", "loop_half_width_at_0", "Residuals", "simulated experiment"):
        assert text in page


def test_a_failed_check_is_status_1(bywire: Bywire) -> None:
    outcome = bywire("identify", "friction-model", "--synthetic", "1", "--option", "law=viscous",
                     "--option", "duration=4 s")  # fmt: skip
    assert outcome.status == 1
    assert "check failed: misfit_over_friction" in outcome.err
    assert "failed" in outcome.out


def test_a_study_is_stored_with_its_seeds(bywire: Bywire, tmp_path: Path) -> None:
    arguments = ("identify", "seal-friction", "--study", "12", "--seed", "30", "--out", tmp_path)
    found = bywire(*arguments, "--json")
    assert found.status == 0
    stored = json.loads((tmp_path / "study.json").read_text())
    assert stored["seeds"] == list(range(30, 42))
    assert set(stored["recovered"]) == {"A", "F_0", "f"}
    assert len((tmp_path / "experiments.jsonl").read_text().splitlines()) == 12
    again = bywire(*arguments, "--json")  # from the store
    assert again.object["recovered"] == found.object["recovered"]
    assert len((tmp_path / "experiments.jsonl").read_text().splitlines()) == 12


def test_refusals(bywire: Bywire, tmp_path: Path) -> None:
    refused(bywire("identify", "seal-frictio"), "seal-friction")
    refused(bywire("identify", "seal-friction"), "needs one of", "F [N], x [m], p [Pa]")
    refused(bywire("identify", "seal-friction", "--synthetic", "1", "--study", "5"), "one of")
    refused(bywire("identify", "seal-friction", "--synthetic", "1", "--set", "a.b=1"), "--set")
    refused(
        bywire("identify", "seal-friction", "--synthetic", "1", "--option", "x_lo=1 mm"), "x_low"
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
    """What the experiment sets itself is said, not set."""
    par = parameters("dardanelli2010")
    changes = {"ecu.dither.waveform": dither, "seal.T_pr": 0.0123, "motor.R_m": 0.321}
    path = tmp_path / "parameters.toml"
    path.write_text(parameter_file("friction-ramp", "dardanelli2010", par, changes, "from a file"))
    bench = load(path)
    leaves = bench.par.leaves()
    assert leaves["seal.T_pr"] == 0.0123
    assert leaves["motor.R_m"] == 0.321
    other = parameter_file("hard-braking", "dardanelli2010", par, {"drive.mode": "current-source"})
    assert "# the experiment sets this itself: drive.mode" in other
    path.write_text(other)
    load(path)
    driven = parameter_file("open-loop", "dardanelli2010", par, {"motor.R_m": 0.321})
    assert "# experiment 'open-loop' wants more than this file says" in driven
    path.write_text(driven)
    assert load(path).par.leaves()["motor.R_m"] == 0.321
