"""Signals after taps: unchanged without a fault, corrupted as specified; missed ticks."""

from __future__ import annotations

import numpy as np
import pytest

from bywire.simulation.run import Run, simulate
from bywire.simulation.tapped import DEAD, Tap, Tapped, rests
from systems.sampled_lag import LAG, Memory, SampledLag, State

TAPS = (
    Tap("sensor", "reading", "y"),
    Tap("wish", "demand", "wanted"),
    Tap("actor", "drive", "drive", "law", 3),
)
STEP, TICKS = 2.5e-4, 60


def tapped(**signals):
    """Return the run with taps, of stimuli by name, one value a tick."""
    model = Tapped(SampledLag(), TAPS, ("law",))
    fields = model.Stimulus._fields

    def stimulus(t):
        rows = np.zeros((t.size, len(fields)))
        rows[:, 0] = wish(t.size)
        for name, values in signals.items():
            rows[:, fields.index(name)] = np.resize(values, t.size)
        return rows

    state, memory = State(0.0), Memory(0.0, 0.0)
    start = model.started(state, memory)
    return simulate(Run(model, LAG, state, start, stimulus, TICKS * LAG.T_s, STEP, LAG.T_s))


def wish(size):
    return 1.0 + 0.3 * np.sin(0.4 * np.arange(size))


def expected(law):
    """Return y at the ticks where ``law(k, y)`` gives the drive, by the lag's exact solution.

    The scheme's substep multiplies the deviation by (1 - z) / (1 + z), z half a step over tau.
    """
    z = 0.5 * STEP / LAG.tau
    decay = ((1.0 - z) / (1.0 + z)) ** round(LAG.T_s / STEP)
    y = [0.0]
    for k in range(TICKS):
        drive = law(k, y[k])
        y.append(drive + (y[k] - drive) * decay)
    return np.array(y)


def drive(wanted, seen):
    return LAG.k * (wanted - seen) + wanted


def test_without_a_fault_it_is_the_model_inside():
    inside = Run(
        SampledLag(),
        LAG,
        State(0.0),
        Memory(0.0, 0.0),
        lambda t: wish(t.size)[:, None],
        TICKS * LAG.T_s,
        STEP,
        LAG.T_s,
    )
    plain = simulate(inside)
    np.testing.assert_array_equal(tapped().values, plain.values)


W = wish(TICKS + 1)
HELD = 20


@pytest.mark.parametrize(
    ("signals", "law"),
    [
        (
            {"tap_sensor_gain": [-0.5], "tap_sensor_offset": [0.2]},
            lambda k, y: drive(W[k], 0.5 * y + 0.2),
        ),
        ({"tap_wish_offset": np.arange(TICKS + 1) * 0.01}, lambda k, y: drive(W[k] + 0.01 * k, y)),
        ({"tap_actor_gain": [-1.0], "tap_actor_offset": [0.7]}, lambda k, y: 0.7),
        ({"tap_wish_held": np.arange(TICKS + 1) > HELD}, lambda k, y: drive(W[min(k, HELD)], y)),
    ],
    ids=["reading", "demand", "drive", "held"],
)
def test_a_tap_corrupts_as_it_is_told(signals, law):
    np.testing.assert_allclose(tapped(**signals)["y"], expected(law), rtol=0, atol=1e-12)


def test_a_drive_comes_late_and_a_task_misses_its_ticks():
    given: list[float] = [0.0] * 3  # what is under way

    def late(k, y):
        given.append(drive(W[k], y))
        return given[k]

    np.testing.assert_allclose(tapped(tap_actor_late=[1.0])["y"], expected(late), atol=1e-12)
    last = [0.0]

    def rare(k, y):
        if k % 4 == 0:
            last[0] = drive(W[k], y)
        return last[0]

    rested = tapped(**{rests("law"): [0.0, 1.0, 1.0, 1.0]})
    np.testing.assert_allclose(rested["y"], expected(rare), atol=1e-12)
    assert set(np.diff(np.flatnonzero(np.diff(rested["seen"]) != 0))) == {4}


def test_a_dead_task_has_no_memory_and_begins_anew():
    held = tapped(**{rests("law"): [0.0, 1.0, 1.0, 1.0]})
    dead = tapped(**{rests("law"): [0.0, DEAD, DEAD, DEAD]})
    # one tick of four runs: it gives what it gives, then nothing in place of the last
    runs = np.flatnonzero(np.diff(held["seen"]) != 0) + 1
    assert np.all(dead["seen"][runs] != 0.0)
    assert np.all(np.delete(dead["seen"], [0, *runs]) == 0.0)
