"""What the data tells of unknowns, and what it does not: singular values and correlations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bywire.identification.estimate import Estimate

Array = NDArray[np.float64]

_TOLD = 1.0  # standard deviation per scale above which nothing is known
_FLAT = 1e-7  # singular value per the largest one: below it rounding decides


def untold(found: Estimate, J: Array) -> tuple[int, str] | None:
    """Return the unknown that the data tells least, and why, if there is one."""
    share = found.singular_values[-1] / max(found.singular_values[0], 1e-300)
    told = f"smallest singular value {share:.1e} of the largest"
    silent = np.flatnonzero(~J.any(axis=0))
    if silent.size:
        return int(silent[0]), "nothing measured depends on it"
    if share < _FLAT:
        direction = np.linalg.svd(J, full_matrices=False)[2][-1]
        return int(np.argmax(np.abs(direction))), f"only a combination with others shows ({told})"
    relative = found.deviations / np.array([u.scale for u in found.unknowns])
    index = int(np.argmax(relative))
    if relative[index] <= _TOLD:
        return None
    unknown = found.unknowns[index]
    return index, (
        f"its standard deviation would be {relative[index]:.2g} times its usual magnitude "
        f"{unknown.scale:.3g} {unknown.unit} ({told})"
    )


def notes_of(found: Estimate) -> tuple[str, ...]:
    """Return what the user should know: unknowns that go together, or lie at a bound."""
    notes = [
        f"{a} and {b} go together (correlation {c:.3f}): the data tells their combination better "
        "than either"
        for a, b, c in found.correlated()
    ]
    units = {u.label: u.unit for u in found.unknowns}
    notes += [
        f"{label} lies at its bound, {end:.4g} {units[label]}"
        for label, end in found.at_bounds().items()
    ]
    return tuple(notes)
