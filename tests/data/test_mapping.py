"""Mappings: what is understood, and every key and value that is refused."""

import pytest

from bywire.core.errors import FileError, InputError, ParameterError, UnitError, UnknownNameError
from bywire.data.mapping import Clock, mapping_from, read_mapping
from bywire.data.measurement import read_measurement

FILE = """
format = "csv"
time = { column = "t", unit = "ms" }

[signals.p_mc]
column = "p_sensor"
unit = "bar"
scale = 1.0
sign = -1
offset = "0.2 bar"
delay = "1.2 ms"
"""


def signal(**keys):
    return {"signals": {"p": {"unit": "bar", **keys}}}


def test_a_mapping_file_means_what_it_says(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(FILE)
    found = read_mapping(path)
    assert (found.format, found.clock) == ("csv", Clock("t", "ms"))
    one = found.signals["p_mc"]
    assert (one.column, one.unit, one.scale, one.sign) == ("p_sensor", "bar", 1.0, -1)
    assert (one.offset, one.delay) == (0.2e5, 1.2e-3)


@pytest.mark.parametrize(
    ("content", "kind", "text"),
    [
        (
            {"formt": "csv"},
            UnknownNameError,
            "unknown key of a mapping 'formt': did you mean 'format'",
        ),
        (signal(colum="a"), UnknownNameError, r"\[signals.p\] 'colum': did you mean 'column'"),
        (signal(unit="bra"), UnitError, r"\[signals.p\] unit = .bra.: the unit .bra. is not known"),
        (signal(offset="2 mm"), UnitError, r"\[signals.p\] offset = '2 mm' has the wrong unit"),
        (signal(offset=2), UnitError, r"\[signals.p\] offset = 2 has the wrong unit.* '1.5 bar'"),
        (signal(delay="2 bar"), UnitError, r"\[signals.p\] delay = '2 bar' has the wrong unit"),
        (signal(sign=2), ParameterError, r"\[signals.p\] sign = 2: it must be 1 or -1"),
        (signal(sign=True), ParameterError, r"\[signals.p\] sign = true"),
        (signal(scale=0), ParameterError, r"\[signals.p\] scale = 0"),
        (signal(scale="2 mm"), UnitError, r"\[signals.p\] scale"),
        (
            signal(column=0),
            ParameterError,
            r"\[signals.p\] column = 0: .*or its number, counted from 1",
        ),
        (signal(limits=["1 bar", "0 bar"]), ParameterError, "the lower value first"),
        (signal(limits="1 bar"), ParameterError, r"\[signals.p\] limits"),
        (
            {"signals": {"p": {"offset": "1 bar"}}},
            UnitError,
            "offset needs",
        ),
        ({"signals": {"T": {"unit": "K", "offset": "1 degC"}}}, UnitError, "the difference in K"),
        ({"rate": "0 Hz"}, ParameterError, "rate = '0 Hz' must be > 0 Hz"),
        ({"rate": "5 ms"}, UnitError, "rate = '5 ms' has the wrong unit"),
        ({"time": {"unit": "s"}}, ParameterError, "needs either time or rate"),
        ({"time": {"column": "t", "rate": "1 Hz"}}, ParameterError, "needs either time or rate"),
        ({"time": {"column": "t", "unit": "mm"}}, UnitError, "is not a unit of time"),
        ({"signals": 3}, ParameterError, r"\[signals\] must be a section"),
        ({"decimal": ";"}, ParameterError, "decimal = ';'"),
        ({"skip_lines": -1}, ParameterError, "skip_lines = -1"),
    ],
)
def test_refused_mappings(content, kind, text):
    with pytest.raises(kind, match=text):
        mapping_from(content)


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"signals = [", "is not valid TOML"),
        (b"\xff\xfe", "is not UTF-8"),
        (b"a." * 50_000 + b"b = 1", "dotted key"),
        (b"x = " + b"[" * 5000, "nested|valid TOML"),
        (b"#" * 1_000_001, "larger than 1000 kB"),
        (b"formt = 'csv'", "map.toml: unknown key"),
    ],
)
def test_refused_mapping_files(tmp_path, content, text):
    path = tmp_path / "map.toml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=text) as caught:
        read_mapping(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("mapping", "kind", "text"),
    [
        (
            {"signals": {"q": {"column": "p_sensr"}}},
            FileError,
            r"no column 'p_sensr' \(signals.q.column\).*'p_sensor'\? Its columns are t,",
        ),
        (
            {"signals": {"p_sensor": {"unit": "MPa"}}},
            UnitError,
            "the mapping",
        ),
        ({"time": {"column": "clock", "unit": "s"}}, FileError, r"no column 'clock' \(time.col"),
        ({"time": {"column": "p_sensor"}}, UnitError, "'bar' is not a unit of time"),
        ({"format": "cvs"}, UnknownNameError, "unknown file format 'cvs': did you mean 'csv'"),
        (
            {"format": "mdf4"},
            FileError,
            "contains a text table, not an MDF file as format = 'mdf4'",
        ),
    ],
)
def test_mappings_that_do_not_fit_the_file(tmp_path, mapping, kind, text):
    path = tmp_path / "a.csv"
    path.write_text("t [s],p_sensor [bar]\n0,1\n1,2\n")
    with pytest.raises(kind, match=text):
        read_measurement(path, mapping)


def test_a_scale_overrules_the_unit_of_the_file(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t [s],u [V]\n0,1\n1,2\n")
    found = read_measurement(path, {"signals": {"p": {"column": "u", "unit": "bar", "scale": 2}}})
    assert found["p"].values.tolist() == [2e5, 4e5]
