"""A bench for many values gives the same start, figures and verdict as separate runs."""

from __future__ import annotations

import gc
import math
from dataclasses import replace

import numpy as np
import pytest

import bywire
from bywire.bench import ensemble
from bywire.bench.ensemble import key_figures_of
from bywire.bench.running import run
from bywire.core.errors import ParameterError, UnknownNameError
from raising import raises

OPTIONS = {"duration": "60 ms", "settle": "10 ms"}
VALUES = (0.25, 0.35, 0.5)


@pytest.fixture(scope="module")
def bench():
    return bywire.Bench(
        "hard-braking", "dardanelli2010", options=OPTIONS, requirements={"peak_current": "<= 18 A"}
    )


@pytest.fixture(scope="module")
def found(bench):
    return bywire.simulate_ensemble(bench, {"motor.R_m": VALUES})


def test_each_case_is_as_the_bench_alone(bench, found):
    for value, result in zip(VALUES, found.results, strict=True):
        alone = run(bench.with_overrides({"motor.R_m": value}))
        assert [k.name for k in result.kpis] == [k.name for k in alone.kpis]
        for ours, its in zip(result.kpis, alone.kpis, strict=True):
            assert ours.note == its.note
            assert math.isnan(ours.value) == math.isnan(its.value)
            assert math.isnan(its.value) or ours.value == pytest.approx(its.value, rel=1e-6)
        assert result.recording.attrs.keys() == alone.recording.attrs.keys()
        assert result.status == alone.status
        assert "lanes" in result.recording.attrs["engine"]


def test_key_figures_and_verdicts_by_case(found):
    peaks = found.kpi("peak_current")
    assert peaks.shape == (3,)
    assert (np.diff(peaks) < 0).all()
    np.testing.assert_array_equal(found.met, peaks <= 18.0)
    assert set(found.met.tolist()) == {True, False}
    assert found["p_mc"].dims == ("case", "time")
    np.testing.assert_array_equal(found["p_mc"]["motor.R_m"], VALUES)
    with pytest.raises(UnknownNameError, match="p_mc"):
        found["p_mx"]


def test_options_vary_and_the_start_follows(bench):
    found = bywire.simulate_ensemble(bench, {"options.p_from": [6e5, 12e5]})
    starts = [float(r.recording["p_mc"].sel(time=0, method="nearest")) for r in found.results]
    assert starts == pytest.approx([6e5, 12e5], rel=0.02)


def test_an_experiment_of_several_runs():
    bench = bywire.Bench("friction-ramp", "dardanelli2010", options={"i_max": 0.2, "slope": 2.0})
    found = bywire.simulate_ensemble(bench, {"seal.T_pr": [0.002, 0.004]})
    for value, result in zip((0.002, 0.004), found.results, strict=True):
        alone = run(bench.with_overrides({"seal.T_pr": value}))
        assert list(result.recordings) == ["without-dither", "with-dither"]
        for label, recording in alone.recordings.items():
            lane = result.recordings[label]
            size = float(abs(recording["x_mc"]).max())
            assert float(abs(lane["x_mc"] - recording["x_mc"]).max()) < 1e-9 * size
    with pytest.raises(ParameterError, match="several recordings"):
        found["x_mc"]


def test_what_cannot_run_side_by_side_runs_one_by_one(bench, monkeypatch):
    found = bywire.simulate_ensemble(bench, {"options.duration": [0.05, 0.06]})
    assert [r.recording.sizes["time"] for r in found.results] == [61, 71]
    monkeypatch.setattr("bywire.bench.ensemble.fit_lanes", lambda runs: False)
    alone = bywire.simulate_ensemble(bench, {"motor.R_m": [0.25]})
    assert "lanes" not in alone.results[0].recording.attrs["engine"]


def test_what_is_refused(bench):
    with pytest.raises(UnknownNameError, match=r"did you mean 'motor\.R_m'"):
        bywire.simulate_ensemble(bench, {"motor.R_n": [0.3]})
    with pytest.raises(ParameterError, match=r"motor\.R_m = -1 \(in SI\).*ohm"):
        bywire.simulate_ensemble(bench, {"motor.R_m": [0.3, -1.0]})
    with raises(ParameterError, name="variations"):
        bywire.simulate_ensemble(bench, {"motor.R_m": [0.3], "motor.K_e": [0.03, 0.04]})
    with raises(ParameterError, name="signals"):
        bywire.simulate_ensemble(bench, {"motor.R_m": [0.3]}, ["p_mc"])
    (single,) = bench.runs().values()
    with raises(ParameterError, name="signals"):
        bywire.simulate_ensemble(single, {"motor.R_m": [0.3]})
    raw = bywire.simulate_ensemble(single, {"motor.R_m": [0.3]}, ["p_mc"])
    assert raw["p_mc"].shape[0] == 1


