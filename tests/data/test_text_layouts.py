"""Text files as programs write them: what stands before the table, marks, times, encodings."""

from __future__ import annotations

import numpy as np
import pytest

from bywire.core.errors import FileError, InputError, ParameterError, UnknownNameError
from bywire.data.mapping import mapping_from
from bywire.data.measurement import MeasurementWarning, read_measurement, read_with_notes

TIME = np.arange(40) * 0.01
PRESSURE = np.round(np.linspace(1.0, 9.0, 40), 3)
BY_NUMBER = {"time": {"column": 1, "unit": "s"}, "signals": {"p": {"column": 2, "unit": "bar"}}}


def rows(separator=",", number="{:.3f}", time=None):
    instants = [number.format(t) for t in TIME] if time is None else time
    return "".join(
        f"{t}{separator}{number.format(p)}\n" for t, p in zip(instants, PRESSURE, strict=True)
    )


def german(number):
    return f"{number:.3f}".replace(".", ",")


def lvm(columns, body, extra=""):
    head = [
        "LabVIEW Measurement\t",
        "Separator\tTab",
        "Decimal_Separator\t.",
        "Multi_Headings\tNo",
        f"X_Columns\t{columns}",
        "Date\t2026/11/26",
        "***End_of_Header***\t",
        "\t",
        "Channels\t2\t\t",
        "Samples\t40\t40\t",
        "Y_Unit_Label\tbar\tVolts\t",
        "X_Dimension\tTime\tTime\t",
        "X0\t0.0\t0.0\t",
        "Delta_X\t0.01\t0.01\t",
        "***End_of_Header***\t\t\t",
        *([extra] if extra else []),
    ]
    return "\n".join([*head, *body]) + "\n"


