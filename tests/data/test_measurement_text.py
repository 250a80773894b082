"""Text tables of other programs: dialects, units, what is refused, and the measured seal."""

import time
import tracemalloc
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bywire.core.errors import FileError, InputError, UnitError
from bywire.data.measurement import read_measurement

SEAL = Path(__file__).parents[3] / "shared" / "data" / "seal_friction" / "O-ring_5bar.csv"
PLAIN = {
    "time": {"column": 1, "unit": "ms"},
    "signals": {"x": {"column": 2, "unit": "mm"}, "p": {"column": 3, "unit": "bar"}},
}


def written(tmp_path, content, name="run.csv"):
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize(
    ("content", "mapping"),
    [
        ("time [s],x [mm],p [bar]\n0,1.5,20\n0.01,2.5,\n", None),
        ("\ufeffTime (ms);x (mm);p (bar)\r\n0;1,5;20\r\n10;2,5;NaN\r\n", None),
        ("t\tx\tp\n[ms]\t[mm]\t[bar]\n0\t1,5\t20\n10\t2,5\t\n", None),
        ("t;note;x;p\ns;;mm;bar\n0;a;1.5;20\n\n0.01;;2.5;\n", None),
        ("0\t1.5\t20\n10\t2.5\t\n", PLAIN),
        (
            '"0","1,5","20"\n"10","2,5",""\n'.replace(",", ";")
            .replace("1;5", "1,5")
            .replace("2;5", "2,5"),
            PLAIN,
        ),
        ("Rig 3, hot\nby night\n0,1.5,20,\n10,2.5,,\n", {**PLAIN, "skip_lines": 2}),
    ],
    ids=["plain", "commas", "units row", "text column", "no header", "quotes", "preamble"],
)
def test_the_same_measurement_in_many_dialects(tmp_path, content, mapping):
    chosen = ["x", "p"]
    if mapping is None and "note" in content:
        mapping = {"signals": {"x": {}, "p": {}}}
    found = read_measurement(written(tmp_path, content), mapping, signals=chosen)
    np.testing.assert_array_equal(found["time"], [0.0, 0.01])
    np.testing.assert_allclose(found["x"], [0.0015, 0.0025], rtol=1e-15)
    np.testing.assert_array_equal(found["p"], [20e5, np.nan])
    assert [found[n].attrs["units"] for n in ("time", "x", "p")] == ["s", "m", "Pa"]


def test_what_pandas_writes_is_read_exactly(tmp_path):
    rng = np.random.default_rng(3)
    values = rng.standard_normal((500, 3)) * 10.0 ** rng.integers(-200, 200, (500, 3))
    time = np.cumsum(rng.uniform(0.5, 1.5, 500))
    frame = pd.DataFrame({"t [s]": time, **{f"c{k} [Pa]": values[:, k] for k in range(3)}})
    frame.to_csv(tmp_path / "a.csv", index=False)
    found = read_measurement(tmp_path / "a.csv", signals=["c2", "c0"])
    np.testing.assert_array_equal(found["time"], time)
    np.testing.assert_array_equal(found["c2"], values[:, 2])
    np.testing.assert_array_equal(found["c0"], values[:, 0])


def test_blocks_join_where_they_were_cut(tmp_path, monkeypatch):
    rows = "".join(f"{k},{k * k}\n" for k in range(300))
    path = written(tmp_path, "t [s],x [m]\n" + rows)
    shares = []
    monkeypatch.setattr("bywire.data.formats.csv._BLOCK", 97)
    found = read_measurement(path, progress=lambda label, share: shares.append(share))
    np.testing.assert_array_equal(found["x"], np.arange(300.0) ** 2)
    assert len(shares) > 20
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_sign_scale_offset_and_delay_are_applied(tmp_path):
    path = written(tmp_path, "t [ms],u [V]\n0,1\n10,2\n20,3\n")
    signal = {"column": "u", "unit": "bar", "scale": 25.0, "sign": -1, "offset": "0.2 bar"}
    mapping = {"signals": {"p": {**signal, "delay": "1.2 ms", "limits": ["-80 bar", "0 bar"]}}}
    found = read_measurement(path, mapping)["p"]
    np.testing.assert_allclose(found, (-25.0 * np.array([1, 2, 3]) + 0.2) * 1e5, rtol=1e-14)
    np.testing.assert_allclose(found["time"], np.array([0.0, 10.0, 20.0]) * 1e-3 - 1.2e-3)
    assert found.attrs["delay"] == 1.2e-3
    assert (found.attrs["valid_min"], found.attrs["valid_max"]) == (-80e5, 0.0)


