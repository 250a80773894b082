"""What the step does to a measured response: the same response in half steps beside it."""

from __future__ import annotations

import numpy as np
import xarray as xr

from bywire.core.typing import Array

FIGURES = (
    "gain",
    "phase",
    "bandwidth",
    "crossover",
    "phase_margin",
    "gain_margin",
    "lower_gain_margin",
)
"""what gets an error; phases and margins in degree"""


def with_step_errors(response: xr.Dataset, finer: xr.Dataset, share: float) -> xr.Dataset:
    """Return a measured response with the error that its figures have from the step.

    Parameters
    ----------
    response
        Response with its widths; see `bywire.analysis.response.large_signal.with_widths`.
    finer
        The same in smaller steps.
    share
        Error over the difference of both; see `bywire.bench.step_error.of_difference`.

    Returns
    -------
    xarray.Dataset
        With ``NAME_step_error`` beside each figure, in its unit: NaN where neither of both has it,
        infinite where one has. What never repeats counts, too: a limit cycle's gain differs.
    """
    return response.assign(
        {
            f"{name}_step_error": (
                response[name].dims,
                share * _apart(response[name].values, finer[name].values, name),
                dict(response[name].attrs),
            )
            for name in FIGURES
        }
    )


def _apart(value: Array, other: Array, name: str) -> Array:
    """Return distances; a phase has no whole turns, what lies beyond the band twice none either."""
    with np.errstate(invalid="ignore"):
        apart = np.abs(value - other)
    if name == "phase":
        apart = np.abs(np.mod(apart + 180.0, 360.0) - 180.0)
    apart = np.where(
        np.isnan(value) & np.isnan(other), np.nan, np.nan_to_num(apart, nan=np.inf, posinf=np.inf)
    )
    return np.where(np.isinf(value) & np.isinf(other), 0.0, apart)


def largest(response: xr.Dataset) -> str:
    """Return how large the errors from the step are at most, in a sentence; empty for none."""
    if "gain_step_error" not in response:
        return ""
    with np.errstate(invalid="ignore"):
        relative = response["gain_step_error"].values / response["gain"].values
    known = relative[np.isfinite(relative)]
    if not known.size:
        return ""
    decibel = 20.0 * float(np.log10(1.0 + known.max()))
    phase = response["phase_step_error"].values
    degree = float(phase[np.isfinite(phase)].max())
    return f"error from the step: up to {decibel:.1g} dB and {degree:.1g}°"
