"""Noise of a measured signal, told from itself; how large residuals are when some are outliers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bywire.core.typing import Array

_ROUNDED = 0.05  # of the samples equal the one before: a converter, not the signal
_LARGER = 1.5  # times the noise
_SURE = 2.5  # standard errors of a correlation
FAR = 4.0  # standard deviations: of white noise 1 in 16 000 lies beyond


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


def robust_scale(residuals: Array) -> float:
    """Return the standard deviation that the median magnitude tells, were they Gaussian.

    About zero, not about their median: an offset that a model leaves is an error of its own.

    References
    ----------
    P. J. Huber, Robust Statistics, 1981, section 5.1 (median absolute deviation).
    """
    return 1.4826 * float(np.median(np.abs(residuals)))


def outliers(residuals: Array) -> NDArray[np.bool_]:
    """Return which residuals, of size one where the noise is as assumed, are none of noise.

    Shape (n,); where all are larger than assumed, those that stand out from the others.
    """
    return np.asarray(np.abs(residuals) > FAR * max(robust_scale(residuals), 1.0))
