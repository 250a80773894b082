"""``bywire identify output-error``: measured files in, parameters of any bench out."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import Outcome, no_half_files, refused

import bywire
from bywire.bench.bench_file import load

Bywire = Callable[..., Outcome]

BENCH = """experiment = "motor-open-loop"
parameters = "dardanelli2010"
[options]
source = "voltage"
duration = "0.25 s"
[stimulus]
kind = "step"
start = "0 V"
end = "0 V"
t_step = "0 s"
[requirements]
p_max = "<= 100 bar"
"""
UNKNOWNS = ("--unknown", "motor.R_m=0.4..1 ohm", "--unknown", "motor.K_e")
OUTPUTS = ("--output", "p_mc=0.02 bar", "--output", "i=10 mA")


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    path = tmp_path / "bench.toml"
    path.write_text(BENCH)
    return path


def run_file(path: Path, p_start: float, f: str, seed: int) -> Path:
    """Write the bench's sensor signals, simulated with other parameters than the bench's."""
    made = bywire.run(
        bywire.Bench(
            "motor-open-loop",
            "dardanelli2010",
            overrides={"motor.R_m": 0.42, "motor.K_e": 0.028},
            options={
                "source": "voltage",
                "add_holding": True,
                "duration": 0.25,
                "p_start": p_start,
            },
            stimulus={"kind": "sine", "mean": 0, "amplitude": 2, "f": f, "phase": 0, "t_start": 0},
        )
    ).recording
    random = np.random.default_rng(seed)
    table = np.column_stack(
        (
            made["time"],
            made["voltage"],
            made["p_mc"] / 1e5 + random.normal(0.0, 0.02, made.sizes["time"]),
            made["i"] + random.normal(0.0, 0.01, made.sizes["time"]),
        )
    )
    np.savetxt(path, table, delimiter=",", header="t [s],u [V],pressure [bar],i [A]", comments="")
    return path


def test_files_become_a_bench_file(bywire: Bywire, bench: Path, tmp_path: Path) -> None:
    runs = [(8e5, "4 Hz"), (12e5, "9 Hz"), (10e5, "6 Hz")]
    files = [run_file(tmp_path / f"run{k}.csv", p, f, k) for k, (p, f) in enumerate(runs)]
    mapping, out = tmp_path / "map.toml", tmp_path / "out"
    columns = {"p_mc": "pressure", "i": "i", "u": "u"}
    mapping.write_text("".join(f'[signals.{k}]\ncolumn = "{v}"\n' for k, v in columns.items()))
    found = bywire(
        "identify",
        "output-error",
        *files[:2],
        "--holdout",
        files[2],
        "--map",
        mapping,
        "--bench",
        bench,
        "--input",
        "v_set=u",
        *OUTPUTS[:2],
        *UNKNOWNS,
        "--prior",
        "motor.K_e=0.03 +- 0.01 N*m/A",
        "--loss",
        "huber",
        "--option",
        "between=linear",
        "--starts",
        "2",
        "--out",
        out,
        "--json",
    )
    assert found.status == 0, found.err
    rows = found.object["estimates"]["output error"]["parameters"]
    for name, value in (("motor.R_m", 0.42), ("motor.K_e", 0.028), ("run1:start.p_start", 12e5)):
        low, high = rows[name]["interval_95"]
        assert low - 0.5 * (high - low) < value < high + 0.5 * (high - low)
        assert high - low < 0.03 * value
    assert found.object["options"]["loss"] == "huber"
    assert found.object["start"]["motor.R_m"] == pytest.approx(0.7)  # the bench's value is outside
    assert found.object["start"]["run1:start.p_start"] == pytest.approx(12e5, rel=0.05)
    assert (
        json.loads((out / "estimate.json").read_text())["parameters"]
        == (found.object["parameters"])
    )
    assert {Path(f).name for f in found.object["files"]} == {
        "parameters.toml",
        "report.html",
        "estimate.json",
        "residuals.png",
        "correlation.png",
        "fit-p_mc-run0.png",
        "fit-p_mc-run1.png",
        "validation-p_mc-held_out.png",
    }
    no_half_files(out)
    written = load(out / "parameters.toml")
    assert written.par.leaves()["motor.R_m"] == pytest.approx(rows["motor.R_m"]["value"], rel=1e-9)
    assert written.options == {"source": "voltage", "duration": "0.25 s"}
    assert written.requirements == {"p_max": "<= 100 bar"}
    replayed = bywire(
        "replay",
        files[2],
        "--map",
        mapping,
        "--bench",
        out / "parameters.toml",
        "--input",
        "v_set=u",
        "--output",
        "p_mc",
        "--tolerance",
        "p_mc.nrmse <= 3 %",
    )
    assert replayed.status == 0, replayed.err


def test_a_closed_loop_simulated_and_fed_back(bywire: Bywire, tmp_path: Path) -> None:
    common = (
        "--bench",
        "hard-braking",
        "--set",
        "options.duration=0.3 s",
        "--set",
        "options.settle=0.2 s",
        "--output",
        "p_mc",
        "--output",
        "i",
        "--unknown",
        "motor.R_m",
        "--unknown",
        "motor.K_e",
        "--starts",
        "2",
    )
    out = tmp_path / "out"
    given = ("identify", "output-error", "--synthetic", "1", *common)
    first = bywire(*given, "--out", out, "--json")
    assert first.status == 0, first.err
    estimate = first.object["estimates"]["output error"]
    for name, value in (("motor.R_m", 0.35), ("motor.K_e", 0.0304)):
        low, high = estimate["parameters"][name]["interval_95"]
        assert low - 0.5 * (high - low) < value < high + 0.5 * (high - low)
        assert high - low < 0.05 * value
    assert "rounding has no derivative" in " ".join(first.object["notes"])
    again = bywire("identify", "output-error", out / "measurement.nc", *common, "--json")
    other = again.object["estimates"]["output error"]["parameters"]
    for name, row in estimate["parameters"].items():
        assert other[name]["value"] == pytest.approx(row["value"], rel=1e-4)


def test_refusals(bywire: Bywire, bench: Path, tmp_path: Path) -> None:
    data = run_file(tmp_path / "run.csv", 8e5, "4 Hz", 1)
    method = ("identify", "output-error")
    refused(bywire(*method, data), "needs --bench")
    refused(bywire(*method, data, "--bench", bench, *OUTPUTS), "there is no unknown")
    refused(bywire(*method, data, "--bench", bench, *UNKNOWNS), "there is no output")
    given = (*method, data, "--bench", bench, *OUTPUTS, *UNKNOWNS)
    refused(bywire(*given), "run.csv", "'p_mc'", "--map")
    current = (*given[:5], "--output", "i", *UNKNOWNS)
    refused(bywire(*current), "no measured signal drives the model", "v_set")
    refused(bywire(*current, "--input", "v_set=i_bat"), "'i_bat'")
    refused(bywire(*current, "--input", "v_set=pressure"), "pressure is in Pa, but must be in V")
    refused(bywire(*current, "--loss", "hubert"), "'huber'")
    refused(bywire(*current, "--unknown", "motor.K_e"), "motor.K_e appears twice")
    refused(bywire(*current, "--set", "motor.Rm=1 ohm"), "motor.R_m")
    refused(
        bywire(
            *method, "--synthetic", "1", "--holdout", data, "--bench", bench, *OUTPUTS, *UNKNOWNS
        ),
        "--holdout applies only to measurement files",
    )
    refused(
        bywire("identify", "friction-ramp", "--synthetic", "1", "--unknown", "motor.R_m"),
        "--unknown",
        "output-error",
        "friction-ramp",
    )
    refused(
        bywire("identify", "friction-ramp", "--synthetic", "1", "--loss", "huber"),
        "--loss",
        "output-error",
        "friction-ramp",
    )
    refused(
        bywire(*given, "--holdout", tmp_path / ".." / tmp_path.name / "run.csv"),
        "run.csv is",
        "a fitted record",
    )
    copy = tmp_path / "copy.csv"
    copy.write_bytes(data.read_bytes())
    refused(bywire(*given, "--holdout", copy), "has the same content as", "a fitted record")
    refused(bywire("identify", "output-eror"), "output-error")


def test_it_is_listed(bywire: Bywire) -> None:
    assert "output-error" in bywire("list", "--json").object["methods"]
    about = bywire("list", "output-error").out
    assert "most_residual" in about
    assert "--bench" in about
