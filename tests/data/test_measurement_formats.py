"""Every format: ours comes back exactly, and what other programs write is read exactly."""

import warnings

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from measurement_files import FORMATS, NEEDS, file_of, measurement, with_slow_signal
from scipy.io import loadmat, savemat

from bywire.core.errors import FileError, UnknownNameError
from bywire.data import limited_source
from bywire.data.file_format import ReadOptions
from bywire.data.format_registry import FORMATS as KNOWN
from bywire.data.measurement import MeasurementWarning, read_measurement
from bywire.data.writing import write_measurement

TIME = np.cumsum(np.random.default_rng(5).uniform(0.5, 1.5, 300)) * 1e-3
VALUES = np.random.default_rng(6).standard_normal(300)


@pytest.fixture(params=list(FORMATS))
def name(request):
    if request.param in NEEDS:
        pytest.importorskip(NEEDS[request.param])
    return request.param


def same(found, wanted):
    """Check that datasets hold the same signals to the last bit."""
    assert set(found.data_vars) == set(wanted.data_vars)
    for key, signal in wanted.data_vars.items():
        np.testing.assert_array_equal(found[key].values, signal.values)
        np.testing.assert_array_equal(
            found[found[key].dims[0]].values, wanted[signal.dims[0]].values
        )
        assert found[key].attrs["units"] == signal.attrs["units"]


def test_every_format_is_tested():
    assert set(KNOWN.all()) == set(FORMATS)


def test_ours_comes_back_exactly(tmp_path, name):
    found = read_measurement(file_of(tmp_path, name))
    same(found, measurement())
    assert found.attrs == {"source": f"run{FORMATS[name]}", "format": name}


def test_signals_on_other_instants(tmp_path, name):
    dataset = with_slow_signal(measurement())
    if KNOWN.all()[name].has_many_axes:
        same(read_measurement(file_of(tmp_path, name, dataset)), dataset)
    else:
        with pytest.raises(FileError, match=r"different times \(time, time_T\)"):
            file_of(tmp_path, name, dataset)
        assert not list(tmp_path.iterdir())


def test_one_signal_alone_is_read_by_the_rules_of_the_mapping(tmp_path, name):
    mapping = {"signals": {"p": {"column": "p_mc", "sign": -1, "delay": "1 ms"}}}
    found = read_measurement(file_of(tmp_path, name), mapping)
    np.testing.assert_array_equal(found["p"], -measurement()["p_mc"].values)
    np.testing.assert_allclose(found["time"], measurement()["time"] - 1e-3, rtol=1e-12)
    with pytest.raises(FileError, match=r"no column 'p_cm'.*Did you mean 'p_mc'"):
        read_measurement(file_of(tmp_path, name), {"signals": {"p": {"column": "p_cm"}}})


def test_more_than_may_be_read_is_refused_first(tmp_path, name):
    path = file_of(tmp_path, name)
    if name in ("csv", "tsv"):
        return  # only reading tells how much there is
    with pytest.raises(FileError, match="Read fewer signals"):
        read_measurement(path, largest=1000)


def test_the_ending_must_not_lie(tmp_path, name):
    path = file_of(tmp_path, name)
    lie = tmp_path / ("lie.csv" if name not in ("csv", "tsv") else "lie.parquet")
    path.rename(lie)
    with pytest.raises(FileError, match="Rename it, or specify format"):
        read_measurement(lie)
    same(read_measurement(lie, {"format": name}), measurement())


def test_missing_library_names_the_extra(tmp_path, name, monkeypatch):
    if name not in NEEDS:
        return
    path = file_of(tmp_path, name)

    monkeypatch.setattr(limited_source, "find_spec", lambda name: None)
    with pytest.raises(FileError, match=rf"{NEEDS[name]}.*'\.\[measurements\]'"):
        read_measurement(path)


