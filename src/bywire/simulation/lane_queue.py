"""Cases that share the lanes of a vector in turn: where a case has ended, the next one begins."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from bywire.core.typing import Array, Complex


class Lanes:
    """Cases side by side, window after window.

    Parameters
    ----------
    queue
        Cases that wait, shared by all who take from it.
    width
        Number of lanes.
    matrix, starts
        Parameters and state vectors of all cases at their start, shapes (parameters, cases) and
        (entries, cases).

    Attributes
    ----------
    columns, vector
        The same of the cases in the lanes, shapes (parameters, lanes) and (entries, lanes).
    case
        Which case each lane holds, shape (lanes,).
    seen
        By lane whose case has not ended, the figures of all its windows. Other lanes run along
        unread, for a vector has no shorter form.
    """

    def __init__(self, queue: deque[int], width: int, matrix: Array, starts: Array) -> None:
        self._queue, self._matrix, self._starts = queue, matrix, starts
        self.columns = np.empty((matrix.shape[0], width))
        self.vector = np.empty((starts.shape[0], width))
        self.case: NDArray[np.int64] = np.zeros(width, dtype=np.int64)
        self.seen: dict[int, list[Complex]] = {}
        for lane in range(width):
            if not self._took(lane) and self.seen:
                self._load(lane, int(self.case[0]))

    def passed(self, figures: Complex, tolerance: float, most: int) -> dict[int, bool]:
        """Take up a window's figures, and return the lanes whose case has ended: if it repeats.

        Parameters
        ----------
        figures
            Shape (lanes, n).
        tolerance, most
            See `repetition.repeat`.
        """
        ended = {}
        for lane, seen in self.seen.items():
            seen.append(figures[lane])
            repeats = len(seen) > 1 and _same(seen[-2], seen[-1], tolerance)
            if repeats or len(seen) == most:
                ended[lane] = repeats
        return ended

    def release(self, lane: int) -> None:
        """Let the next case into a lane whose case has ended."""
        del self.seen[lane]
        self._took(lane)

    def _took(self, lane: int) -> bool:
        try:
            self._load(lane, self._queue.popleft())
        except IndexError:  # another thread may have taken the last one
            return False
        self.seen[lane] = []
        return True

    def _load(self, lane: int, case: int) -> None:
        self.case[lane] = case
        self.columns[:, lane], self.vector[:, lane] = self._matrix[:, case], self._starts[:, case]


def _same(before: Complex, now: Complex, tolerance: float) -> bool:
    """Return whether a window repeats the one before; what does not move at all repeats."""
    return bool(np.linalg.norm(now - before) <= tolerance * np.linalg.norm(now))