def test_signals_of_other_instants_have_their_own_dimension(tmp_path):
    path = written(tmp_path, "t,x,y,t2,z\n0,1,1,0,7\n1,2,2,5,8\n2,3,3,,\n")
    mapping = {
        "time": {"column": "t", "unit": "s"},
        "signals": {
            "x": {"unit": "m"},
            "y": {"unit": "m"},
            "z": {"unit": "m", "time": {"column": "t2", "unit": "s"}},
            "w": {"column": "x", "unit": "m", "rate": "10 Hz"},
        },
    }
    found = read_measurement(path, mapping)
    assert [found[n].dims for n in "xyzw"] == [("time",), ("time",), ("time_z",), ("time_w",)]
    np.testing.assert_array_equal(found["time_z"], [0.0, 5.0])
    np.testing.assert_array_equal(found["z"], [7.0, 8.0])
    np.testing.assert_allclose(found["time_w"], [0.0, 0.1, 0.2])


def test_a_rate_replaces_the_instants_of_the_file(tmp_path):
    path = written(tmp_path, "\ufeff1,7\n2,8\n3,9\n")
    mapping = {"rate": "2 Hz", "start": "1 s", "signals": {"x": {"column": 2, "unit": "m"}}}
    found = read_measurement(path, mapping)["x"]
    assert found["time"].values.tolist() == [1.0, 1.5, 2.0]
    path = written(tmp_path, "t [s],x [m]\n0,7\n1,8\n")
    assert list(read_measurement(path, {"rate": "2 Hz"}).data_vars) == ["x"]
    with pytest.raises(InputError, match="the same name as a time axis"):
        read_measurement(path, {"signals": {"time": {"column": "x"}}})


@pytest.mark.parametrize("header", ["T [K],time [s]", "T [K],t [s]", "time [s],T [K]"])
def test_a_temperature_is_no_time(tmp_path, header):
    rows = "300,0\n310,1\n" if header.startswith("T") else "0,300\n1,310\n"
    found = read_measurement(written(tmp_path, f"{header}\n{rows}"))
    assert found["T"].values.tolist() == [300.0, 310.0]
    assert found["time"].values.tolist() == [0.0, 1.0]


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("t [s],x [m]\n0,1\n1,2\n1,3\n", "line 4: 1 s is repeated"),
        ("t [s],x [m]\n0,1\n\n2,2\n1,3\n", "line 5: 1 s comes after 2"),
        ("t [s],x [m]\n0,1\n,2\n1,3\n", "line 3: nan s is not a time"),
        ("t [s],x [m]\n0,1\n1,fast\n", "line 3, column 'x': 'fast' is not a finite number"),
        ("t [s],x [m]\n0,1\n1,1e999\n", "line 3, column 'x': '1e999' is not a finite number"),
        ("t [s],x [m]\n0,1\n1\n", "line 3: 1 cell, but the first row has 2"),
        ("t [s],x [m]\n0,1\n1,2,3\n", "line 3: 3 cells, but the first row has 2"),
        ('t [s],x [m]\n0,1\n1,"2\n', "line 3: .*quotation marks"),
        ("t [s];x [m]\n0;1.5\n1;2,5\n", "mixes decimal comma and decimal point"),
        ("t [s],x [m]\n0,1\n", r"too few rows \(1\)"),
        ("x [m],y [m]\n0,1\n1,2\n", " Its columns are x, y"),
        (b"t [s],x [m]\n0,1\n1,2\xb5\n", "line 3, column 'x': '2µ' is not a finite number"),
        (b"Rig 3\nt [s],x [m]\n0,0,1,5\n0,1,1,6\n", "commas separate the columns and are also"),
        (b"", r"is empty \(0 bytes\)"),
    ],
)
def test_doubtful_tables_are_refused_with_the_place(tmp_path, content, text):
    path = written(tmp_path, content)
    with pytest.raises(FileError, match=text) as caught:
        read_measurement(path)
    assert str(path) in str(caught.value)


