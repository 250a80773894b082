"""Stick-slip in a measured signal: where it rests, where it slips, and which way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bywire.core.typing import Array
from bywire.identification.noise import noise_of

_WINDOW = 0.02  # s: over which a change counts as motion
_SURE = 6.0  # standard deviations of that change
_OVER_NOISE = 6.0  # standard deviations of the rest before: smaller changes are its noise
_PAUSE = 0.05  # s: shorter rests belong to the slip around them


@dataclass(frozen=True)
class Slip:
    """A stretch of motion between two rests.

    ``begin``, ``end``: samples at which the motion begins and ends (or the record does);
    ``direction``: 1 for rising, -1 for falling; ``rest``: level at which the signal rested before.
    """

    begin: int
    end: int
    direction: int
    rest: float


def find_slips(values: Array, interval: float, least: float) -> list[Slip]:
    """Return the slips of a signal.

    ``values``: shape (n,); ``interval``: sample time [s]; ``least``: changes smaller than this are
    no slips, nor such as the noise of the rest before makes.
    """
    width = max(round(_WINDOW / interval), 1)
    smooth = moving_mean(values, width)
    change = np.zeros(values.size)
    change[width:-width] = smooth[2 * width :] - smooth[: -2 * width]
    threshold = max(_SURE * noise_of(values) * np.sqrt(2.0 / width), 0.01 * least)
    moving = np.abs(change) > threshold
    slips = []
    for begin, end in _stretches(moving, int(_PAUSE / interval)):
        for first, last in _one_way(smooth, begin, end, least):
            before = values[max(first - 5 * width, 0) : max(first - width, 1)]
            if before.size < width:
                continue  # what it rested at was not measured
            travel = smooth[min(last, values.size - 1)] - before.mean()
            if abs(travel) >= max(least, _OVER_NOISE * float(before.std())):
                direction = 1 if travel > 0 else -1
                slips.append(Slip(first, last, direction, float(before.mean())))
    return slips


def moving_mean(values: Array, width: int) -> Array:
    """Return the mean of so many samples around each, shape (n,)."""
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.ones(width) / width, mode="valid")


def _stretches(moving: NDArray[np.bool_], pause: int) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], moving.astype(int), [0]))))
    stretches: list[tuple[int, int]] = []
    for begin, end in edges.reshape(-1, 2).tolist():
        if stretches and begin - stretches[-1][1] <= pause:
            stretches[-1] = (stretches[-1][0], end)
        else:
            stretches.append((begin, end))
    return stretches


def _one_way(values: Array, begin: int, end: int, least: float) -> list[tuple[int, int]]:
    """Split a stretch where it turns back by more than what counts as a slip."""
    part = values[begin:end]
    top, low = int(np.argmax(part)), int(np.argmin(part))
    rise, fall = part[top] - part[0], part[0] - part[low]
    if top > 0 and rise > least and part[top] - part[-1] > least:
        return [(begin, begin + top), *_one_way(values, begin + top, end, least)]
    if low > 0 and fall > least and part[-1] - part[low] > least:
        return [(begin, begin + low), *_one_way(values, begin + low, end, least)]
    return [(begin, end)]
