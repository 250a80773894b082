"""Frequency response at the lines that a record's input has: amplitudes by least squares."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bywire.core.typing import Array

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
