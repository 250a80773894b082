"""How cases become runs: zero at a tick and a row, noise, and attributes of the recording."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import bywire
from bywire.bench import ensemble, running, step_error
from bywire.bench.ensemble import run_benches
from bywire.bench.experiment import as_run
from bywire.bench.running import Result, run
from bywire.brakes.motorcycle.case import settled_start
from bywire.core.errors import WorkLimitError
from bywire.simulation.ensemble import simulate_group
from bywire.simulation.run import simulate
from raising import raises
from run_once import run_once

SET = "dardanelli2010"
STEP = {"kind": "step", "start": 0, "end": "1 A", "t_step": "10 ms"}
SHORT = {"duration": "0.2 s", "settle": "0.1 s"}


def braking(settle: float, **changes) -> bywire.BenchResult:
    """Return a short braking that settles for a time [s]."""
    options = {"duration": "0.3 s", "settle": settle}
    return run_once(bywire.Bench("hard-braking", SET, options=options, **changes))


@pytest.mark.parametrize("settle", [0.1005, 0.10001, 0.0999])
def test_step_falls_on_a_tick_and_on_a_row(settle):
    plain, odd = braking(math.ceil(settle * 1e3 - 1e-9) * 1e-3), braking(settle)
    assert 0.0 in odd.recording["time"].values
    for name in ("dead_time", "rise_time", "overshoot"):
        # Times count from a different start, so their last digits differ.
        assert odd.kpi(name).value == pytest.approx(plain.kpi(name).value, rel=1e-13)


@pytest.mark.parametrize("record", ["0.2 ms", "5 ms"])
def test_zero_is_a_row_for_every_recording_interval(record):
    recording = braking(0.1005, record=record).recording
    assert 0.0 in recording["time"].values
    reference = braking(0.105, record=record).recording
    assert float(recording["p_mc"][-1]) == pytest.approx(float(reference["p_mc"][-1]), rel=0.02)


def test_settling_time_is_a_common_multiple_of_both_intervals():
    bench = bywire.Bench(
        "hard-braking",
        SET,
        {"ecu.T_s": "0.625 ms"},
        {"settle": "1 s"},
        step="25 us",
        record="1 ms",
    )
    (case,) = bench.cases()
    assert case.settle == pytest.approx(1.0)
    assert bench.runs()["run"].duration == pytest.approx(case.settle + case.duration)
    (odd,) = bywire.Bench(
        "hard-braking", SET, {"ecu.T_s": "0.625 ms"}, {"settle": "1.0005 s"}, step="25 us"
    ).cases()
    assert odd.settle == pytest.approx(1.005)


def test_recording_kept_from_the_middle_of_the_settling_time():
    time = braking(0.2505).recording["time"].values
    assert time[0] == pytest.approx(-0.1)
    np.testing.assert_allclose(np.diff(time), 1e-3, rtol=1e-9)


@pytest.mark.parametrize("T_s", ["0.625 ms", "2 ms"])
def test_operating_point_follows_the_sample_time_of_the_ecu(T_s):
    par = bywire.Bench("pressure-step", SET, {"ecu.T_s": T_s}, step="25 us").par
    start = settled_start(25e5, par, 1.0)
    assert 20e5 < start < 45e5


def test_noise_is_the_same_whatever_the_duration():
    case = bywire.Bench("hard-braking", SET, options=SHORT).cases()[0]
    rows = {}
    for count in (50, 500):
        rows[count] = as_run(case, 20e-6, seed=(3, 0)).stimulus(np.arange(count) * 1e-3)
    np.testing.assert_array_equal(rows[50], rows[500][:50])
    channels = [k for k, f in enumerate(case.model.Stimulus._fields) if f.startswith("noise_")]
    assert len(channels) > 1
    drawn = rows[500][:, channels]
    assert np.all(np.abs(np.corrcoef(drawn.T) - np.eye(len(channels))) < 0.2)
    other = as_run(case, 20e-6, seed=(3, 1)).stimulus(np.arange(50) * 1e-3)
    assert np.any(other[:, channels] != rows[50][:, channels])


def test_recording_can_be_made_again():
    bench = bywire.Bench("motor-open-loop", SET, options=SHORT, stimulus=STEP, seed=4)
    recording = run_once(bench).recording
    attrs = recording.attrs
    again = bywire.Bench(
        attrs["experiment"],
        attrs["parameter_set"],
        options=json.loads(attrs["options"]),
        stimulus=json.loads(attrs["stimulus"]),
        step=attrs["step"],
        seed=attrs["seed"],
    )
    assert again.chosen_options == bench.chosen_options
    assert run_once(again).recording.equals(recording)
    assert json.loads(braking(0.0).recording.attrs["stimulus"]) == {}


def test_breakaway_is_that_of_the_highest_pressure_in_any_order():
    names = ("breakaway_apply", "breakaway_release")
    found = [
        [
            run_once(bywire.Bench("seal-stribeck", SET, options={"pressures": p})).kpi(n).value
            for n in names
        ]
        for p in ("2 bar, 20 bar, 40 bar", "40 bar, 2 bar, 20 bar")
    ]
    assert found[0] == found[1]


HALF = "bywire abandoned the error estimate from half the step, which needed more than 1.5 times"


def estimated(bench: bywire.Bench) -> list[Result]:
    """Return the bench run with errors, alone and together with another."""
    return [run(bench, estimate_error=True), *run_benches([bench] * 2, estimate_error=True)]


def test_an_estimate_that_takes_too_much_work_is_abandoned_with_a_note(monkeypatch):
    """Half the step doubles the work; without it, the scatter of the others gives the error."""
    bench = bywire.Bench("hard-braking", SET, options={"duration": 0.1, "settle": 0.1})
    usual = estimated(bench)
    others = [factor for factor in step_error.steps_of(bench.runs().values()) if factor != 0.5]
    assert len(others) == 2
    times = [
        run(replace(bench, step=factor * 20e-6)).kpi("rise_time").value for factor in (1.0, *others)
    ]
    scatter = 1.72 * float(np.std(times, ddof=1))
    for module in (running, ensemble, step_error):
        monkeypatch.setattr(module, "MOST_WORK", 1.5)
    for whole, abandoned in zip(usual, estimated(bench), strict=True):
        assert whole.warnings == []
        (warning,) = abandoned.warnings
        assert warning.startswith(HALF)
        assert not abandoned.kpi("rise_time").converges
        assert abandoned.kpi("rise_time").error == pytest.approx(scatter, rel=1e-6)


def test_work_is_counted_in_substeps_the_same_alone_and_side_by_side():
    (case,) = bywire.Bench("hard-braking", SET, options={"duration": 0.1, "settle": 0.1}).cases()
    computed = as_run(case, 20e-6, seed=(0, 0))
    alone = simulate(computed)
    assert alone.work >= 0.2 / 20e-6
    assert alone.work == simulate_group([computed] * 3)[1].work
    with raises(WorkLimitError, value="substeps"):
        simulate(replace(computed, most_work=0.5 * alone.work))
