"""Durations, steps and rows: divisibility and limits of memory."""

from __future__ import annotations

import math

import pytest

import bywire
from bywire.bench import experiment
from bywire.core.errors import StepError
from raising import raises
from run_once import run_once

SET = "dardanelli2010"
STEP = {"kind": "step", "start": 0, "end": "1 A", "t_step": 0}


def braking(**changes) -> bywire.Bench:
    """Return a hard braking."""
    return bywire.Bench("hard-braking", SET, **changes)


@pytest.mark.parametrize("step", ["1 us", "5 us", "20 us", "40 us", "100 us", "1 ms"])
def test_steps_that_divide_the_period_of_the_ecu(step):
    bench = braking(step=step, options={"duration": "5 ms", "settle": 0})
    assert run_once(bench).status == "done"


@pytest.mark.parametrize("step", ["3 us", "30 us", "333 us", "2 ms", "1 s", "1e9 s"])
def test_steps_that_do_not_are_refused(step):
    with pytest.raises(StepError, match="does not divide the ecu interval"):
        run_once(braking(step=step))


@pytest.mark.parametrize("record", ["20 us", "200 us", "1 ms", "5 ms", "1.2 s"])
def test_recording_intervals(record):
    bench = braking(record=record)
    recording = run_once(bench).recordings["run"]
    assert recording.sizes["time"] >= 2
    interval = float(recording["time"][1] - recording["time"][0])
    assert interval == pytest.approx(bench.record)


@pytest.mark.parametrize("record", ["10 us", "30 us", "1e-9 s"])
def test_recording_intervals_that_the_step_does_not_divide(record):
    with pytest.raises(StepError, match="does not divide the recording interval"):
        run_once(braking(record=record))


@pytest.mark.parametrize(
    ("record", "text"),
    [
        ("1.21 s", r"1\.2 s cannot have rows every .*record more often"),
        ("1e300 s", r"the recording interval of 1e[+]300 s, .*[.] Use a shorter interval"),
    ],
)
def test_recording_interval_longer_than_the_run(record, text):
    with pytest.raises(StepError, match=text):
        run_once(braking(record=record))


@pytest.mark.parametrize("duration", ["1e9 s", "1e300 s"])
def test_run_that_no_memory_holds(duration):
    options = {"duration": duration}
    bench = bywire.Bench("motor-open-loop", SET, options=options, stimulus=STEP)
    with pytest.raises(StepError, match=r"needs about .* GB of memory, but this machine has"):
        run_once(bench)


def test_settling_that_no_float_counts_in_bytes():
    options = {"settle": "1e305 s"}
    bench = bywire.Bench("motor-open-loop", SET, options=options, stimulus=STEP)
    with pytest.raises(StepError, match=r"needs about .* GB of memory, but this machine has"):
        run_once(bench)


def test_recording_less_often_needs_less(monkeypatch):
    monkeypatch.setattr(experiment, "_memory", lambda: 2e6)
    with pytest.raises(StepError, match=r"0\.002 GB.*record less often"):
        run_once(braking())
    assert run_once(braking(record="10 ms")).status == "done"


def test_runs_that_one_memory_holds_alone_and_not_together(monkeypatch):
    bench = bywire.Bench("current-loop", "roberts2003", options={"duration": "4 ms"})
    kept = sum(each.nbytes for each in run_once(bench).recordings.values())
    monkeypatch.setattr(experiment, "_memory", lambda: 0.9 * kept)
    with pytest.raises(StepError, match=r"9 runs of up to .* together need about"):
        run_once(bench)
    monkeypatch.setattr(experiment, "_memory", lambda: 1.5 * kept)
    result = bywire.run(bench)
    assert math.isnan(result.kpis[0].error)
    assert any("together need about" in text for text in result.warnings)


def test_infinite_duration():
    options = {"i_max": 1e308, "slope": 1e-308}
    with pytest.raises(StepError, match="inf"):
        run_once(bywire.Bench("friction-ramp", SET, options=options))


def test_memory_of_this_machine_is_plausible():
    assert 1e8 < experiment._memory() < 1e16


def test_system_that_does_not_tell_its_memory(monkeypatch):
    def unknown(name):
        raise ValueError(name)

    monkeypatch.setattr("os.sysconf", unknown, raising=False)
    assert experiment._memory.__wrapped__() == 8e9


@pytest.mark.parametrize("value", [1e-9, 1, "3 ms"])
def test_admissible_step(value):
    assert experiment.checked_step(value) >= experiment.SHORTEST_STEP
    assert experiment.checked_interval(value) == experiment.checked_step(value)


@pytest.mark.parametrize("value", [0, 9.99e-10, -1, -math.inf, math.nan, "x", [1], None, False])
def test_inadmissible_step(value):
    with pytest.raises(bywire.BywireError, match=r"simulation\.step"):
        experiment.checked_step(value)


def test_sample_times_that_would_make_it_settle_for_long():
    with raises(StepError, name="settle", value="970.471 s"):
        bywire.Bench(
            "moment-release",
            "roberts2003",
            {"control.T_slow": "97.0471 s"},
            {"settle": "60 ms", "duration": "40 ms"},
        )
