"""What the data tells of unknowns, and what it does not: singular values and correlations."""

from __future__ import annotations

import numpy as np

from bywire.core.callers import option
from bywire.core.typing import Array
from bywire.core.units import difference_unit, shown
from bywire.identification.estimate import Estimate
from bywire.identification.noise import robust_scale

_TOLD = 1.0  # standard deviation per scale above which nothing is known
_FLAT = 1e-7  # singular value per the largest one: below it rounding decides
_FAR = 10.0  # times the noise: residuals that no noise explains
_MISFIT = 4.0  # times the noise: sensors whose noise is filtered leave up to 3
_AS_ASSUMED = (0.5, 1.5)  # times the noise that was assumed: it explains what is left
_EXACT = (
    "nothing but rounding is left: the record agrees with the model to the last digits, and its "
    "intervals do not hold for a measured record, which has noise"
)
_CONTRADICTED = 3.0  # standard deviations of a prior


class MisfitWarning(UserWarning):
    """A model leaves more than noise, or its step is too coarse: intervals do not hold."""


def misfit(estimate: Estimate) -> str:
    """Return what a model leaves that is no noise, in a sentence; empty where it is noise.

    What neighboring residuals differ by is noise; what they have in common above it is the
    model's. Where a noise was assumed and explains what is left, it is believed. What rounding or
    the step of the simulation explains says nothing of the model.
    """
    worst = max(
        (
            left
            for left in estimate.leftovers()
            if left.over_noise > _MISFIT and not left.is_numerical
        ),
        key=lambda left: left.over_noise,
        default=None,
    )
    if worst is None:
        return ""
    low, high = _AS_ASSUMED
    if worst.noise is not None and low <= worst.rms / worst.noise <= high:
        return ""
    size = shown(float(f"{worst.rms:.3g}"), difference_unit(worst.unit))
    return (
        f"{worst.label}: the model leaves {size}, {worst.over_noise:.2g} times the noise between "
        "neighboring samples: something is missing in it or wrong, and the intervals do not hold, "
        "which take what is left for chance"
    )


def untold(estimate: Estimate, J: Array) -> tuple[int, str] | None:
    """Return the unknown that the data tells least, and why, if there is one."""
    share = estimate.singular_values[-1] / max(estimate.singular_values[0], 1e-300)
    reason = f"smallest singular value {share:.1e} of the largest"
    silent = np.flatnonzero(~J.any(axis=0))
    if silent.size:
        return int(silent[0]), "nothing measured depends on it"
    if share < _FLAT:
        direction = np.linalg.svd(J, full_matrices=False)[2][-1]
        return int(np.argmax(np.abs(direction))), f"only a combination with others shows ({reason})"
    relative = estimate.deviations / np.array([u.scale for u in estimate.unknowns])
    index = int(np.argmax(relative))
    if relative[index] <= _TOLD:
        return None
    unknown = estimate.unknowns[index]
    return index, (
        f"its standard deviation would be {relative[index]:.2g} times its usual magnitude "
        f"{shown(float(f'{unknown.scale:.3g}'), difference_unit(unknown.unit))} ({reason})"
    )


def advice(estimate: Estimate, silent: bool) -> str:
    """Return what to do where the data tells nothing.

    Parameters
    ----------
    estimate
        Where the search ended, with its residuals.
    silent
        Whether it is known why nothing depends on the unknown.
    """
    left = robust_scale(estimate.residuals)
    if left > _FAR:
        return (
            f"the model does not fit, it leaves {left:.2g} times the noise at its best: check sign "
            f"and unit of what was measured ({option('mapping')}), then what is taken as known"
        )
    return "switch it on, or name another unknown" if silent else "excite the system more"


def notes_of(estimate: Estimate) -> tuple[str, ...]:
    """Return what the user should know: what goes together, lies at a bound, or off its prior."""
    notes = [
        f"{a} and {b} go together (correlation {c:.3f}): the data tells their combination better "
        "than either"
        for a, b, c in estimate.correlated()
    ]
    bounds = estimate.at_bounds()
    for u, value in zip(estimate.unknowns, estimate.values, strict=True):
        if u.label in bounds:
            notes.append(f"{u.label} lies at its bound, {shown(bounds[u.label], u.unit)}")
        if u.prior is None:
            continue
        mean, deviation = u.prior
        away = abs(float(value) - mean) / deviation
        if away > _CONTRADICTED:
            notes.append(
                f"{u.label} = {shown(float(f'{value:.4g}'), u.unit)} lies {away:.2g} deviations "
                f"of its prior ({shown(mean, u.unit)} ± "
                f"{shown(deviation, difference_unit(u.unit))}) away: the prior or the model is "
                "wrong"
            )
    if estimate.is_exact:
        notes.append(_EXACT)
    wrong = misfit(estimate)
    return (*notes, wrong) if wrong else tuple(notes)
