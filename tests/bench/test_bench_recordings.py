"""Recordings: their attributes, their files, and the effect of the seed."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

import bywire
from bywire.bench.energy_ledger import energy_doubts, energy_residual, role_attributes
from bywire.bench.recording import parameter_hash
from bywire.core.errors import FileError
from bywire.core.parameters import ParameterSet
from bywire.core.signals import signals_of
from run_once import run_once

SHORT = {"duration": "60 ms", "settle": "20 ms"}


def braking(**changes) -> bywire.Bench:
    """Return a short hard braking."""
    return bywire.Bench("hard-braking", "dardanelli2010", **{"options": SHORT, **changes})


def recorded(**changes) -> xr.Dataset:
    """Return the recording of a short hard braking."""
    return run_once(braking(**changes)).recordings["run"]


@pytest.fixture(scope="module")
def recording() -> xr.Dataset:
    """Return one recording for all tests that only read it."""
    return recorded(seed=5)


def test_recording_says_how_it_was_made(recording):
    attrs = recording.attrs
    assert attrs["bywire_version"] == bywire.__version__
    assert attrs["parameter_set"] == "dardanelli2010"
    assert attrs["parameter_hash"] == parameter_hash(braking().cases()[0].par)
    assert (attrs["seed"], attrs["step"], attrs["status"]) == (5, 20e-6, "done")
    assert attrs["engine"]
    assert json.loads(attrs["parameters"])["motor"]["R_m"] == 0.35
    assert attrs["warnings"] == []


def test_parameters_of_a_recording_can_be_used_again(recording):
    cls: type[ParameterSet] = type(braking().par)
    again = cls.model_validate_json(recording.attrs["parameters"])
    assert again == braking().cases()[0].par


def test_hash_follows_the_parameters():
    par = braking().par
    assert parameter_hash(par) == parameter_hash(braking(seed=9).par)
    assert parameter_hash(par) != parameter_hash(par.replace({"motor.R_m": 0.36}))
    assert parameter_hash(par) != parameter_hash(par.replace({"gear.law": "directional"}))


def test_signals_are_those_of_the_model(recording):
    declared = signals_of(braking().cases()[0].model.Output)
    assert set(recording.data_vars) == set(declared)
    for name, signal in declared.items():
        said = {"units": signal.unit, "long_name": signal.label}
        attrs = {k: v for k, v in recording[name].attrs.items() if not k.startswith("step_error")}
        assert attrs == said | role_attributes(signal.role)
        assert np.all(np.isfinite(recording[name].values))


def test_time_is_regular_and_holds_zero(recording):
    time = recording["time"].values
    np.testing.assert_allclose(np.diff(time), 1e-3, rtol=1e-9)
    assert 0.0 in time
    assert time[0] == pytest.approx(-0.02)
    assert time[-1] == pytest.approx(0.06)


def test_netcdf_gives_the_same_recording_back(recording, tmp_path):
    path = bywire.write_recording(recording, tmp_path / "run.nc")
    again = bywire.read_recording(path)
    xr.testing.assert_identical(again, recording)
    assert again.attrs == recording.attrs
    assert list(again.data_vars) == list(recording.data_vars)
    assert [p.name for p in tmp_path.iterdir()] == ["run.nc"]


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ([], []),
        (["stuck; hot"], ["stuck; hot"]),
        (["stuck; hot", "at 20 °C"], ["stuck; hot", "at 20 °C"]),
        ("", []),  # earlier versions wrote none or several
        ("stuck; hot", ["stuck; hot"]),
    ],
)
def test_warnings_of_a_recording_are_a_list_of_texts(written, read, tmp_path):
    recording = xr.Dataset({"x": ("time", [1.0])}, {"time": [0.0]}, {"warnings": written})
    path = bywire.write_recording(recording, tmp_path / "run.nc")
    assert bywire.read_recording(path).attrs["warnings"] == read


def test_static_characteristic_gives_itself_back_too(tmp_path):
    curve = run_once(bywire.Bench("seal-stribeck", "dardanelli2010")).recordings["curve"]
    path = bywire.write_recording(curve, tmp_path / "curve.nc")
    xr.testing.assert_identical(bywire.read_recording(path), curve)


def test_file_that_cannot_be_written_leaves_the_old_one(recording, tmp_path):
    (tmp_path / "taken").write_text("mine")
    with pytest.raises(FileError, match="cannot write"):
        bywire.write_recording(recording, tmp_path / "taken" / "run.nc")
    path = bywire.write_recording(recording, tmp_path / "run.nc")
    before = path.read_bytes()
    broken = recording.assign_attrs(broken=object())
    with pytest.raises((FileError, TypeError)):
        bywire.write_recording(broken, path)
    assert path.read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.nc", "taken"]


@pytest.mark.parametrize("content", [b"", b"no recording", b"CDF", b"\x89HDF\r\n\x1a\n"])
def test_file_that_is_no_recording(tmp_path, content):
    path = tmp_path / "run.nc"
    path.write_bytes(content)
    refused = (
        r"cannot read recording .*run\.nc|run\.nc is damaged: bywire cannot read it as a recording"
    )
    with pytest.raises(FileError, match=refused):
        bywire.read_recording(path)


def test_recording_that_is_not_there(tmp_path):
    with pytest.raises(FileError, match="No such file"):
        bywire.read_recording(tmp_path / "none.nc")
    with pytest.raises(FileError, match="is not a file"):
        bywire.read_recording(tmp_path)


def test_same_seed_same_bits():
    noisy = {"overrides": {"adc.noise": 1e-3}}
    xr.testing.assert_identical(recorded(seed=1, **noisy), recorded(seed=1, **noisy))


def test_other_seed_other_noise():
    noisy = {"overrides": {"adc.noise": 1e-3}}
    one, two = recorded(seed=1, **noisy), recorded(seed=2, **noisy)
    difference = one["p_meas"] - two["p_meas"]
    assert float(abs(difference).max()) > 0.0
    assert float(abs(difference).max()) < 1e5  # within codes of a 12-bit converter


def test_without_noise_the_seed_does_nothing():
    one, two = recorded(seed=1), recorded(seed=2)
    xr.testing.assert_equal(one, two)
    assert one.attrs["seed"] != two.attrs["seed"]


def test_two_runs_of_one_bench_have_noise_of_their_own():
    bench = bywire.Bench(
        "friction-ramp",
        "dardanelli2010",
        {"adc.noise": 1e-3, "ecu.dither.waveform": "off"},
        {"i_max": "0.1 A", "slope": "2 A/s"},
    )
    # With the waveform off the second run takes a sine, so only the first tick is comparable.
    first = [run["i_meas"].values[:2] for run in run_once(bench).recordings.values()]
    assert np.any(first[0] != first[1])


def test_energy_balance_closes(recording):
    residual = energy_residual(recording)
    spent = float(recording["E_source"][-1] - recording["E_source"][0])
    assert float(abs(residual).max()) < 1e-3 * abs(spent)
    assert residual.attrs["units"] == "J"


def test_engines_agree_on_every_signal():
    compiled = run_once(braking()).recordings["run"]
    slow = run_once(braking(), engine="virtual-machine").recordings["run"]
    for name in compiled.data_vars:
        scale = float(abs(compiled[name]).max())
        assert float(abs(compiled[name] - slow[name]).max()) <= 1e-6 * scale


@pytest.mark.parametrize(
    ("k_lf", "is_open"), [("32", False), ("3.2e-12", False), ("3.2e-15", True), ("3.2e-19", True)]
)
def test_a_run_whose_energy_balance_is_open_says_so(k_lf, is_open):
    """A nearly frictionless pipe lets a few grams of fluid reach absurd speeds."""
    result = run_once("hard-braking", {"pipeline.k_lf": k_lf})
    said = [text for text in result.warnings if "the energy balance has an error of" in text]
    assert bool(said) == is_open
    assert set(said) <= set(result.recordings["run"].attrs["warnings"])


def test_a_standing_body_with_much_energy_stored_closes_its_books():
    names = {"E_source": 0.0, "E_stored": 1e3, "E_friction": 0.0}
    rows = {n: ("time", value + 1e-13 * np.arange(3.0)) for n, value in names.items()}
    assert energy_doubts(xr.Dataset(rows, {"time": [0.0, 1.0, 2.0]})) == []
