"""Quality of measured channels: rate, jitter, gaps, missing values, clipped stretches.

It also reports their alignment to one time axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

GAP = 10.0
"""median steps; a longer pause is a gap by default"""

CLIPPED = 10
"""consecutive samples at the highest or lowest value that are treated as clipped if the sensor's
range is unknown; if it is known, one sample at its end is enough"""


@dataclass(frozen=True)
class Stretch:
    """A part of a channel between two times.

    Parameters
    ----------
    start
        Start [s].
    length
        Duration [s].
    samples
        Number of samples.
    """

    start: float
    length: float
    samples: int


@dataclass(frozen=True)
class ChannelQuality:
    """Quality of a channel.

    Parameters
    ----------
    samples
        Number of measured values, without NaN.
    rate
        One over the median step [Hz].
    jitter
        Maximum deviation of a step from the median step [s], without gaps.
    start, stop
        First and last measured time [s].
    gaps
        Pauses longer than the limit, from the sample before to the sample after.
    missing
        Stretches of NaN, from the measured sample before to the one after.
    clipped
        Stretches at the end of the sensor's range, or at the highest or lowest value.
    """

    samples: int
    rate: float
    jitter: float
    start: float
    stop: float
    gaps: tuple[Stretch, ...]
    missing: tuple[Stretch, ...]
    clipped: tuple[Stretch, ...]


def quality(
    time: NDArray[np.float64],
    values: NDArray[np.float64],
    *,
    max_gap: float | None = None,
    limits: tuple[float, float] | None = None,
) -> ChannelQuality:
    """Return the quality of a channel.

    Parameters
    ----------
    time
        Increasing times [s], shape ``(sample,)``.
    values
        Values, NaN where missing, shape ``(sample,)``.
    max_gap
        Longest interval that is not a gap [s]; ``GAP`` median steps by default.
    limits
        Range of the sensor, in the unit of the values.

    Raises
    ------
    ValueError
        For fewer than two measured values.
    """
    there = ~np.isnan(values)
    missing = _missing(time, there)
    whole = bool(there.all())
    t, y = (time, values) if whole else (time[there], values[there])
    if t.size < 2:
        raise ValueError(f"{t.size} measured values")
    steps = np.diff(t)
    typical = float(np.median(steps))
    longest = GAP * typical if max_gap is None else max_gap
    is_gap = steps > longest * (1.0 + 1e-9)
    gaps = [Stretch(float(t[k]), float(steps[k]), 0) for k in np.flatnonzero(is_gap)]
    regular = steps[~is_gap]
    jitter = float(np.abs(regular - typical).max()) if regular.size else 0.0
    return ChannelQuality(
        samples=int(t.size),
        rate=1.0 / typical,
        jitter=jitter,
        start=float(t[0]),
        stop=float(t[-1]),
        gaps=tuple(gaps),
        missing=tuple(missing),
        clipped=tuple(_clipped(t, y, limits)),
    )


def _missing(time: NDArray[np.float64], there: NDArray[np.bool_]) -> list[Stretch]:
    """Return the stretches of NaN between measured values."""
    stretches = []
    for first, last in _runs(~there):
        if first > 0 and last < time.size - 1:
            begin, end = float(time[first - 1]), float(time[last + 1])
            stretches.append(Stretch(begin, end - begin, last - first + 1))
    return stretches


def _clipped(
    time: NDArray[np.float64], values: NDArray[np.float64], limits: tuple[float, float] | None
) -> list[Stretch]:
    low, high = (float(values.min()), float(values.max())) if limits is None else limits
    least = CLIPPED if limits is None else 1
    if low == high:  # a constant channel does not show its range
        return []
    runs = [*_runs(values <= low), *_runs(values >= high)]
    return [
        Stretch(float(time[first]), float(time[last] - time[first]), last - first + 1)
        for first, last in sorted(runs)
        if last - first + 1 >= least
    ]


def _runs(flags: NDArray[np.bool_]) -> Sequence[tuple[int, int]]:
    """Return first and last index of every run of true."""
    if not flags.any():
        return []
    edges = np.flatnonzero(np.diff(flags.astype(np.int8), prepend=0, append=0))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


_FASTER = 0.01  # clocks of the same nominal rate differ by less


@dataclass(frozen=True)
class AlignedChannel:
    """Quality and alignment of a channel.

    Parameters
    ----------
    name
        Name of the signal.
    quality
        Its quality.
    delay
        Time by which its samples are moved to earlier times [s].
    excluded
        Number of samples of the common axis that are NaN because of its flaws.
    """

    name: str
    quality: ChannelQuality
    delay: float
    excluded: int


@dataclass(frozen=True)
class AlignmentReport:
    """Report of an alignment to one time axis.

    Parameters
    ----------
    interval
        Step of the common axis [s].
    start, stop
        First and last time of the axis [s].
    samples
        Number of times on the axis.
    method
        Method for values between samples.
    exclude
        Excluded flaws.
    channels
        Quality and alignment of each signal.
    """

    interval: float
    start: float
    stop: float
    samples: int
    method: str
    exclude: tuple[str, ...]
    channels: tuple[AlignedChannel, ...]

    @property
    def folded(self) -> tuple[str, ...]:
        """Signals sampled faster than the axis, whose fast content aliases."""
        if self.method == "average":
            return ()
        limit = (1.0 + _FASTER) / self.interval
        return tuple(channel.name for channel in self.channels if channel.quality.rate > limit)
