"""Files of Simulink, dSPACE, and MDF recorders: structs, rows, codes; and what is not read."""

from __future__ import annotations

import re
import struct
import subprocess
import sys

import numpy as np
import pytest
from measurement_files import file_of
from scipy.io import savemat

from bywire.core.child_process import environment, python_command
from bywire.core.errors import FileError
from bywire.data import limited_source
from bywire.data.measurement import read_with_notes

TIME = np.arange(100) * 0.01
FIRST, SECOND = np.sin(TIME), np.cos(TIME)


def structs(fields):
    """Return an array of structs as MATLAB has it."""
    names = list(fields[0])
    array = np.empty((1, len(fields)), dtype=[(name, object) for name in names])
    for k, each in enumerate(fields):
        array[0, k] = tuple(each[name] for name in names)
    return array


def scope(second):
    return {
        "time": TIME[:, None],
        "signals": structs(
            [
                {"values": FIRST[:, None], "dimensions": 1, "label": "p_mc [bar]"},
                {"values": second, "dimensions": 1, "label": ""},
            ]
        ),
        "blockName": "a/Scope",
    }


def recorder():
    return {
        "X": structs(
            [
                {"Name": "time", "Data": TIME[None, :], "Unit": "ms"},
                {"Name": "slow", "Data": 2 * TIME[None, ::2], "Unit": "s"},
            ]
        ),
        "Y": structs(
            [
                {"Name": "Model Root/p_mc", "Data": FIRST[None, :], "Unit": "bar", "XIndex": 1},
                {"Name": "Model Root/T", "Data": SECOND[None, ::2], "Unit": "degC", "XIndex": 2},
            ]
        ),
    }


def test_a_simulink_structure_with_time(tmp_path):
    table = np.stack([SECOND, 2 * SECOND], axis=1)
    savemat(tmp_path / "a.mat", {"log": scope(table)})
    mapping = {
        "signals": {
            "p_mc": {},
            "q": {"column": "log.signals(2).values(:,2)", "unit": "V"},
            "p": {"column": "log.signals(1).values"},
        }
    }
    found, _ = read_with_notes(tmp_path / "a.mat", mapping)
    np.testing.assert_array_equal(found["time"], TIME)
    np.testing.assert_allclose(found["p_mc"], 1e5 * FIRST, rtol=1e-15)
    np.testing.assert_allclose(found["p"], 1e5 * FIRST, rtol=1e-15)
    np.testing.assert_array_equal(found["q"], 2 * SECOND)


def test_a_dspace_recording(tmp_path):
    savemat(tmp_path / "a.mat", {"rec1_001": recorder()})
    found, notes = read_with_notes(tmp_path / "a.mat")
    assert notes == ()
    assert set(found.data_vars) == {"p_mc", "T"}
    np.testing.assert_allclose(found["p_mc"], 1e5 * FIRST, rtol=1e-15)
    np.testing.assert_allclose(found[found["p_mc"].dims[0]], 1e-3 * TIME, rtol=1e-15)
    np.testing.assert_allclose(found["T"], SECOND[::2] + 273.15)
    np.testing.assert_array_equal(found[found["T"].dims[0]], 2 * TIME[::2])
    assert found["T"].attrs["long_name"] == "Model Root/T"


@pytest.mark.parametrize("rows", [2, 5, 64])
def test_rows_as_to_file_writes_them(tmp_path, rows):
    savemat(tmp_path / "a.mat", {"ans": np.stack([TIME, *(k * FIRST for k in range(1, rows))])})
    last = {"signals": {"y": {"column": f"ans({rows},:)", "unit": "m"}}}
    found, notes = read_with_notes(tmp_path / "a.mat", last)
    np.testing.assert_array_equal(found["time"], TIME)
    np.testing.assert_array_equal(found["y"], (rows - 1) * FIRST)
    assert "so bywire reads it as time in s" in notes[0]
    savemat(tmp_path / "a.mat", {"ans": np.stack([FIRST * 0, SECOND])})
    with pytest.raises(FileError, match="has no time column"):
        read_with_notes(tmp_path / "a.mat", {"signals": {"y": {"column": "ans(2,:)", "unit": "m"}}})


