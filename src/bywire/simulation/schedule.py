"""Schedule of a run, whose steps must divide the sample times, and layout of the state vector."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bywire.core.errors import StepError, not_valid
from bywire.core.units import shown, written_unit

_TOLERANCE = 1e-9
_REST = 1e-6  # maximum deviation of an interval from whole steps, relative to a step
_MOST = 2**53  # maximum number of substeps in an interval or a run, which floats can represent
_FRAME = (
    100_000  # maximum number of substeps in a frame, because interrupts are checked between frames
)
_SHORTER = 100  # a proposed step is at most this many times shorter than the rejected one
_TRIALS = 10_000  # number of divisors to try in the search for one with few digits


@dataclass(frozen=True)
class Schedule:
    """Schedule of a run in integer multiples of the step.

    A frame is the longest interval that divides all sample times and the recording interval, or a
    fraction of this interval if it is very long. A frame has ``substeps`` equal steps.

    Parameters
    ----------
    step
        Length of a substep [s].
    substeps
        Substeps per frame.
    frames
        Frames of the run.
    task_frames
        Frames per tick of each task, in the order of the tasks.
    record_frames
        Frames per recorded row.
    """

    step: float
    substeps: int
    frames: int
    task_frames: tuple[int, ...]
    record_frames: int

    @property
    def stimulus_frames(self) -> int:
        """Frames per row of the stimulus: the greatest common divisor of all tasks' intervals."""
        return math.gcd(*self.task_frames)

    @property
    def stimulus_rows(self) -> int:
        """Number of rows of the stimulus, including the end."""
        return self.frames // self.stimulus_frames + 1

    @property
    def rows(self) -> int:
        """Number of recorded rows, including start and end."""
        return self.frames // self.record_frames + 1

    @property
    def frame(self) -> float:
        """Length of a frame [s]."""
        return self.step * self.substeps

    @property
    def stimulus_times(self) -> NDArray[np.float64]:
        """Times of the stimulus rows [s]."""
        interval = self.stimulus_frames * self.frame
        return np.arange(self.stimulus_rows, dtype=np.float64) * interval

    @property
    def record_times(self) -> NDArray[np.float64]:
        """Times of the recorded rows [s]."""
        return np.arange(self.rows, dtype=np.float64) * (self.record_frames * self.frame)


def plan(duration: float, step: float, periods: Mapping[str, float], record: float) -> Schedule:
    """Divide a run into frames.

    Parameters
    ----------
    duration
        Length of the run [s], rounded up to whole recording intervals.
    step
        Substep [s].
    periods
        Sample time [s] of each task.
    record
        Recording interval [s].

    Raises
    ------
    StepError
        When the step does not divide a sample time or the recording interval, or is much too short.
    """
    return _planned(duration, step, tuple(periods.items()), record)


