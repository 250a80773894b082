"""Whether two screenshots show the same: antialiasing may differ, where a part stands may not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter, uniform_filter

_NEAR = 3  # pixels of a neighborhood, in which a pixel must find its brightness
_OFF = 40  # brightness by which it may be off, of 255
_TILE = 16  # pixels of a tile
_SHARE = 0.05  # of a tile that may differ: less than a line across it


class Difference(NamedTuple):
    """The tile in which two screenshots differ most.

    Parameters
    ----------
    share
        Share of its pixels that have no counterpart, 0 to 1.
    row, column
        Its middle, in pixels of the screenshots.
    """

    share: float
    row: int
    column: int

    @property
    def is_seen(self) -> bool:
        """Whether that is more than machines differ by."""
        return self.share > _SHARE


def difference(one: np.ndarray, other: np.ndarray) -> Difference:
    """Return where two screenshots differ most; of other sizes, all of them does."""
    if one.shape != other.shape:
        return Difference(1.0, 0, 0)
    lost = _without_counterpart(one, other) | _without_counterpart(other, one)
    shares = uniform_filter(lost.astype(float), _TILE, mode="constant")
    row, column = np.unravel_index(int(np.argmax(shares)), shares.shape)
    return Difference(float(shares[row, column]), int(row), int(column))


def _without_counterpart(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the pixels of one whose brightness is nowhere near them in the other."""
    near = (_NEAR, _NEAR, 1)
    low, high = minimum_filter(other, near).astype(int), maximum_filter(other, near).astype(int)
    values = one.astype(int)
    return np.asarray(((values < low - _OFF) | (values > high + _OFF)).any(axis=2))