def test_a_column_without_a_unit_is_refused(tmp_path):
    path = written(tmp_path, "t [s],x\n0,1\n1,2\n")
    with pytest.raises(UnitError, match=r"the column 'x' has no unit.*\[signals\.x\] unit"):
        read_measurement(path)


def test_a_decimal_mark_that_the_head_does_not_show_can_be_given(tmp_path):
    rows = "".join(f"{k};{k}\n" for k in range(300)) + "300;300,5\n"
    path = written(tmp_path, "t [s];x [m]\n" + rows)
    with pytest.raises(InputError, match=r"'300,5' .* decimal mark is '.'"):
        read_measurement(path)
    assert float(read_measurement(path, {"decimal": ","})["x"][-1]) == 300.5


@pytest.mark.skipif(not SEAL.exists(), reason="the measured seal is not there")
def test_the_measured_seal_is_read_as_numpy_reads_it():
    mapping = {
        "time": {"column": 1, "unit": "ms"},
        "signals": {"x": {"column": 5, "unit": "mm"}, "F": {"column": 7, "unit": "N"}},
    }
    found = read_measurement(SEAL, mapping)
    plain = np.loadtxt(SEAL)
    np.testing.assert_allclose(found["time"], 1e-3 * plain[:, 0], rtol=1e-15)
    np.testing.assert_allclose(found["x"], 1e-3 * plain[:, 4], rtol=1e-15)
    np.testing.assert_array_equal(found["F"], plain[:, 6])


@pytest.mark.parametrize("flaw", ["quoted", "blank lines", "bare separators"])
def test_a_table_with_flaws_takes_little_memory(tmp_path, flaw):
    """Cell by cell it took ten times the memory of its numbers, and half a minute for 46 MB."""
    path, count = tmp_path / "a.csv", 400_000
    cell = '"{:.6f}"' if flaw == "quoted" else "{:.6f}"
    rows = [f"{1e-3 * k:.3f},{cell.format(0.5 * k)}" for k in range(count)]
    if flaw == "blank lines":
        rows[::1000] = [f"{row}\n" for row in rows[::1000]]
    elif flaw == "bare separators":
        rows[-1] += ","
    path.write_text("\n".join(["time [s],y [m]", *rows]) + "\n")
    read_measurement(path)  # what it takes the first time is the libraries'
    tracemalloc.start()
    started = time.process_time()
    found = read_measurement(path)
    seconds = time.process_time() - started
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    np.testing.assert_array_equal(found["y"], 0.5 * np.arange(count))
    size = sum(variable.nbytes for variable in found.variables.values())
    assert most < 5 * size + 2 * path.stat().st_size  # with a block of text
    assert seconds < 5.0


@pytest.mark.parametrize("cell", ['"1"2', '1"2', '"1', '"1,5"'])
def test_quotation_marks_that_are_none_are_refused(tmp_path, cell):
    path = tmp_path / "a.csv"
    rows = [f'{k},"{k}"' for k in range(50)]
    rows[20] = f"20,{cell}"
    path.write_text("\n".join(["time [s],y [m]", *rows]) + "\n")
    with pytest.raises(FileError, match="line "):
        read_measurement(path)


def test_a_text_over_several_lines_is_no_number_of_ours(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f'{k},{k},"said"' for k in range(30_000)]
    rows[14_000] = '14000,14000,"said\nin two lines"'
    path.write_text("\n".join(["time [s],y [m],note [1]", *rows]) + "\n")
    found = read_measurement(path, {"signals": {"y": {}}})
    np.testing.assert_array_equal(found["y"], np.arange(30_000.0))
