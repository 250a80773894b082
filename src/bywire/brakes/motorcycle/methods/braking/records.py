"""Records of current and pressure under dither, sorted by pressure region, steps and sines."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from bywire.brakes.motorcycle.methods.braking.sine_lines import Points, lines, measured_points
from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.identification.output_error import even_interval

REGIONS = ("low", "medium", "high")
BAND = (1.0, 15.0)
"""frequencies [Hz] of the paper's second step"""

_STEP = 0.9  # of the demand's variance that two levels explain: at most 0.81 for a sine
_REST = 10  # blocks of rest before a step, at least
_STILL = 1e-9  # of a current: what rounding alone moves it by
_LONGEST = 0.1  # s: mean over dither periods


@dataclass(frozen=True)
class StepRecord:
    """A step of the current from rest, dither averaged.

    Parameters
    ----------
    label
        Name of the record.
    u
        Current less its mean before the step [A], its moving average over a block, from the end
        of the first block on, shape (n - block + 1,).
    interval
        Sample time [s].
    block
        Samples over which the pressure is averaged: whole dither periods.
    pressure
        Mean pressure of every block [Pa], shape (n // block,).
    rest
        Mean pressure before the step [Pa].
    sigma
        Standard deviation of a block's noise [Pa].
    sigma_i
        Standard deviation of a sample's noise of the current [A].
    before
        Samples before the step.
    """

    label: str
    u: Array
    interval: float
    block: int
    pressure: Array
    rest: float
    sigma: float
    sigma_i: float
    before: int


@dataclass(frozen=True)
class Region:
    """All records of a pressure region.

    ``name``: ``low``, ``medium`` or ``high``; ``steps``: records of steps; ``points``: frequency
    response of the records of sines, all together; ``pressure``: mean pressure [Pa].
    """

    name: str
    steps: tuple[StepRecord, ...]
    points: Points
    pressure: float


def regions_of(
    records: Mapping[str, xr.Dataset], borders: tuple[float, float], f_dit: float | None
) -> tuple[Region, ...]:
    """Return the records sorted.

    Parameters
    ----------
    records
        ``i`` [A] and ``p_mc`` [Pa] over ``time`` [s], by label. A record is a step where two
        levels explain its current, else sines: one, or several at once, in steady state.
    borders
        Between low and medium, and medium and high pressure [Pa].
    f_dit
        Frequency of the dither [Hz]; None where it is off.

    Raises
    ------
    ParameterError
        When time is not evenly spaced, a dither period is no whole number of samples, a step has
        no rest before it, or a record has neither step nor sine.
    """
    steps: dict[str, list[StepRecord]] = {name: [] for name in REGIONS}
    points: dict[str, list[Points]] = {name: [] for name in REGIONS}
    levels: dict[str, list[float]] = {name: [] for name in REGIONS}
    for label, data in records.items():
        i, p = data["i"].values, data["p_mc"].values
        interval = even_interval(data["time"].values)
        block = block_of(interval, f_dit)
        mean = float(p.mean())
        region = REGIONS[int(np.searchsorted(borders, mean, side="right"))]
        levels[region].append(mean)
        i_mean = averaged(i, block)
        onset = step_at(i_mean)
        if onset is not None:
            steps[region].append(_step(label, i, p, interval, block, onset))
        else:
            points[region].append(_sines(label, i, p, interval, f_dit))
    return tuple(
        Region(name, tuple(steps[name]), _together(points[name]), float(np.mean(levels[name])))
        for name in REGIONS
        if levels[name]
    )


def block_of(interval: float, f_dit: float | None) -> int:
    """Return how many samples make whole dither periods.

    Raises
    ------
    ParameterError
        When no few periods do.
    """
    if f_dit is None:
        return max(round(0.02 / interval), 1)
    for periods in range(1, max(int(_LONGEST * f_dit), 1) + 1):
        samples = periods / (f_dit * interval)
        if round(samples) >= 2 and abs(samples - round(samples)) < 1e-3:
            return round(samples)
    raise ParameterError(
        f"no dither period of {1.0 / f_dit:g} s, nor a few of them, is a whole number of samples "
        f"of {interval:g} s: its ripple cannot be averaged; resample the record to 1 kHz"
    )


def averaged(values: Array, block: int) -> Array:
    """Return the mean of every block, shape (n // block,)."""
    count = values.size // block
    return np.asarray(values[: count * block].reshape(count, block).mean(axis=1))


def moving_average(values: Array, block: int) -> Array:
    """Return the mean over the last samples, from the first whole block on.

    Current and pressure averaged alike are related as they are themselves, without the dither.
    """
    return np.convolve(values, np.full(block, 1.0 / block), mode="valid")


def step_at(means: Array) -> int | None:
    """Return the block before which two levels part a current best; None where it is no step."""
    n = means.size
    if n < 3:
        return None
    total = np.sum((means - means.mean()) ** 2)
    k = np.arange(1, n)
    left = np.cumsum(means)[:-1]
    between = (left - k * means.mean()) ** 2 * n / (k * (n - k))
    best = int(np.argmax(between))
    moves = np.ptp(means) > _STILL * np.abs(means).max()
    return best + 1 if moves and between[best] > _STEP * total else None


def _step(label: str, i: Array, p: Array, interval: float, block: int, onset: int) -> StepRecord:
    rest = onset - 1  # the block in which it steps belongs to neither level
    if rest < _REST:
        raise ParameterError(
            f"record {label or 'of the step'} rests for {max(rest, 0) * block * interval:g} s "
            f"before its step: it must be >= {_REST * block * interval:g} s, so that the pressure "
            "it starts from is known; record more before the step"
        )
    before = slice(0, rest * block)
    means = averaged(p, block)
    noise = _around_line(averaged(i[before], block)) * math.sqrt(block)
    return StepRecord(
        label,
        moving_average(i - float(i[before].mean()), block),
        interval,
        block,
        means,
        float(p[before].mean()),
        _scatter(means),
        noise,
        rest * block,
    )


def _scatter(means: Array) -> float:
    """Return the noise of slowly varying values, from their second differences."""
    second = np.diff(means, 2)
    return max(float(np.median(np.abs(second))) / (0.6745 * math.sqrt(6.0)), 1e-9)


def _around_line(means: Array) -> float:
    """Return the noise of values that drift at most."""
    k = np.arange(means.size)
    left = means - np.polyval(np.polyfit(k, means, 1), k)
    return math.sqrt(float(left @ left) / (means.size - 2))


def _sines(label: str, i: Array, p: Array, interval: float, f_dit: float | None) -> Points:
    others = () if f_dit is None else (f_dit,)
    spectrum = lines(i, interval, *BAND, others)
    if not spectrum.size:
        raise ParameterError(
            f"the current of record {label} neither steps nor has a sine within {BAND[0]:g} and "
            f"{BAND[1]:g} Hz: nothing can be learned from it; step or shake the current demand"
        )
    return measured_points(i, p, interval, spectrum, others)


def _together(points: Sequence[Points]) -> Points:
    if not points:
        return Points(np.empty(0), np.empty(0, complex), np.empty(0))
    f, log_gain, deviation = (
        np.concatenate([getattr(points_of, name) for points_of in points])
        for name in ("frequencies", "log_gain", "deviation")
    )
    order = np.argsort(f)
    return Points(f[order], log_gain[order], deviation[order])
