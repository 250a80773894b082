"""Measured rides in bench files, found next to the bench file, and rejected if doubtful."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from command_line import PEDAL, refused

import bywire as package

HEADER = "time [s],pedal [mm]\n"
RIDE = HEADER + "".join(f"{k / 100:.2f},{9 + 0.2 * k:.1f}\n" for k in range(30))


@pytest.fixture
def ride(bench, tmp_path):
    """Return a function that writes a trace and a bench file that refers to the trace."""

    def write(text, name="ride.csv", options=""):
        data = text if isinstance(text, bytes) else text.encode()
        (tmp_path / name).write_bytes(data)
        return bench(f'{PEDAL}[options]\ntrace = "{name}"\n{options}')

    return write


def test_trace_is_looked_for_beside_the_bench_file(bywire, ride, tmp_path, monkeypatch):
    path = ride(RIDE)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    outcome = bywire("run", path, "--json")
    assert outcome.status == 0
    assert outcome.object["kpis"]["tracking_rms"]["value"] > 0


def test_absolute_path_is_taken_as_it_is(bywire, bench, ride, tmp_path):
    ride(RIDE)
    below = tmp_path / "below"
    below.mkdir()
    path = bench(f'{PEDAL}[options]\ntrace = "{tmp_path}/ride.csv"\n', name="below/bench.toml")
    assert bywire("run", path).status == 0


@pytest.mark.parametrize(
    ("text", "texts"),
    [
        ("", ["is empty (0 bytes)"]),
        (HEADER, ["too few rows", "at least two"]),
        (HEADER + "0,9\n", ["too few rows", "at least two"]),
        (HEADER + "0,9\n0.01,fast\n", ["line 3, column 'pedal'", "'fast' is not a finite number"]),
        (HEADER + "0,9\n0.01,\n", ["line 3, column 'pedal'", "blank or NaN"]),
        (HEADER + "0,9\n0.01,nan\n", ["line 3, column 'pedal'", "the value is missing"]),
        (HEADER + "0,9\n0.02,9\n0.01,9\n", ["line 4", "comes after", "Sort the rows"]),
        (HEADER + "0,9\n0.01,9\n0.01,9\n", ["line 4", "is repeated"]),
        (HEADER + "0,9\n0.01,9\n0.02,9\n2,9\n", ["line 5", "a gap of 1.98 s", "max_gap"]),
        ("time [s],pedal\n0,9\n1,9\n", ["column 'pedal'", "has no unit"]),
        (
            "time [s],pedal [bar]\n0,9\n0.01,9\n",
            ["column 'pedal'", "'bar'", "cannot be converted to m"],
        ),
        ("time [s],lever [mm]\n0,9\n0.01,9\n", ["none of its columns 'lever'", "pedal [mm]"]),
        ("clock [s],pedal [mm]\n0,9\n0.01,9\n", ["has no time column", "'time [s]'"]),
        ("0,9\n0.01,9\n", ["the columns '1, 2' have no names", "Add a first row"]),
        (b"time [s],pedal [m\x81]\n0,1\n", ["line 1", "neither UTF-8 nor cp1252"]),
        (bytes(200), ["contains something else"]),
        (HEADER + '0,"9\n0.01,9\n', ["quotation marks"]),
        ("time [s],pedal [mm]," + "x" * 200_000, ["line 1", "field limit"]),
    ],
    ids=lambda value: value[-1][:30] if isinstance(value, list) else "",
)
def test_doubtful_trace_gets_one_clear_line(bywire, ride, text, texts):
    outcome = bywire("run", ride(text), "--json")
    refused(outcome, *texts)
    assert "ride.csv" in outcome.err
    assert len(outcome.err) < 600


def test_other_columns_may_hold_anything(bywire, ride):
    rows = RIDE.replace("\n", ",dry\n").replace("[mm],dry", "[mm],road").replace("pedal", "Pedal")
    assert bywire("run", ride(rows)).status == 0


def test_gap_is_bridged_where_the_bench_says_so(bywire, ride):
    text = HEADER + "0,9\n0.01,9\n0.02,9\n0.5,9\n"
    assert bywire("run", ride(text, options='max_gap = "0.6 s"\n')).status == 0


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("none.csv", "No such file"),
        (".", "is not a file"),
        ("/dev/null/x", "Not a directory"),
        ("a\\u0000b", "null"),
        ("x" * 5000, "File name too long"),
    ],
)
def test_trace_that_cannot_be_read(bywire, bench, name, text):
    refused(bywire("run", bench(f'{PEDAL}[options]\ntrace = "{name}"\n')), text)


@pytest.mark.parametrize(
    ("column", "value", "texts"),
    [
        ("pedal [mm]", 46, ["pedal", "46 mm", "pedal.x_max = 45 mm"]),
        ("force [N]", 1e6, ["force", "1000 kN", "pedal.x_max = 45 mm"]),
    ],
)
def test_ride_beyond_the_stop_of_the_pedal_is_refused(bywire, ride, column, value, texts):
    path = ride(f"time [s],{column}\n0,9\n0.1,9\n0.2,{value}\n", options='max_gap = "1 s"\n')
    refused(bywire("run", path), "ride.csv", *texts)


def test_ride_up_to_the_stop_is_a_run_like_any_other(bywire, ride, tmp_path):
    path = ride(HEADER + "0,-9\n0.1,-9\n0.2,45\n", options='max_gap = "1 s"\n')
    assert bywire("run", path, "--out", tmp_path / "out").status == 0
    recording = package.read_recording(tmp_path / "out" / "run.nc")
    assert float(recording["p_ref"].max()) == pytest.approx(40e5)  # the end of the pedal map


def test_bench_file_given_as_a_trace(bywire, ride):
    refused(bywire("run", ride(PEDAL, name="other.toml")), "have no names")


def test_a_mapping_file_says_which_column_of_which_file_is_the_pedal(bywire, bench, tmp_path):
    travel = ("time", np.linspace(0.9, 2.4, 60), {"units": "1"})
    run = xr.Dataset({"lever": travel}, coords={"time": np.arange(60) * 5e-3})
    package.write_measurement(run, tmp_path / "ride.nc")
    (tmp_path / "map.toml").write_text('[signals.pedal]\ncolumn = "lever"\nscale = 10\nunit = "mm"')
    options = '[options]\ntrace = "ride.nc"\n'
    refused(bywire("run", bench(PEDAL + options)), "none of its columns 'lever'", "trace_map")
    outcome = bywire("run", bench(f'{PEDAL}{options}trace_map = "map.toml"\n'), "--json")
    assert outcome.status == 0, outcome.err
