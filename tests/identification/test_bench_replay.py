"""Replay of a bench's own recording gives it back; figures and segments by hand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import bywire
from bywire.core.errors import ParameterError, UnitError, UnknownNameError
from bywire.identification.bench_replay import replay
from bywire.identification.replay_fit import (
    Segment,
    fit_figures,
    found_in,
    judge_fit,
    judged,
    read_segments,
    undefined,
)
from raising import raises
from run_once import run_once

STOP = bywire.Bench("moment-pulses", "roberts2003", options={"t_hold": 0.2, "pulses": 1})


@pytest.fixture(scope="module")
def stop() -> xr.Dataset:
    return run_once(STOP).recording


@pytest.fixture(scope="module")
def ramp() -> xr.Dataset:
    bench = bywire.Bench(
        "motor-open-loop",
        "dardanelli2010",
        options={"source": "current", "duration": 0.6},
        stimulus={"kind": "step", "start": 1.0, "end": 3.0, "t_step": 0.2},
    )
    return run_once(bench).recording


def test_a_wedge_recording_gives_itself_back(stop: xr.Dataset) -> None:
    """Its clock begins 50 ms before zero, as the experiment's parking does."""
    found = replay(STOP, stop, {"M_set": "M_set"}, ["y_M", "x", "i_1"])
    for pair in found.outputs.values():
        span = float(np.ptp(pair["measured"].values))
        assert np.abs(pair["modeled"] - pair["measured"]).max() < 1e-9 * span


def test_a_record_with_a_fault_is_explained_by_the_bench_that_has_it(stop: xr.Dataset) -> None:
    faults = [
        {"fault": "moment.offset", "value": "50 N*m", "onset": "0.1 s"},
        {"set": {"bearing.C_0": "+50%"}, "onset": "0.12 s"},
    ]
    failing = bywire.Bench(STOP.experiment, STOP.parameters, options=STOP.options, faults=faults)
    measured = bywire.run(failing, estimate_error=False).recording
    known, unknown = (
        replay(bench, measured, {"M_set": "M_set"}, ["y_M"]).outputs["y_M"]
        for bench in (failing, STOP)
    )
    span = float(np.ptp(measured["y_M"].values))
    assert np.abs(known["modeled"] - known["measured"]).max() < 1e-9 * span
    assert np.abs(unknown["modeled"] - unknown["measured"]).max() > 0.05 * span


def test_a_motorcycle_starts_at_the_measured_pressure(ramp: xr.Dataset) -> None:
    """The part after the first slip, from a pressure of its own."""
    later = ramp[["i", "p_mc"]].sel(time=slice(0.0, None)).rename(i="current")
    later = later.assign_coords(time=later["time"] + 7.0)
    bench = bywire.Bench(
        "motor-open-loop",
        "dardanelli2010",
        stimulus={"kind": "step", "start": 0, "end": 0, "t_step": 0},
    )
    found = replay(bench, later, {"i_set": "current"})
    assert list(found.outputs) == ["p_mc"]
    pair = found.outputs["p_mc"]
    assert float(np.ptp(pair["measured"].values)) > 5e5
    assert float(np.abs(pair["modeled"] - pair["measured"]).max()) < 0.02e5
    assert "starts at the measured p_mc" in found.notes[0]


def test_wrong_parameters_show(ramp: xr.Dataset) -> None:
    bench = bywire.Bench(
        "motor-open-loop",
        "dardanelli2010",
        overrides={"master_cylinder.A_mc": 2e-4},
        stimulus={"kind": "step", "start": 0, "end": 0, "t_step": 0},
    )
    found = replay(bench, ramp[["i", "p_mc"]], {"i_set": "i"})
    (fit,) = judged(found.outputs, [Segment("all", 0.0, 0.6, {"nrmse": "<= 5 %"})])
    assert not fit.verdicts[0].met


def test_figures_know_their_error_from_the_step(ramp: xr.Dataset) -> None:
    """True errors, against steps of 2 us; and a tolerance that is closer is undecided."""
    coarse, fine = (
        bywire.replay(
            ramp,
            "motor-open-loop",
            {"simulation.step": step, "motor.R_m": "0.4 ohm"},
            inputs={"i_set": "i"},
            outputs=["p_mc"],
        )
        for step in ("100 us", "2 us")
    )
    figures = {k.name: k for k in coarse.fits[0].kpis}
    true = {k.name: k.value for k in fine.fits[0].kpis}
    for name in ("rmse", "nrmse", "bias"):
        assert figures[name].error > 0.0
        assert abs(figures[name].value - true[name]) <= 3.0 * figures[name].error
    rmse = figures["rmse"]
    for limit, outcome in (
        (rmse.value + 0.5 * rmse.bound, "undecided"),
        (rmse.value + 2.0 * rmse.bound, "met"),
    ):
        (verdict,) = judge_fit({"rmse": f"<= {limit!r} Pa"}, "p_mc", [rmse])
        assert verdict.outcome == outcome
    plain = bywire.replay(
        ramp, "motor-open-loop", inputs={"i_set": "i"}, outputs=["p_mc"], estimate_error=False
    )
    assert all(math.isnan(k.error) for k in plain.fits[0].kpis)


