"""Records of current and pressure under dither, by pressure region: steps and lines of sines."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.core.errors import ParameterError
from bywire.core.typing import Array
from bywire.identification.output_error import even_interval

Complex = NDArray[np.complex128]

_LEAST = 0.1  # of the strongest line: what counts as one
_FINER = 4  # zero padding of the transform that lines are first seen in
_ROUNDS = 5  # of Newton for their frequencies
_STILL = 1e-9  # of a signal: what rounding alone moves it by
_HARMONICS = 3  # of the dither


@dataclass(frozen=True)
class Points:
    """A measured frequency response.

    Parameters
    ----------
    frequencies
        [Hz], shape (n,).
    log_gain
        Logarithm of output over input, SI: magnitude in the real, phase [rad] in the imaginary
        part; shape (n,).
    deviation
        Standard deviation of either part, from what the lines leave of both signals; shape (n,).
    """

    frequencies: Array
    log_gain: Complex
    deviation: Array


def lines(
    u: Array, interval: float, low: float, high: float, others: Sequence[float] = ()
) -> Array:
    """Return the frequencies [Hz] of a signal's sines within a band, shape (n,).

    ``u``: shape (rows,); ``interval``: sample time [s]; ``low``, ``high``: ends of the band [Hz];
    ``others``: lines outside the band, with three harmonics, such as a dither [Hz].
    """
    n = u.size
    t = _centered(n, interval)
    base = np.column_stack((_waves(_harmonics(others, interval), t), np.ones(n), t))
    flat = u - base @ np.linalg.lstsq(base, u, rcond=None)[0]
    if not np.ptp(flat) > _STILL * np.abs(u).max():
        return np.empty(0)
    size = _FINER * n
    spectrum = np.abs(np.fft.rfft(flat * np.hanning(n), size))
    f = np.fft.rfftfreq(size, interval)
    inside = (f >= low - 0.5 / (n * interval)) & (f <= high + 0.5 / (n * interval))
    if not inside.any():
        return np.empty(0)
    peaks = 1 + np.flatnonzero((spectrum[1:-1] >= spectrum[:-2]) & (spectrum[1:-1] > spectrum[2:]))
    strong = peaks[inside[peaks] & (spectrum[peaks] > _LEAST * spectrum[inside].max())]
    # A window has side lobes: what lies within the main lobe of a stronger line is no line.
    kept: list[int] = []
    for k in sorted(strong, key=lambda k: -spectrum[k]):
        if all(abs(k - other) > 2 * _FINER for other in kept):
            kept.append(int(k))
    return _refined(u, t, np.sort(f[kept]), base)


def _refined(u: Array, t: Array, frequencies: Array, base: Array) -> Array:
    """Return frequencies at which sines leave least of a signal (Gauss-Newton)."""
    w = 2.0 * math.pi * frequencies
    for _ in range(_ROUNDS):
        waves = _waves(w, t)
        k = waves.shape[1]
        a = np.linalg.lstsq(np.column_stack((waves, base)), u, rcond=None)[0][:k]
        slopes = t[:, None] * (-a[0::2] * waves[:, 1::2] + a[1::2] * waves[:, 0::2])
        all_columns = np.column_stack((slopes, waves, base))
        w = w + np.linalg.lstsq(all_columns, u, rcond=None)[0][: w.size]
    return np.asarray(w / (2.0 * math.pi))


def _centered(rows: int, interval: float) -> Array:
    return np.asarray(interval * (np.arange(rows) - 0.5 * (rows - 1)))


def _harmonics(frequencies: Sequence[float], interval: float) -> Array:
    """Return harmonics [rad/s] below half the sample rate."""
    orders = [k * f for f in frequencies for k in range(1, _HARMONICS + 1)]
    return 2.0 * math.pi * np.array([f for f in orders if f < 0.5 / interval])


def _waves(w: Array, t: Array) -> Array:
    """Return cosine and sine of every frequency [rad/s], alternating, shape (rows, 2 n)."""
    angle = np.outer(t, w)
    return np.stack((np.cos(angle), np.sin(angle)), axis=2).reshape(t.size, -1)


def _mixed(carriers: Array, alone: Array) -> Array:
    """Return carriers and their side bands [rad/s]: a dither's size follows the pressure."""
    sides = [np.concatenate((w - alone, [w], w + alone)) for w in carriers]
    return np.concatenate(sides) if sides else np.empty(0)


def measured_points(
    u: Array, y: Array, interval: float, frequencies: Array, others: Sequence[float] = ()
) -> Points:
    """Return output over input at given lines, drift and other lines taken off both.

    ``u``, ``y``: input and output in steady state, shape (rows,); ``interval``: sample time [s];
    ``frequencies``: lines [Hz]; ``others``: further lines of both signals, with three harmonics,
    such as a dither [Hz].
    """
    t = _centered(u.size, interval)
    omega = 2.0 * math.pi * frequencies
    w = np.concatenate((omega, _mixed(_harmonics(others, interval), omega)))
    columns = np.column_stack((_waves(w, t), np.ones(t.size), t))
    both = np.column_stack((u, y))
    coefficients, _, _, _ = np.linalg.lstsq(columns, both, rcond=None)
    left = both - columns @ coefficients
    variance = np.sum(left**2, axis=0) / max(u.size - columns.shape[1], 1)
    n = frequencies.size
    amplitude = coefficients[: 2 * n : 2] - 1j * coefficients[1 : 2 * n : 2]
    relative = 2.0 * variance / u.size / np.abs(amplitude) ** 2
    # Of a complex amplitude's error, half of the variance lies in each part.
    return Points(
        frequencies, np.log(amplitude[:, 1] / amplitude[:, 0]), np.sqrt(relative.sum(axis=1))
    )


# --- Records

REGIONS = ("low", "medium", "high")
BAND = (1.0, 15.0)
"""frequencies [Hz] of the paper's second step"""

_STEP = 0.9  # of the demand's variance that two levels explain: at most 0.81 for a sine
_REST = 10  # blocks of rest before a step, at least
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
