"""Measured traces: what is read, and every way in which a file can be refused."""

import math

import numpy as np
import pytest

from bywire.core.errors import FileError, ParameterError, UnitError
from bywire.data.trace import read_trace

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
    assert trace.attrs == {"source": "pedal.csv"}


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
        ("", "is empty: it needs a first row"),
        ("0,1\n1,2\n", "line 1: '0,1' holds no names .* add a first row"),
        (HEADER + "0,1\n0.01,fast\n", "line 3, column 'pedal': 'fast' is not a number"),
        (HEADER + "0,1\n0.01,1_000\n", "line 3, column 'pedal': '1_000' is not a number"),
        (HEADER + "0,1\n0.01,1e999\n", "line 3, column 'pedal': '1e999' is not a number"),
        (HEADER + "0,1\n\n0.01,NaN\n", "line 4, column 'pedal': 'NaN' is no measured value"),
        (HEADER + "0,1\n0.01,\n0.02,1\n", "line 3, column 'pedal': the cell is blank"),
        (HEADER + "0,1\n0.02,1\n0.01,1\n", "line 4, column 'time': 0.01 s comes after 0.02 s"),
        (HEADER + "0,1\n0.02,1\n0.02,1\n", "line 4, column 'time': 0.02 s is repeated in line 3"),
        (HEADER + "0,1,5\n", "line 2: 3 cells, but the header has 2 .* semicolons"),
        (HEADER + '0,"1\n0.01,2\n', "line 2: .* quotation marks"),
        (HEADER + "0,1\n", "too few rows of numbers, 1"),
        ("time [s];pedal [mm]\n0;1,5\n0.1;2\n", "line 3, column 'time': '0.1' mixes decimal"),
        ("time [s], pedl [mm]\n0,1\n1,2\n", r"no column 'pedal'.* is it 'pedl'.*'pedal \[mm\]'"),
        ("clock [s], pedal [mm]\n0,1\n1,2\n", r"no column 'time' among .* add 'time \[s\]'"),
        ("time [s], pedal [mm], Pedal [mm]\n0,1,1\n1,2,1\n", "'Pedal': the name stands twice"),
        (b"time [s], pedal [mm]\n0,1\n1,2 \xb5\n", "line 3: the byte 0xb5 is not UTF-8: save"),
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
        ("pedal", r"'pedal': it has no unit: write for instance 'pedal \[mm\]'"),
        ("pedal [N]", "'N' has the wrong unit, it cannot be m"),
        ("pedal [furlongs per beat]", "is no known unit"),
        ("pedal [9**9**9**9]", "is no known unit"),
    ],
)
def test_refused_units(tmp_path, title, text):
    path = written(tmp_path, f"time [s], {title}\n0,1\n0.01,2\n")
    with pytest.raises(UnitError, match=f"line 1, column .*{text}"):
        read_trace(path, {"pedal": "m"})


def test_revolutions_are_no_frequency(tmp_path):
    path = written(tmp_path, "time [s], f [rpm]\n0,60\n0.01,60\n")
    with pytest.raises(UnitError, match="cannot be Hz"):
        read_trace(path, {"f": "Hz"})


def test_a_gap_is_refused_until_it_is_allowed(tmp_path):
    path = written(tmp_path, HEADER + ROWS + "0.8,1\n1.8,1\n")
    with pytest.raises(FileError) as caught:
        read_trace(path)
    message = str(caught.value)
    assert "line 22, column 'time': a gap of 0.61 s after 0.19 s" in message
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
