"""Measured traces: what is read, and every way in which a file can be refused."""

import math

import numpy as np
import pytest
from measurement_files import FORMATS, NEEDS, file_of, measurement

from bywire.core.errors import FileError, ParameterError, UnitError
from bywire.data.measurement import read_trace, trace_names

HEADER = "time [s], pedal [mm]\n"
ROWS = "".join(f"{k / 100:.2f},1\n" for k in range(20))


def written(tmp_path, content):
    path = tmp_path / "pedal.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize(
    "content",
    [
        "time [s], pedal [mm]\n0, 1.5\n0.01, 2.5\n",
        "\ufeffTime (ms);Pedal (cm)\r\n0;0,15\r\n10;0,25\r\n;\r\n",
        't [s]\tnote\tpedal [m]\n0\t"a, b"\t1.5e-3\n\n0.01\t\t.0025\n',
    ],
)
def test_the_same_trace_in_three_dialects(tmp_path, content):
    trace = read_trace(written(tmp_path, content), {"pedal": "m"})
    np.testing.assert_allclose(trace["time"], [0.0, 0.01])
    np.testing.assert_allclose(trace["pedal"], [0.0015, 0.0025])
    assert trace["pedal"].dtype == np.float64
    assert (trace["pedal"].attrs["units"], trace["time"].attrs["units"]) == ("m", "s")
    assert trace.attrs == {"source": "pedal.csv", "format": "csv"}


def test_without_names_every_column_comes_in_si(tmp_path):
    content = (
        "time [s],p front [bar],T [Nm],n [rpm],share [%],x [-],F [kN]\n" + 2 * "{},1,1,1,1,1,1\n"
    )
    trace = read_trace(written(tmp_path, content.format(0, 1)))
    found = {str(name): (float(v[0]), v.attrs["units"]) for name, v in trace.data_vars.items()}
    assert found == {
        "p front": (1e5, "Pa"),
        "T": (1.0, "N*m"),
        "n": (pytest.approx(2 * math.pi / 60), "rad/s"),
        "share": (0.01, "1"),
        "x": (1.0, "1"),
        "F": (1000.0, "N"),
    }


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("", r"is empty \(0 bytes\)"),
        ("0,1\n1,2\n", "no column 'pedal' .*Its columns are 1, 2"),
        (HEADER + "0,1\n0.01,fast\n", "line 3, column 'pedal': 'fast' is not a finite number"),
        (HEADER + "0,1\n0.01,1_000\n", "line 3, column 'pedal': '1_000' is not a finite number"),
        (HEADER + "0,1\n0.01,1e999\n", "line 3, column 'pedal': '1e999' is not a finite number"),
        (HEADER + "0,1\n\n0.01,NaN\n", "line 4, column 'pedal': .*the value is missing"),
        (HEADER + "0,1\n0.01,\n0.02,1\n", "line 3, column 'pedal'"),
        (HEADER + "0,1\n0.02,1\n0.01,1\n", r"column 'time', line 4: 0\.01 s comes after 0\.02"),
        (HEADER + "0,1\n0.02,1\n0.02,1\n", "column 'time', line 4: 0.02 s is repeated"),
        (HEADER + "0,1,5\n", "line 2: 3 cells, but the first row has 2 .* semicolons"),
        (HEADER + '0,"1\n0.01,2\n', "line 2: .* quotation marks"),
        (HEADER + "0,1\n", r"too few rows \(1\)"),
        ("time [s];pedal [mm]\n0;1,5\n0.1;2\n", "line 3, column 'time': '0.1' mixes decimal"),
        ("time [s], pedl [mm]\n0,1\n1,2\n", r"no column 'pedal'.* Did you mean 'pedl'"),
        (
            "clock [s], pedal [mm]\n0,1\n1,2\n",
            "a column 'time",
        ),
        ("time [s], pedal [mm], Pedal [mm]\n0,1,1\n1,2,1\n", "two columns named 'pedal'"),
        (b"time [s], pedal [mm]\n0,1\n1,2\x81\n", "neither UTF-8 nor cp1252 .* Save it as UTF-8"),
    ],
)
def test_refused_files(tmp_path, content, text):
    path = written(tmp_path, content)
    with pytest.raises(FileError, match=text) as caught:
        read_trace(path, {"pedal": "m"})
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("title", "text"),
    [
        (
            "pedal",
            r"the column .pedal. has no unit. Write .* for example .pedal \[mm\]",
        ),
        ("pedal [N]", "'N' cannot be converted to m"),
        ("pedal [furlongs per beat]", "the unit 'furlongs' in .* is not known"),
        ("pedal [9**9**9**9]", "does not have the form of a unit"),
    ],
)
def test_refused_units(tmp_path, title, text):
    path = written(tmp_path, f"time [s], {title}\n0,1\n0.01,2\n")
    with pytest.raises(UnitError, match=f"pedal.csv.*{text}"):
        read_trace(path, {"pedal": "m"})


