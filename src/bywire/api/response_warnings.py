"""What a user of a measured response should know of it: what left, stuck, or never repeated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.analysis.margins import NO_LOOP
from bywire.analysis.response.large_signal import Variant, leaving
from bywire.report.wording import amount


def response_warnings(
    response: xr.Dataset, variants: Sequence[Variant], unit: str, tolerance: float
) -> list[str]:
    """Return what left the brake's range, what stuck, and what never repeated.

    Parameters
    ----------
    response
        Response.
    variants
        Its cases.
    unit
        SI unit of the amplitudes.
    tolerance
        Share within which a window had to repeat the one before.
    """
    texts = []
    empty = [variant for variant in variants if not variant.has_loop]
    if empty:
        count = f" at {len(empty)} of {len(variants)} values" if len(variants) > 1 else ""
        texts.append(f"{NO_LOOP}{count}; crossover and margins are not defined")
    for k, size in enumerate(response["amplitude"].values):
        row = response.isel(amplitude=k)
        label = f"amplitude {amount(float(size), unit, 3)}"
        reasons = (leaving(case.loop, case.par, case.value, float(size)) for case in variants)
        if reason := next(filter(None, reasons), ""):
            texts.append(f"{label}: it asks for set points out of the brake's range: {reason}")
        still, restless = np.isnan(row["gain"].values), row["settled"].values == 0
        if still.any():
            texts.append(f"{label}: the output sticks at {_cases(response, still)}: no gain")
        shaken = restless & ~still
        if shaken.any():
            scatter = float(np.nanmax(row["scatter"].values[shaken]))
            cases = _cases(response, shaken)
            texts.append(
                f"{label}: no window repeats the one before within {100 * tolerance:g} % at "
                f"{cases} (a limit cycle, a drift, or the encoder's resolution): "
                "shown are means of the last windows; their root mean square distance from the "
                f"mean is up to {amount(100 * scatter, 'percent', 2)}"
            )
    if response.attrs.get("unestimated"):
        texts.append(
            "how far the response is off by the step is not known: it cannot be measured in half "
            f"steps ({response.attrs['unestimated']})"
        )
    if response["unsettled_substeps"].values.any():
        texts.append("some substeps hit the cap of the contact iteration: take a smaller step")
    return texts


def purity(response: xr.Dataset) -> str:
    """Return the least coherence by amplitude, as what the excitation makes of it.

    Parameters
    ----------
    response
        Response to sines or, then averaged over windows, to all frequencies at once.
    """
    lowest = response["coherence"].min(dim="frequency").values[0]
    shares = ", ".join("-" if np.isnan(share) else f"{share:.3f}" for share in lowest)
    if response.attrs["excitation"] == "sine":
        return (
            f"least share of the output's power at the sine: {shares} (harmonics, dither and "
            "ripple are the rest)"
        )
    return f"lowest coherence of set point and output: {shares}"


def _cases(response: xr.Dataset, which: NDArray[np.bool_]) -> str:
    count = int(which.sum())
    many = "frequency" if count == 1 else "frequencies"
    return f"{count} {many}" + (" of all cases" if response.sizes["variant"] > 1 else "")
