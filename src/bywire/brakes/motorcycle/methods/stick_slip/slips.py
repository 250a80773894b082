"""Stick-slip in a measured signal: slips, cut out of a record with what lies around them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import state_at
from bywire.core.callers import option
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.identification.measured import noise_of

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


# --- Shots: slips with what lies around them

LEAD = 0.05
"""rest before the measured onset [s]"""
BEFORE = 0.01
"""rest before the model breaks away [s]"""
_LEAST = 8  # samples
_COARSEST = 4e-3  # s
_RESTED = 1.0  # s of rest from which its pressure and the ramp of the current are read
_COMPARED = 0.9  # of a slip's way: its end, like its beginning, is up to the current's ripple
_SMOOTHED = 0.02  # s
_SEEN = 0.016  # s: over which the current is read, short as its ripple moves it


@dataclass(frozen=True)
class Shot:
    """A measured slip.

    Parameters
    ----------
    slip
        Where it lies.
    time, pressure, current
        Measured around it, from a little before its onset; shape (n,), SI.
    rate
        Of the current's ramp while the piston rested [A/s].
    unrest
        Standard deviation of the current from that ramp [A].
    before, slope
        Level [A] and rate [A/s] of the current at each time, from a line through what was
        measured shortly before it; shape (n,).
    seen
        How many samples that line goes through.
    steep
        Rows in which the first half of the way is made.
    """

    slip: Slip
    time: Array
    pressure: Array
    current: Array
    rate: float
    unrest: float
    before: Array
    slope: Array
    seen: int
    steep: int

    @property
    def interval(self) -> float:
        """Sample time [s]."""
        return float(f"{self.time[1] - self.time[0]:.9g}")

    @property
    def clock(self) -> Array:
        """Time since the first row [s], shape (n,)."""
        return np.arange(self.time.size, dtype=float) * self.interval


def cut_out(
    time: Array, pressure: Array, current: Array, slips: Sequence[Slip], longest: float
) -> list[Shot]:
    """Return the measured slips with what lies around them, up to the next onset.

    Left out are those of too few samples, those without a rest before, and those that no ramp of
    the current brought about.

    Raises
    ------
    ParameterError
        When none is left, or the sample time is too long for their beginnings.
    """
    interval = float(time[1] - time[0])
    if interval > _COARSEST:
        raise ParameterError(
            f"a sample every {1e3 * interval:.3g} ms does not show how slips begin: measure at "
            f"{1.0 / _COARSEST:g} Hz or faster"
        )
    shots = []
    lead, most, rested = (int(span / interval) for span in (LEAD, longest, _RESTED))
    seen = max(round(_SEEN / interval), 4)
    smooth = moving_mean(pressure, max(round(_SMOOTHED / interval), 1))
    for k, slip in enumerate(slips):
        first = max(slip.begin - lead, 0)
        until = slips[k + 1].begin - lead if k + 1 < len(slips) else time.size
        compared, half = (_passed(smooth, slip, 2 * lead, share) for share in (_COMPARED, 0.5))
        last = min(compared, slip.begin + most, until)
        rest = slice(max(slip.begin - rested, slips[k - 1].end + lead if k else 0), slip.begin)
        if min(last - first, rest.stop - rest.start) < _LEAST:
            continue
        rows = slice(first, last)
        level, slope = _lines_before(current, first, last, seen)
        line = np.polynomial.Polynomial.fit(time[rest], current[rest], 1)
        unrest = float(np.std(current[rest] - line(time[rest])))
        rate = float(line.deriv()(time[first]))
        if rate * slip.direction <= 0.0:
            continue
        from_rest = replace(slip, rest=float(pressure[rest].mean()))
        shot = Shot(
            from_rest,
            time[rows],
            pressure[rows],
            current[rows],
            rate,
            unrest,
            level,
            slope / interval,
            seen,
            min(half, last) - first,
        )
        shots.append(shot)
    if not shots:
        raise ParameterError(
            f"none of the {len(slips)} slips has {_LEAST} samples, a rest before it, and a current "
            "that ramps toward it: they are noise, or the signal's unit is wrong; check the unit, "
            "and raise what counts as a slip "
            f"({option('options', {'least': '...'})})"
        )
    return shots


def _passed(values: Array, slip: Slip, rest: int, share: float) -> int:
    """Return the sample at which a slip has gone a share of its way.

    Of smoothed values: the first of noisy ones beyond is there by its noise, and would pull.
    """
    end = float(values[slip.end : slip.end + rest].mean())
    beyond = slip.direction * (values[slip.begin :] - slip.rest) > share * abs(end - slip.rest)
    return slip.begin + int(np.argmax(beyond))


def _lines_before(values: Array, first: int, last: int, seen: int) -> tuple[Array, Array]:
    """Return level, and change per sample, at each sample of a line through those before it."""
    at = np.arange(1 - seen, 1, dtype=float)
    centered = at - at.mean()
    slope = centered / (centered @ centered)
    level = 1.0 / seen - at.mean() * slope
    padded = np.concatenate((np.full(max(seen - 1 - first, 0), values[0]), values[:last]))
    windows = np.lib.stride_tricks.sliding_window_view(padded[-(last - first + seen - 1) :], seen)
    return np.asarray(windows @ level), np.asarray(windows @ slope)


def onset_of(shot: Shot, shift: float) -> tuple[float, float]:
    """Return level [A] and rate [A/s] of the measured current at an instant of a shot.

    The rate is no slower than the ramp's: what brings the piston to breaking away drives it on.
    """
    level, slope = (float(np.interp(shift, shot.clock, v)) for v in (shot.before, shot.slope))
    way = float(np.sign(shot.rate)) or float(shot.slip.direction)
    return level, way * max(way * slope, way * shot.rate)


def require_calm(shots: Sequence[Shot], noise: float, most: float) -> None:
    """Refuse a current that does not follow its ramp while the piston rests.

    ``noise``: standard deviation of the current's measurement [A]; ``most``: largest standard
    deviation beside it [A].
    """
    unrest = float(np.median([np.sqrt(max(s.unrest**2 - noise**2, 0.0)) for s in shots]))
    if unrest > most:
        raise ParameterError(
            f"between the slips the current varies by {unrest:.3g} A (standard deviation) around "
            f"its ramp; at most {most:.3g} A make sense: switch the dither off, and check the "
            "unit of i"
        )


def require_reachable(shots: Sequence[Shot], par: MotorcycleParameters) -> None:
    """Refuse rests at a pressure that the brake of these parameters cannot hold."""
    highest = max(shot.slip.rest for shot in shots)
    try:
        state_at(max(highest, 0.0), par)
    except ParameterError as error:
        raise ParameterError(
            f"the measured pressure rests at {highest / 1e5:.4g} bar, which this brake cannot "
            f"hold: check the unit of p_mc, and the parameters ({error})"
        ) from None
