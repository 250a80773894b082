"""How large residuals are when some are outliers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bywire.core.typing import Array

FAR = 4.0  # standard deviations: of white noise 1 in 16 000 lies beyond


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