def test_key_figures_and_warnings_without_recordings_are_the_same():
    """After a release, the piston is at its stop, and the run warns about it."""
    bench = bywire.Bench("pressure-release", "dardanelli2010")
    benches = [bench.varied({"motor.R_m": value}, {}) for value in (0.3, 0.4)]
    figures = key_figures_of(benches)
    for k, result in enumerate(ensemble.run_benches(benches)):
        assert figures.kpis(k) == result.kpis
        assert list(figures.warnings[k]) == result.warnings
        assert any("retracted stop" in text for text in figures.warnings[k])


def test_recordings_that_were_judged_are_let_go_at_once(bench):
    """They are not left to the garbage collector, which runs rarely with few large arrays."""
    key_figures_of([bench])  # fill the caches of the model
    gc.collect()
    gc.disable()
    try:
        key_figures_of([bench])
        gc.set_debug(gc.DEBUG_SAVEALL)
        gc.collect()
        left = [each for one in gc.garbage for each in (one, *gc.get_referents(one))]
        assert not [each for each in left if isinstance(each, np.ndarray)]
    finally:
        gc.set_debug(0)
        gc.garbage.clear()
        gc.enable()


def test_warnings_of_cases_need_no_more_than_the_signals_that_are_watched(bench):
    """The ranges of both sensors and of the pipe's law differ from case to case."""
    changes = [
        {"current_sensor.i_high": 4.0},
        {"current_sensor.i_high": 4.5, "pipeline.Re_max": 1.0},
        {"pressure_sensor.p_high": 8e5},
        {},
    ]
    benches = [bench.varied(each, {}) for each in changes]
    figures = key_figures_of(benches)
    for texts, result in zip(figures.warnings, ensemble.run_benches(benches), strict=True):
        assert list(texts) == result.warnings
    assert [len(texts) for texts in figures.warnings] == [1, 2, 1, 0]


def test_elements_that_all_cases_share_may_warn_of_some(bench):
    """The sensor has the same range in both cases, and only one case exceeds it."""
    same = {"current_sensor.i_high": 4.0}
    benches = [bench.varied(same, options) for options in ({}, {"p_to": 6.5e5})]
    figures = key_figures_of(benches)
    for texts, result in zip(figures.warnings, ensemble.run_benches(benches), strict=True):
        assert list(texts) == result.warnings
    assert [len(texts) for texts in figures.warnings] == [1, 0]


def test_a_varied_bench_is_the_one_that_is_made_anew(bench):
    changes = {"motor.R_m": 0.5, "adc.law": "ideal"}
    varied = bench.varied(changes, {"p_to": 20e5}, seed=7)
    anew = replace(bench, overrides=changes, options={**OPTIONS, "p_to": 20e5}, seed=7)
    assert (varied.par, varied.chosen_options, varied.system) == (
        anew.par,
        anew.chosen_options,
        anew.system,
    )
    assert varied == replace(varied)  # repeats every check
    assert run(varied).kpis == run(anew).kpis
    with pytest.raises(ParameterError, match=r"motor\.R_m"):
        bench.varied({"motor.R_m": -1.0}, {})


def test_what_is_driven_is_checked_anew_whatever_varies(bench, monkeypatch):
    """A choice or a number can make an experiment drive other signals."""
    checked = []
    monkeypatch.setattr("bywire.bench.bench._check_driven", lambda case, _: checked.append(case))
    for changes in (({"motor.R_m": 0.4}, {}), ({"adc.law": "ideal"}, {}), ({}, {"p_to": 30e5})):
        bench.varied(*changes)
        assert checked.pop().par.adc.law == changes[0].get("adc.law", "quantized")


def test_key_figures_of_faulty_cases_are_those_of_each():
    """Faults change parameters during a run: energies are then recorded in all rows."""
    fault = {"set": {"motor.K_e": "-30%"}, "onset": "30 ms"}
    options = {"duration": "60 ms", "settle": "10 ms"}
    bench = bywire.Bench("hard-braking", "dardanelli2010", options=options, faults=(fault,))
    benches = [bench.varied({"motor.R_m": value}, {}) for value in (0.3, 0.4)]
    figures = key_figures_of(benches)
    for k, result in enumerate(ensemble.run_benches(benches)):
        assert figures.kpis(k) == result.kpis
        assert list(figures.warnings[k]) == result.warnings