VBO = (
    "File created on 26/11/2026\n\n[header]\nsatellites\ntime\nvelocity kmh\np\n\n"
    "[channel units]\nbar\n\n"
    "[comments]\nVBOX\n\n[column names]\nsats time velocity p\n\n[data]\n"
) + "".join(
    f"012 {235959.7 + t if t < 0.295 else t - 0.3:010.3f} +036.000 {p:+.3E}\n"
    for t, p in zip(TIME, PRESSURE, strict=True)
)
HEADER = "t [s],p [bar]\n"
LAYOUTS = {
    "comments before": ("# run 7, rig 3\n# operator x\n" + HEADER + rows(), None),
    "comment as titles": ("# t [s],p [bar]\n" + rows(), None),
    "comments within": (HEADER + rows().replace("0.200,", "# brake released\n0.200,"), None),
    "preamble": ("Rig 3\nby night; hot\n\n" + HEADER + rows(), None),
    "preamble as wide as the table": (
        "Rig 3;27.11.2026\nt [s];p [bar]\n" + rows(";").replace(".", ","),
        None,
    ),
    "preamble as wide as the table, units below": (
        "Rig 3;27.11.2026\nt;p\ns;bar\n" + rows(";").replace(".", ","),
        None,
    ),
    "preamble of pairs": ("Operator;X\nRig;A\nt [s];p [bar]\n" + rows(";"), None),
    "sep line": ("sep=;\nt [s];p [bar]\n" + rows(";").replace(".", ","), None),
    "blanks": ("t [s]   p [bar]\n" + rows("    "), None),
    "blanks, aligned": (
        "  t      p\n  s    bar\n"
        + "".join(f"  {t:8.3f} {p:9.3f}\n" for t, p in zip(TIME, PRESSURE, strict=True)),
        None,
    ),
    "blanks and commas": ("t [s] p [bar]\n" + rows("  ").replace(".", ","), None),
    "units below, blank line": ("Time,p\n(s),(bar)\n\n" + rows(), None),
    "no titles": (rows(), BY_NUMBER),
    "numbers of columns": (HEADER + rows(), BY_NUMBER),
    "titles that are numbers": ("10,20\n" + rows(), {**BY_NUMBER, "titles": True}),
    "clock": (
        "time,p [bar]\n" + rows(time=[f"09:12:33.{500 + 10 * k:03d}" for k in range(40)]),
        None,
    ),
    "midnight": (
        "Zeit;p [bar]\n"
        + rows(
            ";",
            time=[
                f"23:59:59.{800 + 10 * k}" if k < 20 else f"00:00:00.{10 * (k - 20):03d}"
                for k in range(40)
            ],
        ),
        None,
    ),
    "clock, decimal commas": (
        "Zeit;p [bar]\n"
        + "".join(f"09:12:33,{10 * k:03d};{german(p)}\n" for k, p in enumerate(PRESSURE)),
        None,
    ),
    "ISO": (
        "time,p [bar]\n" + rows(time=[f"2026-11-26T09:12:33.{10 * k:03d}Z" for k in range(40)]),
        None,
    ),
    "German dates": (
        "Datum;p [bar]\n"
        + rows(";", time=[f"26.11.2026 09:12:33,{10 * k:03d}" for k in range(40)]),
        {"time": "Datum"},
    ),
    "date and time": (
        "Date;Time;p [bar]\n"
        + "".join(
            f"{day};{clock};{p:.3f}\n"
            for day, clock, p in zip(
                ["2026-11-30"] * 20 + ["2026-12-01"] * 20,
                [f"23:59:59.{800 + 10 * k}" for k in range(20)]
                + [f"00:00:00.{10 * k:03d}" for k in range(20)],
                PRESSURE,
                strict=True,
            )
        ),
        None,
    ),
    "LVM": (
        lvm(
            "One",
            [
                "X_Value\tp\tu\tComment",
                *(f"{t:.3f}\t{p:.3f}\t1" for t, p in zip(TIME, PRESSURE, strict=True)),
            ],
        ),
        None,
    ),
    "LVM, every X": (
        lvm(
            "Multi",
            [
                "X_Value\tp\tX_Value\tu\tComment",
                *(f"{t:.3f}\t{p:.3f}\t{t:.3f}\t1" for t, p in zip(TIME, PRESSURE, strict=True)),
            ],
        ),
        None,
    ),
    "LVM, no X": (lvm("No", ["p\tu\tComment", *(f"{p:.3f}\t1" for p in PRESSURE)]), None),
    "VBOX": (VBO, None),
    "text column": ("t [s],note,p [bar]\n" + rows(",a,"), None),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_same_measurement_in_every_layout(tmp_path, layout):
    content, mapping = LAYOUTS[layout]
    path = tmp_path / f"run{'.lvm' if 'LVM' in layout else '.vbo' if layout == 'VBOX' else '.txt'}"
    path.write_text(content, encoding="utf-8")
    found, _ = read_with_notes(path, mapping)
    time = found[found["p"].dims[0]].values
    np.testing.assert_allclose(time - time[0], TIME, atol=1e-9)
    np.testing.assert_allclose(found["p"], 1e5 * PRESSURE, rtol=1e-14)
    if "LVM" in layout:
        np.testing.assert_array_equal(found["u"], np.ones(40))


@pytest.mark.parametrize(
    ("content", "note"),
    [
        (
            "# rig\n" + HEADER + rows(),
            "line 1 .'# rig'. before the table",
        ),
        (
            "t [s],10\n" + rows(),
            "line 1 as column titles although it contains numbers .'10'.. Set titles = false",
        ),
        (
            HEADER + rows().replace("0.200,", "# x\n0.200,"),
            "comment lines skipped: 1",
        ),
        ("t [s],note,p [bar]\n" + rows(",a,"), "not read: 'note'. Reason: it contains text"),
        (
            HEADER + rows().replace("0.100,", "0.100,OVLD\n0.105,"),
            "p: missing samples: 1 .1 x 'OVLD'",
        ),
        ("t [s],p [bar(a)]\n" + rows(), "absolute pressure"),
        (
            "time,p [bar]\n" + rows(time=[f"09:12:33.{10 * k:03d}" for k in range(40)]),
            "counts from the first row",
        ),
    ],
)
def test_what_was_left_out_or_guessed_is_noted(tmp_path, content, note):
    path = tmp_path / "a.csv"
    path.write_text(content)
    by_unit = (
        {"time": "t", "signals": {"p": {"column": 2, "unit": "bar"}}}
        if ",10\n" in content
        else None
    )
    with pytest.warns(MeasurementWarning, match=rf"^a\.csv: .*{note}"):
        read_measurement(path, by_unit)


MARKED = [
    "NA",
    "nan",
    "NaN",
    "N/A",
    "#N/A",
    "-",
    "--",
    "null",
    "Inf",
    "-inf",
    "∞",
    "OVLD",
    "9.9E37",
    "-9.90E+37",
    "9.91E37",
]


@pytest.mark.parametrize("quotes", ["", '"'])
@pytest.mark.parametrize("mark", MARKED)
def test_the_usual_marks_are_missing_values(tmp_path, mark, quotes):
    path = tmp_path / "a.csv"
    cells = [f"{p:.3f}" for p in PRESSURE]
    cells[3] = cells[30] = f"{quotes}{mark}{quotes}"
    path.write_text(
        HEADER + "".join(f"{t:.3f},{c}\n" for t, c in zip(TIME, cells, strict=True)),
        encoding="utf-8",
    )
    found, notes = read_with_notes(path)
    wanted = 1e5 * PRESSURE
    wanted[[3, 30]] = np.nan
    np.testing.assert_allclose(found["p"], wanted, rtol=1e-14)
    assert mark.lower() == "nan" or any("missing samples: 2" in note for note in notes)


def test_a_mapping_names_further_marks(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t [s],p [bar],q [bar]\n0,1,1\n1,off scale,-999\n2,-999,3\n3,32767,32767\n")
    mapping = {"missing": ["off scale", -999], "signals": {"p": {"missing": [32767]}, "q": {}}}
    found, notes = read_with_notes(path, mapping)
    np.testing.assert_allclose(found["p"], [1e5, np.nan, np.nan, np.nan])
    np.testing.assert_allclose(found["q"], [1e5, np.nan, 3e5, 32767e5])
    assert any(note.startswith("p: missing samples: 2 (1 x -999, 1 x 32767") for note in notes)
    with pytest.raises(
        FileError, match=r"'off scale' is not a finite number.*missing = \['off scale'\]"
    ):
        read_measurement(path)


@pytest.mark.parametrize(
    "encoding", ["utf-16", "utf-16-le", "utf-16-be", "cp1252", "latin-1", "utf-8-sig"]
)
def test_encodings(tmp_path, encoding):
    path = tmp_path / "a.csv"
    text = "Zeit;Druck;Öltemp\ns;bar;°C\n" + "".join(
        f"{german(t)};{german(p)};20,0\r\n" for t, p in zip(TIME, PRESSURE, strict=True)
    )
    path.write_bytes(text.encode(encoding))
    found, notes = read_with_notes(path)
    np.testing.assert_allclose(found["Druck"], 1e5 * PRESSURE, rtol=1e-14)
    np.testing.assert_allclose(found["Öltemp"], 293.15)
    is_windows = encoding in ("cp1252", "latin-1")
    assert [note for note in notes if "cp1252" in note] == list(notes)
    assert len(notes) == is_windows
    if is_windows:
        assert not read_with_notes(path, {"encoding": encoding})[1]


def test_a_remark_in_cp1252_far_below_the_head_is_read_with_the_note(tmp_path):
    path = tmp_path / "a.csv"
    rows = "".join(f"{t / 1000:.3f},{t % 7}\n" for t in range(40_000))
    path.write_bytes(f"t [s],p [bar]\n{rows}# Störung\n40.000,1\n".encode("cp1252"))
    found, notes = read_with_notes(path, signals=["p"])
    assert found["p"].size == 40_001
    assert found["p"].values[-1] == 1e5
    assert sum("cp1252" in note for note in notes) == 1


@pytest.mark.parametrize("byte", [0x01, 0x81])
def test_bytes_that_are_not_text_in_any_table_are_refused(tmp_path, byte):
    path = tmp_path / "a.csv"
    path.write_bytes(b"t [s],p [bar]\n0,1\n1,2\xb5" + bytes([byte]))
    with pytest.raises(FileError, match=r"line 3 is neither UTF-8 nor cp1252.*encoding = '"):
        read_measurement(path)


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (HEADER + "0,1\n1,2,3\n", "line 3: 3 cells, .*skip_lines in the mapping"),
        ("Time,p [bar]\n12:34,1\n12:35,2\n", "'Time'. Reason: its times or dates"),
        ("t;p\ns;foo\n0;1\n1;2\n", "Its columns are s, foo"),
        ("t;p;x\ns;bar;foo\n0;1;2\n1;2;3\n", "column 'x': the unit 'foo' is not known"),
        ("t [s] p [bar]\n0 1\n1\n", "line 3: 1 cell, .*use a mark such as nan"),
        ("Date,p [bar]\n03/04/2026,1\n03/04/2026,2\n", "'Date'. Reason: its times or dates"),
        ("time [s],p [bar]\n09:12:33.5,1\n9.7,2\n", "line 2, .*is a time stamp"),
        (
            lvm("One", ["X_Value\tp\tu", "0\t1\t1", "1\t2\t1", "Channels\t2"]),
            "another table begins here",
        ),
    ],
)
def test_doubtful_tables_are_refused(tmp_path, content, text):
    path = tmp_path / "a.txt"
    path.write_text(content)
    with pytest.raises(InputError, match=text):
        read_measurement(path)


