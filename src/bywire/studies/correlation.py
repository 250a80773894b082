"""Correlations of what varies: those of the normal scores, a Gaussian copula."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from bywire.core.errors import ParameterError
from bywire.core.typing import Array


def correlation_factor(
    names: Sequence[str], correlations: Mapping[tuple[str, str], float]
) -> Array | None:
    """Return the Cholesky factor of a correlation matrix; None where nothing is correlated.

    Raises
    ------
    ParameterError
        When no such quantities can exist: the matrix is not positive definite.
    """
    if not correlations:
        return None
    matrix = np.eye(len(names))
    for (first, second), value in correlations.items():
        i, k = names.index(first), names.index(second)
        matrix[i, k] = matrix[k, i] = value
    try:
        return np.asarray(np.linalg.cholesky(matrix))
    except np.linalg.LinAlgError:
        least = float(np.linalg.eigvalsh(matrix)[0])
        told = "; ".join(f"{a}, {b}: {value:g}" for (a, b), value in correlations.items())
        raise ParameterError(
            f"[[correlation]] {told}: no quantities can be correlated so, for the matrix is not "
            f"positive definite (least eigenvalue {least:.2g}): take values closer to zero"
        ) from None