def test_figures_by_hand() -> None:
    t = 1e-3 * np.arange(2000)
    measured, modeled = np.sin(20.0 * t), np.sin(20.0 * (t - 0.0123)) + 0.1
    pair = xr.Dataset(
        {
            "measured": ("time", measured, {"units": "Pa"}),
            "modeled": ("time", modeled, {"units": "Pa"}),
        },
        {"time": ("time", t, {"units": "s"})},
    )
    found = {k.name: k.value for k in fit_figures(pair, Segment("all", 0.0, 2.0))}
    error = modeled - measured
    assert found["rmse"] == pytest.approx(np.sqrt(np.mean(error**2)))
    assert found["nrmse"] == pytest.approx(100.0 * found["rmse"] / np.ptp(measured))
    assert found["vaf"] == pytest.approx(100.0 * (1.0 - np.var(error) / np.var(measured)))
    assert found["max_error"] == pytest.approx(np.abs(error).max())
    assert found["lag"] == pytest.approx(0.0123, abs=2e-5)
    flat = pair.assign(measured=pair["measured"] * 0.0)
    still = {k.name: k for k in fit_figures(flat, Segment("all", 0.0, 2.0))}
    assert np.isnan(still["vaf"].value)
    assert "does not change" in still["vaf"].note


def test_tolerances_by_segment_and_signal() -> None:
    t = 1e-3 * np.arange(1000)
    attrs = {"units": "Pa"}
    good = xr.Dataset(
        {"measured": ("time", t, attrs), "modeled": ("time", t + 1e-3, attrs)},
        {"time": ("time", t, {"units": "s"})},
    )
    bad = good.assign(modeled=("time", np.where(t < 0.5, t, t + 0.5), attrs))
    parts = [
        Segment("a", 0.0, 0.4, {"nrmse": "<= 5 %"}),
        Segment("b", 0.6, 0.9, {"nrmse": "<= 5 %", "bad.max_error": "<= 1 Pa"}),
    ]
    found = judged({"good": good, "bad": bad}, parts)
    met = {(f.segment.name, f.signal): [v.met for v in f.verdicts] for f in found}
    assert met == {
        ("a", "good"): [True],
        ("a", "bad"): [True],
        ("b", "good"): [True],
        ("b", "bad"): [False, True],
    }
    with pytest.raises(UnknownNameError, match="nrmse"):
        judged({"good": good}, [Segment("a", 0.0, 0.4, {"nmrse": "<= 5 %"})])
    with pytest.raises(UnitError):
        judged({"good": good}, [Segment("a", 0.0, 0.4, {"max_error": "<= 1 A"})])
    for late in (Segment("late", 5.0, 6.0), Segment("long", 0.5, 1.2)):
        with pytest.raises(ParameterError, match=r"beyond the record, which covers 0 to 0\.999"):
            judged({"good": good}, [late])


def test_errors_are_bounded_both_ways() -> None:
    """The model is 50 ms early, and 10 Pa too low."""
    t = 1e-3 * np.arange(2000)
    attrs = {"units": "Pa"}
    pair = xr.Dataset(
        {
            "measured": ("time", 100.0 * np.sin(20.0 * t), attrs),
            "modeled": ("time", 100.0 * np.sin(20.0 * (t + 0.05)) - 10.0, attrs),
        },
        {"time": ("time", t, {"units": "s"})},
    )

    def met(name: str, text: str) -> list[bool]:
        (fit,) = judged({"p": pair}, [Segment("all", 0.0, 2.0, {name: text})])
        return [v.met for v in fit.verdicts]

    assert met("lag", "<= 5 ms") == met("p.bias", "<= 1 Pa") == [False]
    assert met("lag", "<= 60 ms") == met("p.bias", "<= 12 Pa") == [True]
    assert met("lag", ">= -5 ms and <= 5 ms") == [False, True]
    assert met("lag", ">= -60 ms and <= -40 ms") == [True, True]
    with pytest.raises(ParameterError, match="a lower limit"):
        met("lag", "<= -40 ms")
    with pytest.raises(UnitError, match=r"tolerance p.bias = '2' has the wrong unit.*bar"):
        met("p.bias", "<= 2")


def test_missing_samples_are_named(ramp: xr.Dataset) -> None:
    bench = bywire.Bench(
        "motor-open-loop",
        "dardanelli2010",
        stimulus={"kind": "step", "start": 0, "end": 0, "t_step": 0},
    )
    gap = ramp[["i", "p_mc"]].copy(deep=True)
    gap["p_mc"][40:70] = np.nan
    found = replay(bench, gap, {"i_set": "i"})
    share = f"30 of {gap.sizes['time']} samples"
    assert any("p_mc" in note and share in note for note in found.notes)
    (fit,) = judged(found.outputs, [Segment("all", 0.0, 0.6, {"lag": "<= 5 ms"})])
    assert not fit.verdicts[0].met
    assert undefined([fit]) == ("lag of p_mc is not defined in all: the measured signal has gaps",)


