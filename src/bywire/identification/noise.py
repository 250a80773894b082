"""Noise of a measured signal, told from the signal itself."""

from __future__ import annotations

import numpy as np

from bywire.core.typing import Array

_ROUNDED = 0.05  # of the samples equal the one before: a converter, not the signal
_LARGER = 1.5  # times the noise
_SURE = 2.5  # standard errors of a correlation


def noise_of(values: Array) -> float:
    """Return the standard deviation of a measured signal's noise, quantization included.

    From differences of the third order, which a slow signal has not, by their median: slips do
    not count.
    """
    third = np.diff(values, 3) / np.sqrt(20.0)
    scatter = 1.4826 * float(np.median(np.abs(third)))
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0]
    step = float(steps.min()) if steps.size else 0.0
    repeated = float(np.mean(np.diff(values) == 0.0))
    quantized = step / np.sqrt(12.0) if _ROUNDED < repeated < 1.0 and step > 3.0 * scatter else 0.0
    return max(scatter, quantized)


def is_told(values: Array) -> bool:
    """Return whether the third differences of a signal look like those of noise.

    Their neighbors have a correlation of -3/4 where the noise is white. Where it tends to 1, the
    signal itself is seen; where it tends to -1, it alternates from one sample to the next: a
    coarse record, or dither near half the sample rate. What is measured is how often neighbors
    have the same sign, so that slips do not count. The noise is not told where such a signal would
    make it come out half as large again.

    Parameters
    ----------
    values
        Shape (n,). A signal that a converter has rounded repeats itself, and is not judged.
    """
    if float(np.mean(np.diff(values) == 0.0)) > _ROUNDED:
        return True
    third = np.diff(values, 3)
    product = np.sign(third[1:] * third[:-1])
    correlation = np.sin(0.5 * np.pi * float(np.mean(product)))  # of Gaussian neighbors
    reach = _SURE / np.sqrt(product.size)
    # Noise of share 1 - a, and a signal of correlation 1 or -1, make it 1 / sqrt(1 - a) times.
    a = 1.0 - 1.0 / _LARGER**2
    low, high = -max(0.25 * a, reach), max(1.75 * a, reach)
    return bool(low <= correlation + 0.75 <= high)