@pytest.mark.parametrize(
    ("content", "kind", "text"),
    [
        ({"missing": [True]}, ParameterError, "missing = .* write strings and numbers"),
        ({"missing": {"a": 1}}, ParameterError, "missing = "),
        ({"titles": "no"}, ParameterError, "titles = 'no': it must be true"),
        (
            {"encoding": "cp1225"},
            UnknownNameError,
            "unknown encoding 'cp1225': did you mean 'cp1252'",
        ),
    ],
)
def test_refused_keys(content, kind, text):
    with pytest.raises(kind, match=text):
        mapping_from(content)


def test_a_number_of_a_column_goes_before_its_title(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t [s],3,2\n0,10,20\n1,11,21\n")
    signals = {
        "a": {"column": 3, "unit": "m"},
        "b": {"column": "3", "unit": "m"},
        "c": {"column": "1", "unit": "s"},
    }
    found, _ = read_with_notes(path, {"signals": signals})
    assert found["a"].values.tolist() == [20.0, 21.0]  # the third column
    assert found["b"].values.tolist() == [10.0, 11.0]  # the one that is called 3
    assert found["c"].values.tolist() == [0.0, 1.0]
    with pytest.raises(FileError, match=r"has no column 4 .*3 columns"):
        read_measurement(path, {"signals": {"a": {"column": 4, "unit": "m"}}})


def test_a_first_row_of_marks_is_no_row_of_titles_where_the_mapping_says_so(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("0,trigger\n1,5\n2,6\n")
    mapping = {**BY_NUMBER, "titles": False, "missing": ["trigger"]}
    found, notes = read_with_notes(path, mapping)
    np.testing.assert_array_equal(found["p"], [np.nan, 5e5, 6e5])
    assert notes == ("2: missing samples: 1 (1 x 'trigger')",)
    with pytest.warns(MeasurementWarning, match=r"titles although it contains numbers \('0'\)"):
        assert read_measurement(path, BY_NUMBER)["p"].size == 2
