"""``bywire convert``: what it writes, what it tells, what it refuses."""

from pathlib import Path

import numpy as np
import pytest
from command_line import no_half_files, refused

from bywire.data.measurement import read_measurement

MAPPING = """
time = { column = "t", unit = "ms" }
[signals.p_mc]
column = "p"
unit = "bar"
delay = "2 ms"
[signals.x_mc]
column = "x"
unit = "mm"
"""
SEAL = Path(__file__).parents[3] / "shared" / "data" / "seal_friction" / "O-ring_1bar.csv"


@pytest.fixture
def run(tmp_path):
    """Measurement at 100 Hz with a pause, and its mapping."""
    rows = "".join(f"{10 * k},{k},{0.1 * k:.1f}\n" for k in range(200) if not 50 <= k < 80)
    (tmp_path / "run.csv").write_text("t,p,x\n" + rows)
    (tmp_path / "map.toml").write_text(MAPPING)
    return tmp_path / "run.csv"


def test_alignment_is_told(bywire, run, tmp_path, monkeypatch):
    out = tmp_path / "run.nc"
    arguments = ("convert", run, out, "--map", tmp_path / "map.toml", "--rate", "50 Hz")
    outcome = bywire(*arguments, "--json")
    assert outcome.status == 0
    told = outcome.object
    assert told["files"] == [str(out)]
    alignment = told["alignment"]
    assert (alignment["interval"], alignment["method"]) == (0.02, "linear")
    channel = alignment["channels"]["p_mc"]
    assert channel["rate"] == pytest.approx(100.0)
    assert channel["delay"] == 0.002
    assert channel["gaps"]["count"] == 1
    assert channel["gaps"]["longest"][0] == pytest.approx(
        {"start": 0.488, "length": 0.31, "samples": 0}
    )
    found = read_measurement(out)
    assert int(np.isnan(found["p_mc"]).sum()) == channel["excluded_samples"] > 0
    there = found["p_mc"].dropna("time")
    np.testing.assert_allclose(there, 1e5 * 100.0 * (there["time"] + 0.002), rtol=1e-9, atol=1e-3)
    monkeypatch.setenv("COLUMNS", "200")
    text = bywire(*arguments, "--force", "--exclude", "nothing")
    assert "1, longest 310 ms at 488 ms" in text.out
    assert "excluded: nothing" in text.out
    assert not np.isnan(read_measurement(out)["p_mc"]).any()
    no_half_files(tmp_path)


@pytest.mark.parametrize("out", ["a.tsv", "a.mat", "a.csv"])
def test_there_and_back(bywire, run, tmp_path, out):
    first = bywire(
        "convert", run, tmp_path / out, "--map", tmp_path / "map.toml", "--signals", "x_mc"
    )
    assert first.status == 0
    assert "x_mc" in first.out
    found = read_measurement(tmp_path / out)
    wanted = read_measurement(run, tmp_path / "map.toml", signals=["x_mc"])
    np.testing.assert_array_equal(found["x_mc"], wanted["x_mc"])
    np.testing.assert_array_equal(found["time"], wanted["time"])


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("run.csv", "out.nc"), '--signals "p [UNIT], x [UNIT]" --time "t [s]"'),
        (("none.csv", "out.nc"), "none.csv cannot be read (No such file"),
        (("run.csv", "out.xyz"), "'.xyz'"),
        (("run.csv", "run.csv", "--map", "map.toml"), "run.csv already exists"),
        (("run.csv", "out.csv", "--map", "map.toml"), "different times"),
        (("run.csv", "out.nc", "--map", "map.toml", "--signals", "p_cm"), "did you mean 'p_mc'"),
        (("run.csv", "out.nc", "--signals", "p=pressure"), "Write pressure=p"),
        (("run.csv", "out.nc", "--map", "map.toml", "--rate", "5 ms"), "cannot be converted to Hz"),
        (("run.csv", "out.nc", "--map", "map.toml", "--rate", "0 Hz"), "must be > 0 Hz"),
        (("run.csv", "out.nc", "--map", "map.toml", "--method", "linear"), "Add a sample rate"),
        (("run.csv", "no/out.nc", "--map", "map.toml"), "cannot write"),
        (("run.csv", "out.nc", "--map", "none.toml"), "cannot read mapping none.toml"),
    ],
)
def test_refusals(bywire, run, tmp_path, monkeypatch, arguments, text):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.iterdir())
    refused(bywire("convert", *arguments), text)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.skipif(not SEAL.exists(), reason="the measured seal is not there")
def test_the_measured_seal(bywire, tmp_path):
    """For strokes from 5 mm to 30 mm, force per pressure is the bore area, 49.1 mm², plus seal."""
    (tmp_path / "map.toml").write_text(
        'time = { column = 1, unit = "ms" }\n[signals.x]\ncolumn = 5\nunit = "mm"\n'
        '[signals.p]\ncolumn = 6\nunit = "bar"\n[signals.F]\ncolumn = 7\nunit = "N"\n'
    )
    out = tmp_path / "seal.nc"
    outcome = bywire("convert", SEAL, out, "--map", tmp_path / "map.toml", "--rate", "100 Hz")
    assert outcome.status == 0
    found = read_measurement(out).dropna("time")
    moving = (found["x"] > 5e-3) & (found["x"] < 30e-3)
    area = float((found["F"] / found["p"])[moving].mean())
    assert area == pytest.approx(np.pi / 4 * 0.025**2, rel=0.03)