def test_files_are_not_replaced_unasked(tmp_path):
    path = file_of(tmp_path, "csv")
    with pytest.raises(FileError, match="already exists"):
        write_measurement(measurement(), path)
    with pytest.raises(FileError, match=r"not a known file extension. Use \.csv"):
        write_measurement(measurement(), tmp_path / "a.xyz")
    with pytest.raises(UnknownNameError, match="did you mean 'mdf4'"):
        write_measurement(measurement(), tmp_path / "a.x", format="mdf")
    with pytest.raises(FileError, match="'p mc' is not a valid variable name in MATLAB"):
        write_measurement(measurement().rename(p_mc="p mc"), tmp_path / "a.mat")
    assert [one.name for one in tmp_path.iterdir()] == ["run.csv"]


def test_signals_without_units_are_pure_numbers_over_seconds(tmp_path, name):
    bare = xr.Dataset({"n": ("time", VALUES)}, coords={"time": TIME})
    found = read_measurement(file_of(tmp_path, name, bare))
    np.testing.assert_array_equal(found["n"], VALUES)
    assert found["n"].attrs["units"] == "1"
    assert "units" not in bare["n"].attrs
    hours = bare.assign_coords(time=("time", TIME, {"units": "h"}))
    with pytest.raises(FileError, match="times of n are in 'h', not s"):
        file_of(tmp_path, name, hours)


def test_mat_files_of_scipy(tmp_path):
    table = np.stack([VALUES, 2 * VALUES], axis=1)
    nested = {"a": VALUES.astype(np.float32), "b": {"c": np.arange(300, dtype=np.int16)}}
    content = {
        "t": TIME,
        "y": table,
        "log": nested,
        "note": "rig 3",
        "n": 7.0,
        "cells": np.array(["a", "bb"], dtype=object),
    }
    signals = {
        "y2": {"column": "y(:,2)", "unit": "m"},
        "a": {"column": "log.a", "unit": "N"},
        "c": {"column": "log.b.c", "unit": "1"},
    }
    for packed in (False, True):
        savemat(tmp_path / "a.mat", content, do_compression=packed)
        found = read_measurement(
            tmp_path / "a.mat", {"time": {"column": "t", "unit": "s"}, "signals": signals}
        )
        np.testing.assert_array_equal(found["time"], TIME)
        np.testing.assert_array_equal(found["y2"], 2 * VALUES)
        np.testing.assert_array_equal(found["a"], VALUES.astype(np.float32))
        np.testing.assert_array_equal(found["c"], np.arange(300))


def test_scipy_reads_our_mat_files(tmp_path):
    found = loadmat(file_of(tmp_path, "mat"), squeeze_me=True)
    np.testing.assert_array_equal(found["x_mc"], measurement()["x_mc"])
    assert str(found["units"]["p_mc"]) == "Pa"


