"""When a controller is at a limit, told from its recorded demands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bywire.core.typing import Array

_ROUNDING = 1e-12  # share of a limit by which a demand clipped to it may differ


@dataclass(frozen=True)
class Saturation:
    """A limit that a model does not record as a mode of its own.

    Parameters
    ----------
    name
        What its share of the time is called, for instance ``"sat_current"``.
    signals
        Outputs that are limited; one at its limit is enough.
    limits
        Dotted names of the parameters that limit the magnitude; the smallest one does.
    """

    name: str
    signals: tuple[str, ...]
    limits: tuple[str, ...]

    def share(self, values: Array, matrix: Array, names: Sequence[str]) -> Array:
        """Return the share of the time at the limit, shape (cases,).

        Parameters
        ----------
        values
            The signals, shape (cases, rows, signals).
        matrix, names
            Parameter vectors, shape (parameters, cases), and the names of their rows.
        """
        limit = matrix[[names.index(name) for name in self.limits]].min(axis=0)
        at = np.abs(values) >= (1.0 - _ROUNDING) * limit[:, None, None]
        return np.asarray(at.any(axis=2).mean(axis=1))
