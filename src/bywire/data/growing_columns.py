"""Columns of a length that only reading tells, within little more memory than they need."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_GROWTH = 1.25


class GrowingColumns:
    """Columns of numbers that grow block by block.

    Parameters
    ----------
    count
        How many columns.
    rows
        How many rows are expected.
    """

    def __init__(self, count: int, rows: int) -> None:
        self._arrays = [np.empty(max(rows, 1)) for _ in range(count)]
        self._rows = 0

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return self._rows

    def append(self, blocks: Sequence[NDArray[np.float64]]) -> None:
        """Add a block of rows, an array of shape ``(row,)`` for each column."""
        end = self._rows + len(blocks[0])
        for array, block in zip(self._arrays, blocks, strict=True):
            if end > len(array):
                # The system moves the pages: no second copy of the column is ever made.
                array.resize(max(end, int(_GROWTH * len(array))), refcheck=False)
            array[self._rows : end] = block
        self._rows = end

    def finished(self) -> list[NDArray[np.float64]]:
        """Return the columns at their length."""
        for array in self._arrays:
            array.resize(self._rows, refcheck=False)
        return self._arrays
