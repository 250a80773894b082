"""A table stimulus from a file, relative to the bench file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import bywire
from bywire.bench.bench_file import bench_text
from bywire.core.errors import FileError, InputError, ParameterError, UnitError
from bywire.data.writing import write_measurement
from run_once import run_once

BENCH = """
experiment = "motor-open-loop"
parameters = "dardanelli2010"
[options]
duration = "0.3 s"
[stimulus]
kind = "table"
file = "current.csv"
"""


def written(folder: Path, table: str, more: str = "") -> Path:
    (folder / "current.csv").write_text(table)
    path = folder / "bench.toml"
    path.write_text(BENCH + more)
    return path


def test_nodes_come_from_the_file_and_time_from_its_first_row(tmp_path: Path) -> None:
    path = written(tmp_path, "time [s],current [mA]\n5.0,0\n5.1,500\n5.2,500\n")
    recording = run_once(bywire.load(path)).recording
    expected = np.interp(recording["time"].values, [0.0, 0.1, 0.2], [0.0, 0.5, 0.5])
    # The source holds its value over 0.1 ms.
    np.testing.assert_allclose(recording["i"].values, expected, atol=1e-3)


@pytest.mark.parametrize(
    ("table", "more", "kind", "words"),
    [
        ("time [s],a [A],b [A]\n0,1,2\n1,1,2\n", "", FileError, "several columns"),
        ("time [s],a [V]\n0,1\n0.1,1\n", "", UnitError, "cannot be converted to A"),
        ("time [s],a [A]\n0,1\n0.1,1\n", 'times = "0 s"', ParameterError, "either file, or"),
        ("time [s],a [A]\n0,1\n0.1,1\n", 'column = "b"', InputError, "b"),
    ],
)
def test_what_does_not_fit_is_refused(
    tmp_path: Path, table: str, more: str, kind: type[Exception], words: str
) -> None:
    with pytest.raises(kind, match=words):
        bywire.load(written(tmp_path, table, more))


def test_nodes_come_from_any_measurement_file(tmp_path: Path) -> None:
    columns = {
        "clock": ("time", [0.0, 100.0, 200.0], {"units": "ms"}),
        "motor": ("time", [0.0, 2.5, 2.5]),
    }
    numbers = xr.Dataset(columns, coords={"time": [0.0, 1.0, 2.0]})
    write_measurement(numbers, tmp_path / "run.nc")
    path = written(tmp_path, "")
    more = 'column = "MOTOR"\nunit = "A"\nscale = 0.2\nmax_gap = "1 s"\n'
    more += 'time = "clock"\ntime_unit = "ms"\n'
    path.write_text(BENCH.replace("current.csv", "run.nc") + more)
    bench = bywire.load(path)
    stimulus = bench.chosen_stimulus
    assert stimulus is not None
    level = stimulus.sample(np.array([0.0, 0.05, 0.1, 0.3]))
    np.testing.assert_allclose(level, [0.0, 0.25, 0.5, 0.5])
    path.write_text(bench_text(bench))
    again = bywire.load(path).chosen_stimulus
    assert again is not None
    assert again.parameters == stimulus.parameters


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('unit = "bra"', r"\[stimulus\] unit = 'bra': the unit 'bra' is not known"),
        ("column = true", r"\[stimulus\] column = true: write its title in quotation marks"),
        ('rate = "5 ms"', "rate = '5 ms' has the wrong unit"),
        ('tme = "t"', "tme"),
        ('column = "a"\nunit = "V"', "the mapping"),
    ],
)
def test_a_choice_that_makes_no_sense_is_refused(tmp_path: Path, more: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        bywire.load(written(tmp_path, "time [s],a [A]\n0,1\n0.1,1\n", more))