@lru_cache(maxsize=256)  # each case of a study requests the same plan several times
def _planned(
    duration: float, step: float, periods: tuple[tuple[str, float], ...], record: float
) -> Schedule:
    if not (math.isfinite(step) and step > 0):
        raise not_valid("step", f"{step:g} s", "> 0 s", "usually 20 us", StepError)
    if not (math.isfinite(duration) and duration > 0):
        raise not_valid("duration", f"{duration:g} s", "> 0 s", kind=StepError)
    intervals = (*(period for _, period in periods), record)
    counts = {name: _whole(period, step, name, intervals) for name, period in periods}
    recorded = _whole(record, step, "recording", intervals)
    frame = _divided(math.gcd(recorded, *counts.values()))
    rows = math.ceil(duration / record - _TOLERANCE)
    return Schedule(
        step=step,
        substeps=frame,
        frames=rows * (recorded // frame),
        task_frames=tuple(count // frame for count in counts.values()),
        record_frames=recorded // frame,
    )


def longest_step(intervals: Iterable[float]) -> float:
    """Return the longest step [s] that divides several intervals.

    Examples
    --------
    >>> longest_step([1e-3, 2e-4, 1 / 3000])
    6.66666666666667e-05
    """
    first, *others = intervals
    common = first
    for each in others:
        rest = each
        while rest > _REST * first:
            common, rest = rest, abs(math.remainder(common, rest))
    return float(f"{first / round(first / common):.15g}")


def _divided(frame: int) -> int:
    """Return the largest divisor of a frame's number of substeps within the limit."""
    shares = range(-(-frame // _FRAME), math.isqrt(frame) + 1)
    share = next((each for each in shares if frame % each == 0), frame)
    return frame // share


def _require_few(name: str, length: float, step: float) -> None:
    if length / step > _MOST:
        raise StepError(
            f"step = {shown(step, 's')} is too short for the {name} interval of "
            f"{shown(length, 's')}, which would contain more than {_MOST:.2g} steps. Use a shorter "
            "interval",
            name="step",
            value=shown(step, "s"),
            valid=f"{_MOST:.2g} steps",
        )


def _whole(period: float, step: float, name: str, intervals: Sequence[float]) -> int:
    _require_few(name, period, step)
    count = round(period / step)
    rest = abs(count * step - period)
    rounding = _REST * step + 4.0 * math.ulp(period)
    if count < 1 or rest > min(_TOLERANCE * period, rounding):
        # The error uses the unit in which the user wrote the step or the interval.
        texts = (getattr(each, "text", "") for each in (step, period))
        unit = next(filter(None, (written_unit(text, "s") for text in texts)), "")
        value = shown(step, "s", unit)
        valid = shown(_proposed(period, step, intervals), "s", unit, digits=15)
        raise StepError(
            f"step = {value} does not divide the {name} interval of "
            f"{shown(period, 's', unit, digits=12)}. For example, use {valid}, or an interval "
            f"that is a multiple of {value}",
            name="step",
            value=value,
            valid=valid,
        )
    return count


def _proposed(period: float, step: float, intervals: Sequence[float]) -> float:
    """Return a step [s] that divides all intervals of a run, or only one if it would be tiny."""
    whole = [Fraction(f"{each:.15g}") * 10**9 for each in intervals]
    if all(each.denominator == 1 for each in whole):
        common = _divisor(math.gcd(*(int(each) for each in whole)) / 1e9, step)
        if common * _SHORTER >= step:
            return common
    return _divisor(period, step)


def _divisor(period: float, step: float) -> float:
    """Return a step [s] with few digits that divides a period and is not longer than a step.

    If possible, the result is a whole number of nanoseconds, which divides a period of whole
    nanoseconds.
    """
    least = max(math.ceil(period / step - _TOLERANCE), 1)
    whole, longest = (Fraction(f"{time:.15g}") * 10**9 for time in (period, step))
    if whole.denominator == 1:
        if longest <= _TRIALS:
            shorter: Iterable[int] = range(math.floor(longest), 0, -1)
        else:
            counts = range(least, min(8 * least + 8, least + _TRIALS))
            shorter = (int(whole / count) for count in counts if whole % count == 0)
        for each in shorter:
            if whole % each == 0:
                return each / 1e9
    return period / least


# --- The state vector

COUNTERS = 3  # at the end of the state vector, see `Layout`
CAP = 8  # passes through one substep before it is treated as unsettled
JUMP, FLAG, DOUBT = 4, 5, 6  # indices among the results of a pass, after x, d, r, q
# Search for the time at which a substep is cut: maximum number of attempts; remaining velocity at
# which the search ends, or is close enough for linear interpolation, relative to the substep's
# change of velocity; and minimum fraction of a part before and after the cut.
ATTEMPTS, CLOSE, NEAR, EDGE = 12, 1e-12, 1e-9, 1e-9
STILL = 1e-9  # fraction of its initial value below which another velocity is also treated as zero


def most_cuts(velocities: int) -> int:
    """Return the number of parts after which a substep is treated as unsettled.

    Each velocity with dry friction may reverse, and may reverse again after other velocities have
    reversed.
    """
    return 2 * velocities + 2


@dataclass(frozen=True)
class Layout:
    """Start of each part of the state vector.

    The vector contains x, d, r, q, the memory m, and three counters: unsettled substeps, repeated
    substeps, and attempted parts of these substeps.
    """

    start: dict[str, int]
    length: dict[str, int]

    @property
    def total(self) -> int:
        """Length of the state vector."""
        return self.start["counters"] + COUNTERS
