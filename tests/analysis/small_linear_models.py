"""Linear models written down as matrices."""

from __future__ import annotations

import numpy as np

from bywire.analysis.linear.linear_model import LinearModel


def model_of(A, B, C, D=None, period: float = 0.0) -> LinearModel:
    """Return a model of plain matrices; its signals are called x0, u0, y0 and so on."""
    A, B, C = (np.atleast_2d(np.asarray(M, dtype=float)) for M in (A, B, C))
    D = np.zeros((len(C), B.shape[1])) if D is None else np.atleast_2d(np.asarray(D, dtype=float))
    names = [
        tuple(f"{kind}{k}" for k in range(n))
        for kind, n in (("x", len(A)), ("u", B.shape[1]), ("y", len(C)))
    ]
    units = [("1",) * len(one) for one in names]
    return LinearModel("m", A, B, C, D, *names, *units, np.zeros(len(A)), period)