def test_hdf5_files_of_h5py(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["time"] = TIME
        file["time"].attrs["units"] = "s"
        file["rig/p"] = VALUES
        file["rig/p"].attrs["unit"] = "Pa"
        file["away"] = h5py.ExternalLink("other.h5", "/secret")
        file["round"] = h5py.SoftLink("/")
    with pytest.warns(MeasurementWarning, match="'away', 'round'. Reason: it is a link"):
        found = read_measurement(tmp_path / "a.h5")
    assert list(found.data_vars) == ["rig.p"]
    np.testing.assert_array_equal(found["rig.p"], VALUES)
    with h5py.File(file_of(tmp_path, "mat73"), "r") as file:
        np.testing.assert_array_equal(file["x_mc"][0], measurement()["x_mc"])
        assert file["x_mc"].attrs["MATLAB_class"] == b"double"


def test_parquet_files_of_pandas(tmp_path):
    pytest.importorskip("pyarrow")
    frame = pd.DataFrame(
        {
            "t": pd.to_timedelta((TIME * 1e9).astype(np.int64), unit="ns"),
            "p": VALUES,
            "n": pd.array([None, *range(299)], dtype="Int64"),
            "text": "x",
        }
    )
    frame.to_parquet(tmp_path / "a.parquet")
    mapping = {"time": "t", "signals": {"p": {"unit": "Pa"}, "n": {"unit": "1"}}}
    found = read_measurement(tmp_path / "a.parquet", mapping)
    np.testing.assert_allclose(found["time"], TIME, atol=1e-9)
    np.testing.assert_array_equal(found["p"], VALUES)
    np.testing.assert_array_equal(found["n"], [np.nan, *range(299)])
    frame["t"] = pd.Timestamp("2026-01-02T03:04:05", tz="UTC") + frame["t"]
    frame.to_parquet(tmp_path / "b.parquet")
    dated = read_measurement(tmp_path / "b.parquet", mapping)
    counts = (TIME * 1e9).astype(np.int64)
    np.testing.assert_allclose(dated["time"], (counts - counts[0]) * 1e-9, rtol=1e-15)
    ours = pd.read_parquet(file_of(tmp_path, "parquet"))
    np.testing.assert_array_equal(ours["x_mc"], measurement()["x_mc"])


def test_mdf_files_of_asammdf(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    convert = asammdf.blocks.conversion_utils.from_dict
    counts, states = np.arange(300, dtype=np.int16), np.arange(300) % 2
    linear, formula = {"a": 0.5, "b": 1}, {"formula": "X1*2"}
    texts = {"val_0": 0, "text_0": "off", "val_1": 1, "text_1": "on"}
    with asammdf.MDF(version="4.10") as file:
        file.append(
            [
                asammdf.Signal(VALUES, TIME, name="p", unit="Pa", invalidation_bits=VALUES > 1),
                asammdf.Signal(counts, TIME, name="u", unit="V", conversion=convert(linear)),
                asammdf.Signal(states, TIME, name="on", conversion=convert(texts)),
                asammdf.Signal(counts, TIME, name="f", unit="V", conversion=convert(formula)),
            ]
        )
        file.append([asammdf.Signal(VALUES[:30], 7 * TIME[:30], name="p", unit="Pa")])
        file.save(tmp_path / "a.mf4", compression=2)
    with pytest.warns(MeasurementWarning) as warned:
        found = read_measurement(tmp_path / "a.mf4")
    assert len(warned) == 2  # of the formula, and of samples that are marked as invalid
    assert list(found.data_vars) == ["p@0", "u", "on", "p@1"]  # a formula is never evaluated
    np.testing.assert_array_equal(found["p@0"], np.where(VALUES > 1, np.nan, VALUES))
    np.testing.assert_array_equal(found["u"], 0.5 * counts + 1)
    np.testing.assert_array_equal(found["on"], states)
    np.testing.assert_array_equal(found["p@1"], VALUES[:30])
    np.testing.assert_array_equal(found[found["p@1"].dims[0]], 7 * TIME[:30])
    with asammdf.MDF(file_of(tmp_path, "mdf4")) as file:
        np.testing.assert_array_equal(file.get("x_mc").samples, measurement()["x_mc"])
        assert file.get("p_mc").unit == "Pa"


def test_large_mdf_files_are_read_piece_by_piece(tmp_path, monkeypatch):
    pytest.importorskip("asammdf")
    dataset = with_slow_signal(measurement())
    path = file_of(tmp_path, "mdf4", dataset)
    monkeypatch.setattr("bywire.data.formats.mdf4._MAPPED", 0)
    monkeypatch.setattr("bywire.data.formats.mdf4._RECORDS", 37)
    with KNOWN.find("mdf4").open(path, ReadOptions()) as source:
        pieces = list(source.pieces(["p_mc", "x_mc", "T"]))
    assert max(numbers.size for _, _, numbers in pieces) == 37
    for name, signal in dataset.data_vars.items():
        whole = np.concatenate([numbers for key, _, numbers in pieces if key == name])
        np.testing.assert_array_equal(whole, signal.values)


def test_netcdf_files_of_xarray(tmp_path):
    dataset = measurement()
    for kind in ("NETCDF3_CLASSIC", "NETCDF3_64BIT", "NETCDF4"):
        path = tmp_path / f"{kind}.nc"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            dataset.to_netcdf(path, format=kind, engine="netcdf4")
        same(read_measurement(path), dataset)
    same(xr.load_dataset(file_of(tmp_path, "netcdf")), dataset)
