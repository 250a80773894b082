"""Steps, sample times and recording intervals: how they divide each other, and errors."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from bywire.core.errors import StepError
from bywire.core.units import parse
from bywire.simulation.run import simulate
from bywire.simulation.schedule import plan
from systems.three_contacts import heart
from systems.two_mass import rig


def test_plan_of_two_tasks() -> None:
    schedule = plan(0.01, 20e-6, {"slow": 1e-3, "fast": 2e-4}, 5e-4)
    assert schedule.substeps == 5  # 0.1 ms divides 1, 0.2 and 0.5 ms
    assert schedule.frame == pytest.approx(1e-4)
    assert schedule.task_frames == (10, 2)
    assert (schedule.record_frames, schedule.frames) == (5, 100)
    assert (schedule.rows, schedule.stimulus_rows) == (21, 51)
    np.testing.assert_allclose(schedule.record_times, 5e-4 * np.arange(21), atol=1e-15)
    np.testing.assert_allclose(schedule.stimulus_times, 2e-4 * np.arange(51), atol=1e-15)


@pytest.mark.parametrize(
    ("step", "record", "period", "name", "interval"),
    [
        (30e-6, 1e-3, 1e-3, "drive", "1 ms"),
        (40e-6, 1e-4, 1e-3, "recording", "0.1 ms"),
        (3e-3, 3e-3, 1e-3, "drive", "1 ms"),
        (20.001e-6, 1e-3, 1e-3, "drive", "1 ms"),
    ],
)
def test_a_step_that_does_not_divide(
    step: float, record: float, period: float, name: str, interval: str
) -> None:
    """The message contains both numbers, the owner of the interval, and a valid step."""
    with pytest.raises(StepError) as caught:
        plan(0.1, step, {"drive": period}, record)
    assert f"{name} interval of {interval}" in str(caught.value)
    assert parse(caught.value.value, "s", "step") == pytest.approx(step, rel=1e-5)
    proposed = parse(caught.value.valid, "s", "step")
    whole = (record if name == "recording" else period) / proposed
    assert whole == pytest.approx(round(whole), rel=1e-5)


@pytest.mark.parametrize(
    ("period", "step", "text"),
    [
        (0.1234567891234567, 1e-9, "does not divide .* For example, use"),
        (365.9670339332694, 20e-6, "does not divide .* For example, use 0.0199999"),
        (365.967033933, 20e-6, "does not divide .* For example, use"),
        (1.3e19, 20e-6, "too short for the drive interval of 1.3e[+]19 s, .*[.] Use a shorter"),
        (1e300, 1e-9, "too short for the drive interval"),
    ],
)
def test_a_step_far_from_any_divisor_is_refused_at_once(
    period: float, step: float, text: str
) -> None:
    started = time.process_time()
    with pytest.raises(StepError, match=text) as caught:
        plan(0.1, step, {"drive": period}, 0.1)
    assert time.process_time() - started < 0.1
    if "For example, use" in text:
        proposed = parse(caught.value.valid, "s", "step")
        assert proposed <= step
        plan(0.1, proposed, {"drive": period}, 1e4 * proposed)


@pytest.mark.parametrize(
    ("current", "step"), [(33e-6, "1 us"), (62.5e-6, "15.625 us"), (0.25e-3, "15.625 us")]
)
def test_the_proposed_step_divides_all_intervals(current: float, step: str) -> None:
    """A step that divides only the rejected interval would be rejected again."""
    periods = {"force": 1e-3, "current": current}
    with pytest.raises(StepError) as caught:
        plan(0.1, 20e-6, periods, 1e-3)
    proposed = parse(caught.value.valid, "s", "step")
    plan(0.1, proposed, periods, 1e-3)
    assert proposed == pytest.approx(parse(step, "s", "step"))
    assert "or an interval that is a multiple of 0.02 ms" in str(caught.value)


@pytest.mark.parametrize(
    ("duration", "step"), [(0.1, 0.0), (0.1, -1e-5), (0.1, np.nan), (0.0, 2e-5)]
)
def test_neither_zero_nor_negative(duration: float, step: float) -> None:
    with pytest.raises(StepError, match="is not valid: it must be > 0 s"):
        plan(duration, step, {"drive": 1e-3}, 1e-3)


def test_a_run_refuses_before_it_starts() -> None:
    with pytest.raises(StepError, match=r"0\.03 ms does not divide the slow interval of 1 ms"):
        simulate(heart(0.01, step=30e-6, record=1e-3))


@pytest.mark.parametrize("duration", [1e-3, 3e-3, 0.1, 0.3, 1.1])
@pytest.mark.parametrize("step", [20e-6, 1e-6 / 3.0 * 3.0, 1e-3 / 7.0])
def test_time_axis_is_whole(duration: float, step: float) -> None:
    """The number of rows is correct despite rounding of the quotients."""
    schedule = plan(duration, step, {"drive": 1e-3}, 1e-3)
    assert schedule.rows == round(duration / 1e-3) + 1
    assert schedule.frames * schedule.substeps * step == pytest.approx(duration, rel=1e-9)


def test_a_duration_between_rows_is_rounded_up() -> None:
    result = simulate(rig(2.5e-3, record=1e-3))
    np.testing.assert_allclose(result.time, [0.0, 1e-3, 2e-3, 3e-3], atol=1e-12)
    assert result.values.shape[0] == 4


def test_recording_interval_does_not_change_the_run() -> None:
    """Frames are cut differently, the substeps are the same."""
    coarse, fine = (simulate(rig(0.02, record=record)) for record in (1e-3, 4e-5))
    np.testing.assert_array_equal(coarse["x_1"], fine["x_1"][::25])
    for name in ("E_source", "E_friction"):
        np.testing.assert_allclose(coarse[name], fine[name][::25], rtol=1e-12, atol=1e-15)


def test_stimulus_is_sampled_at_the_fastest_task() -> None:
    asked: list[np.ndarray] = []
    run = heart(0.01)

    def demand(t: np.ndarray) -> np.ndarray:
        asked.append(t)
        return run.stimulus(t)

    simulate(replace(run, stimulus=demand))
    np.testing.assert_allclose(np.concatenate(asked), 2e-4 * np.arange(51), atol=1e-12)
