"""Two responses to one sine: where a position loop on its current limit may stay on it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bywire.analysis.loop import LOOPS
from bywire.analysis.response.harmonics import amplitudes
from bywire.brakes.wedge.paper.frequency import changed
from bywire.core.typing import Array
from bywire.reproduction.item import Item, found
from bywire.simulation.run import simulate

AMPLITUDE, FREQUENCY, ABOVE = 1.0, 20.0, 30.0  # rad, Hz, Hz
_FALL, _SEEN = 3.0, 1.0  # s


def items() -> list[Item]:
    """Return the gain after a start from rest, and after the frequency fell from above."""
    return [
        found("fig6.jump.from_rest", "1", _gain(FREQUENCY),
              f"gain at {FREQUENCY:g} Hz and {AMPLITUDE:g} rad, from rest: below the limit"),
        found("fig6.jump.from_above", "1", _gain(ABOVE),
              f"the same after the frequency fell from {ABOVE:g} Hz within {_FALL:g} s: the loop "
              "stays on the limit"),
    ]  # fmt: skip


def _gain(begin: float) -> float:
    slope = (FREQUENCY - begin) / _FALL
    at_end = 0.5 * (begin + FREQUENCY) * _FALL

    def stimulus(t: Array) -> Array:
        falling = begin * t + 0.5 * slope * t * t
        turns = np.where(t < _FALL, falling, at_end + FREQUENCY * (t - _FALL))
        return np.column_stack([AMPLITUDE * np.sin(2.0 * math.pi * turns), 0.0 * t])

    run = LOOPS.find("screw-position").point(changed("high"), 0.0).run()
    run = replace(run, stimulus=stimulus, duration=_FALL + _SEEN)
    seen = simulate(run, ("theta_1",))
    inside = (seen.time > _FALL - 1e-9) & (seen.time < _FALL + _SEEN - 1e-9)
    angle = seen["theta_1"][inside]
    line = amplitudes(seen.time[inside], angle, FREQUENCY, 1)[0]
    return float(np.abs(line)) / AMPLITUDE