def test_a_series_as_a_struct_and_what_is_left_out(tmp_path):
    savemat(
        tmp_path / "a.mat",
        {
            "ts": {"Time": TIME, "Data": FIRST, "Name": "p"},
            "cells": np.array(["a", "bb"], dtype=object),
            "cube": np.ones((3, 4, 5)),
            "wide": np.ones((100, 100)),
        },
    )
    with pytest.raises(FileError, match="it has 3 dimensions"):
        read_with_notes(tmp_path / "a.mat", {"signals": {"c": {"column": "cube", "unit": "m"}}})
    found, _ = read_with_notes(tmp_path / "a.mat", {"signals": {"ts": {"unit": "bar"}}})
    np.testing.assert_array_equal(found["time"], TIME)
    np.testing.assert_allclose(found["ts"], 1e5 * FIRST)


def written73(path, fill):
    """Write an HDF5 file with MATLAB's block in front."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        fill(h5py, file)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(116) + bytes(8) + b"\x00\x02IM")


def test_structs_and_objects_of_version_7_3(tmp_path):
    def fill(h5py, file):
        refs, log = file.create_group("#refs#"), file.create_group("log")
        log["time"] = TIME[None, :]
        signals = log.create_group("signals")
        for field, items in {
            "values": [FIRST[None, :], np.stack([SECOND, 2 * SECOND])],
            "label": ["p_mc [bar]", "u"],
        }.items():
            array = signals.create_dataset(field, (2, 1), dtype=h5py.ref_dtype)
            for k, item in enumerate(items):
                is_text = isinstance(item, str)
                data = np.frombuffer(item.encode("utf-16-le"), "<u2")[:, None] if is_text else item
                made = refs.create_dataset(f"{field}{k}", data=data)
                made.attrs["MATLAB_class"] = np.bytes_("char" if is_text else "double")
                array[k, 0] = made.ref
        file["ans"] = np.stack([TIME, 3 * FIRST]).T
        series = file.create_dataset("ts", data=np.zeros((1, 6), np.uint32))
        series.attrs["MATLAB_class"], series.attrs["MATLAB_object_decode"] = (
            np.bytes_("timeseries"),
            3,
        )

    path = tmp_path / "a.mat"
    written73(path, fill)
    mapping = {
        "signals": {
            "p_mc": {},
            "u": {"column": "u(:,2)", "unit": "V"},
            "y": {"column": "ans(2,:)", "unit": "m"},
        }
    }
    found, _ = read_with_notes(path, mapping)
    np.testing.assert_allclose(found["p_mc"], 1e5 * FIRST, rtol=1e-15)
    np.testing.assert_array_equal(found["u"], 2 * SECOND)
    np.testing.assert_array_equal(found["y"], 3 * FIRST)
    with pytest.raises(FileError, match=r"'ts' .*object.* t = ts\.Time and y = ts\.Data"):
        read_with_notes(path, {"signals": {"a": {"column": "ts", "unit": "m"}}})


CODES = {
    "a code": {"val_0": 65535, "text_0": "SNA"},
    "a range": {"lower_0": 60000, "upper_0": 65535, "text_0": "invalid"},
    "two codes": {"val_0": 65534, "text_0": "error", "val_1": 65535, "text_1": "SNA"},
}


def mdf(path, raw, conversion, unit, **more):
    asammdf = pytest.importorskip("asammdf")
    convert = asammdf.blocks.conversion_utils.from_dict
    with asammdf.MDF(version="4.10") as file:
        file.append(
            [
                asammdf.Signal(
                    raw, TIME, name="p", unit=unit, conversion=convert(conversion), **more
                ),
                asammdf.Signal(
                    raw.astype(float),
                    TIME,
                    name="f",
                    unit="V",
                    conversion=convert({"formula": "X1*2"}),
                ),
                asammdf.Signal(np.array([b"on"] * 100), TIME, name="text", encoding="utf-8"),
            ]
        )
        file.save(path, compression=2)
    return path


@pytest.mark.parametrize("codes", CODES)
def test_codes_with_a_text_are_no_pressures(tmp_path, codes):
    raw = np.arange(100, dtype=np.uint16)
    raw[50], raw[70] = 65535, 65534
    conversion = {**CODES[codes], "default_addr": {"a": 0.1, "b": -40.0}}
    found, notes = read_with_notes(mdf(tmp_path / "a.mf4", raw, conversion, "bar"))
    wanted = 1e5 * (0.1 * raw - 40.0)
    wanted[[50] if codes == "a code" else [50, 70]] = np.nan
    np.testing.assert_allclose(found["p"], wanted, rtol=1e-12)
    assert any(note.startswith("p: missing samples: ") for note in notes)
    assert any("'f'. Reason: a formula converts it" in note for note in notes)
    assert any("'text'. Reason: it contains text" in note for note in notes)


def test_states_keep_their_numbers_and_lack_only_what_was_not_there(tmp_path):
    raw = (np.arange(100) % 5).astype(np.uint8)
    raw[7] = 15
    texts = {
        "val_0": 0,
        "text_0": "P",
        "val_1": 1,
        "text_1": "R",
        "val_2": 2,
        "text_2": "N",
        "val_3": 3,
        "text_3": "D",
        "val_4": 15,
        "text_4": "SNA",
    }
    found, notes = read_with_notes(mdf(tmp_path / "a.mf4", raw, texts, ""), {"signals": {"p": {}}})
    wanted = raw.astype(float)
    wanted[7] = np.nan
    np.testing.assert_array_equal(found["p"], wanted)
    assert notes == ("p: missing samples: 1 (1 x 'SNA')",)


def test_samples_that_are_marked_as_invalid_are_counted(tmp_path):
    raw = np.arange(100, dtype=np.uint16)
    path = mdf(tmp_path / "a.mf4", raw, {"a": 1.0, "b": 0.0}, "V", invalidation_bits=raw > 96)
    found, notes = read_with_notes(path, {"signals": {"p": {}}})
    assert int(np.isnan(found["p"]).sum()) == 3
    assert notes == ("p: missing samples: 3 (3 x 'marked as invalid')",)


@pytest.mark.parametrize(
    ("name", "head", "text"),
    [
        ("a.tdms", b"TDSm\x0e", "TDMS file.*it as CSV or LVM"),
        ("a.csv", b"TDSm\x0e", "TDMS file"),
        ("a.blf", b"LOGG", "BLF file.*Export its signals as MDF 4"),
        ("a.xlsx", b"PK\x03\x04", r"ZIP archive \(like \.xlsx and \.ods\).*'CSV UTF-8'"),
        ("a.xls", b"\xd0\xcf\x11\xe0", "Excel workbook"),
        ("a.asc", b"date Mon\nbase hex\n", "log of bus messages"),
        ("a.mat", bytes(4), "MAT file of version 4, save it with '-v7'"),
        ("a.csv.gz", b"\x1f\x8b", "Unpack it first"),
    ],
)
def test_what_is_recognized_and_not_read_is_named_with_the_way_out(tmp_path, name, head, text):
    path = tmp_path / name
    path.write_bytes(head + (bytes(60) if b"\n" not in head else b""))
    with pytest.raises(FileError, match=text):
        read_with_notes(path)


UNDER_A_LIMIT = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (3 * 2**30,) * 2)  # below what a child would be allowed
from bywire.core.errors import FileError
from bywire.data import limited_source
from bywire.data.measurement import read_with_notes
print(read_with_notes(sys.argv[1])[0]["p_mc"].size)
limited_source._close_all()
limited_source.address_space = lambda: 2**27
limited_source.MOST_MEMORY = 2**16
try:
    read_with_notes(sys.argv[1])
except FileError as error:
    print(error)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory")
def test_a_limit_of_address_space_is_no_obstacle_or_is_named_at_once(tmp_path):
    """In a process of its own: this one may hold more than the limit already."""
    path = file_of(tmp_path, "netcdf")
    command = python_command("-c", UNDER_A_LIMIT, str(path))
    done = subprocess.run(
        command, env=environment(), capture_output=True, text=True, timeout=30, check=False
    )
    size, message = done.stdout.splitlines()
    assert size == "400"
    assert re.search(r"limited to 0\.125 GiB .ulimit -v.*raise the limit", message)


@pytest.mark.skipif(sys.platform != "linux", reason="limits of time")
def test_a_damaged_heap_is_refused_by_the_time_that_opening_may_take(tmp_path, monkeypatch):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["t"] = TIME
        file["t"].attrs["units"] = "s"
    content = bytearray(path.read_bytes())
    heap = content.index(b"GCOL")
    struct.pack_into("<Q", content, heap + 24, 0)  # an object of no size, before which it turns
    path.write_bytes(content)
    from bywire.data.formats import mat73

    assert mat73.FORMAT.opening == 10.0
    with (
        pytest.raises(FileError, match=r"opening made no progress for 1 s|is damaged"),
        limited_source.limited(path, mat73.FORMAT, 1.0),
    ):
        pass