def test_revolutions_are_no_frequency(tmp_path):
    path = written(tmp_path, "time [s], f [rpm]\n0,60\n0.01,60\n")
    with pytest.raises(UnitError, match="cannot be converted to Hz"):
        read_trace(path, {"f": "Hz"})


def test_a_gap_is_refused_until_it_is_allowed(tmp_path):
    path = written(tmp_path, HEADER + ROWS + "0.8,1\n1.8,1\n")
    with pytest.raises(FileError) as caught:
        read_trace(path)
    message = str(caught.value)
    assert "line 22: a gap of 0.61 s after 0.19 s" in message
    allowed = message.rpartition('max_gap="')[2].rstrip('"')
    assert read_trace(path, max_gap=allowed).sizes["time"] == 22
    with pytest.raises(ParameterError, match="max_gap"):
        read_trace(path, max_gap="0 s")


def test_slow_and_short_pauses_are_no_gaps(tmp_path):
    slow = HEADER + "".join(f"{k},1\n" for k in range(5))
    assert read_trace(written(tmp_path, slow)).sizes["time"] == 5
    assert read_trace(written(tmp_path, HEADER + ROWS + "0.28,1\n")).sizes["time"] == 21


def test_what_is_no_file(tmp_path):
    with pytest.raises(FileError, match="cannot be read"):
        read_trace(tmp_path / "none.csv")
    with pytest.raises(FileError, match="is not a file"):
        read_trace(tmp_path)


@pytest.mark.parametrize("name", FORMATS)
def test_a_trace_may_be_any_measurement_file(tmp_path, name):
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    whole = measurement().isel(time=slice(20, None))
    path = file_of(tmp_path, name, whole)
    assert trace_names(path) == ("p_mc", "x_mc")
    trace = read_trace(path, {"X_MC": "m"})
    np.testing.assert_array_equal(trace["X_MC"], whole["x_mc"])
    np.testing.assert_array_equal(trace["time"], whole["time"])
    mapping = {"signals": {"push": {"column": "p_mc", "sign": -1, "delay": "10 ms"}}}
    pushed = read_trace(path, {"push": "Pa"}, mapping=mapping)
    np.testing.assert_array_equal(pushed["push"], -whole["p_mc"])
    np.testing.assert_allclose(pushed["time"], whole["time"] - 0.01)
    with pytest.raises(UnitError, match="'p_mc': 'Pa'"):
        read_trace(path, {"p_mc": "m"})
    holes = file_of(tmp_path, name)
    with pytest.raises(FileError, match="column 'p_mc'"):
        read_trace(holes, {"p_mc": "Pa"})


def test_a_text_table_is_one_whatever_its_name_ends_with(tmp_path):
    path = tmp_path / "pedal.dat"
    path.write_text(HEADER + ROWS)
    assert read_trace(path)["pedal"].size == 20


def test_columns_that_are_not_read_may_hold_what_they_like(tmp_path):
    rows = "".join(f"{k / 100:.2f};1;1.5 of {k};{k}\n".replace(".", ",", 1) for k in range(20))
    path = written(tmp_path, f"time [s];pedal [mm];note;\n{rows}")
    assert read_trace(path, {"pedal": "m"})["pedal"].size == 20
    versions = written(tmp_path, f"time [s];pedal [mm];version;\n{rows}".replace("1.5 of", "1."))
    assert read_trace(versions, {"pedal": "m"})["pedal"].size == 20