def test_by_default_what_a_sensor_could_have_measured_is_compared(ramp: xr.Dataset) -> None:
    bench = bywire.Bench(
        "motor-open-loop",
        "dardanelli2010",
        stimulus={"kind": "step", "start": 0, "end": 0, "t_step": 0},
    )
    found = replay(bench, ramp, {"i_set": "i"})
    assert {"p_mc", "omega"} <= set(found.outputs)
    assert not {"stuck", "E_copper", "t_stuck"} & set(found.outputs)
    assert any("not compared" in note and "E_copper" in note for note in found.notes)
    assert list(replay(bench, ramp, {"i_set": "i"}, ["stuck"]).outputs) == ["stuck"]


def test_steps_and_holds_are_found() -> None:
    t = 1e-3 * np.arange(3000)
    ramped = np.clip((t - 2.0) / 0.5, 0.0, 1.0)
    demand = xr.DataArray(np.where(t < 1.0, 0.0, 1.0) + ramped, {"time": t}, ("time",))
    found = found_in(demand, {"nrmse": "<= 5 %"})
    assert [one.name for one in found] == ["hold-1", "move-1", "hold-2", "move-2", "hold-3"]
    starts = [one.start for one in found]
    np.testing.assert_allclose(starts, [0.0, 1.0, 1.1, 2.02, 2.6], atol=0.03)
    assert found[-1].stop == pytest.approx(2.999)


def test_files_of_segments(tmp_path: Path) -> None:
    path = tmp_path / "segments.toml"
    path.write_text(
        '[tolerances]\nnrmse = "<= 10 %"\n[segments.apply]\nstart = "0 s"\nstop = "500 ms"\n'
        '[segments.apply.tolerances]\nlag = "<= 5 ms"\n'
    )
    (one,) = read_segments(path, {"vaf": ">= 90 %"})
    assert (one.start, one.stop) == (0.0, 0.5)
    assert one.tolerances == {"vaf": ">= 90 %", "nrmse": "<= 10 %", "lag": "<= 5 ms"}
    for text, wanted in (
        ('[segments.a]\nstart = "1 s"\nstop = "0 s"\n', "start must be before stop"),
        ('[segments.a]\nstart = "1 s"\n', "stop is missing"),
        ('[segments.a]\nbegin = "1 s"\n', "'begin'"),
        ('[segment.a]\nstart = "1 s"\n', "'segment'"),
        ("[segments]\n", "segments is empty"),
        ("a = ", "is not valid TOML"),
    ):
        path.write_text(text)
        with pytest.raises(
            (ParameterError, UnknownNameError, bywire.core.errors.FileError), match=wanted
        ):
            read_segments(path, {})


def test_what_does_not_fit_is_refused(ramp: xr.Dataset) -> None:
    bench = bywire.Bench(
        "motor-open-loop",
        "dardanelli2010",
        stimulus={"kind": "step", "start": 0, "end": 0, "t_step": 0},
    )
    with raises(ParameterError, name="inputs", valid="i_set, v_set"):
        replay(bench, ramp[["i", "p_mc"]])
    with pytest.raises(UnknownNameError, match="i_set"):
        replay(bench, ramp[["i", "p_mc"]], {"i_st": "i"})
    with raises(UnitError, name="p_mc", value="Pa", valid="A"):
        replay(bench, ramp[["i", "p_mc"]], {"i_set": "p_mc"})
    gap = ramp[["i", "p_mc"]].copy(deep=True)
    gap["i"][40] = np.nan
    with pytest.raises(ParameterError, match="i drives the model, but is missing 1 sample,"):
        replay(bench, gap, {"i_set": "i"})


def test_a_replay_whose_energy_balance_is_open_says_so(ramp: xr.Dataset) -> None:
    bench = bywire.Bench(
        "motor-open-loop",
        "dardanelli2010",
        overrides={"pipeline.k_lf": 3.2e-19},
        stimulus={"kind": "step", "start": 0, "end": 0, "t_step": 0},
    )
    replayed = replay(bench, ramp[["i", "p_mc"]], {"i_set": "i"})
    assert any("energy balance" in note for note in replayed.notes)


def test_differences_of_temperatures_have_no_offset():
    t = np.linspace(0.0, 1.0, 11)
    pair = xr.Dataset(
        {
            "measured": ("time", np.full(t.size, 293.15), {"units": "K"}),
            "modeled": ("time", np.full(t.size, 295.15), {"units": "K"}),
        },
        coords={"time": t},
    )
    found = {k.name: k for k in fit_figures(pair, Segment("all", 0.0, 1.0))}
    for name in ("rmse", "max_error", "bias"):
        assert (found[name].value, found[name].unit) == (pytest.approx(2.0), "delta_degC")
    assert math.isnan(found["vaf"].value)
