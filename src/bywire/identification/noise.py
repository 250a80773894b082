"""Noise of a measured signal, told from the signal itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


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
    quantized = step / np.sqrt(12.0) if 0.05 < repeated < 1.0 and step > 3.0 * scatter else 0.0
    return max(scatter, quantized)
