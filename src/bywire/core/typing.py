"""Types for signatures in all rooms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

Progress = Callable[[str, float], None]
"""function that is called with a label and the finished fraction, 0 to 1"""


def silent(label: str, share: float) -> None:
    """Show no progress."""
