"""What recordings differ by over time: each less the first, at the first one's times."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from bywire.core.units import difference_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEAST = 1e-9
"""share of a signal's largest magnitude below which a difference is rounding, and none"""


def difference_figure(recordings: Mapping[str, xr.Dataset]) -> Figure | None:
    """Draw what each recording differs from the first by; None where none does.

    ``recordings``: by the label that the legend shows.
    """
    from bywire.report.overlaid_panels import can_overlay, overlaid_panels

    apart = differences_from_first(recordings)
    if not apart or not can_overlay(list(apart.values())):
        return None
    return overlaid_panels(apart, skipped=1)  # in the colors that the recordings have


def differences_from_first(recordings: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """Return the signals that all recordings share, less those of the first.

    Between samples of another run signals are straight lines; beyond its end there is no
    difference. Modes, which are whole numbers, have none either.

    Parameters
    ----------
    recordings
        Recordings over time by label, two or more.

    Returns
    -------
    dict
        A dataset for each recording but the first, by ``"label less first label"``; none where the
        recordings have no times in common, or do not differ.
    """
    (base_label, base), *others = recordings.items()
    low = max(float(each["time"].values[0]) for each in recordings.values())
    high = min(float(each["time"].values[-1]) for each in recordings.values())
    base = base.isel(time=(base["time"].values >= low) & (base["time"].values <= high))
    if base.sizes["time"] < 2:
        return {}
    names = [
        str(name)
        for name in base.data_vars
        if all(_is_comparable(base[name], each, str(name)) for _, each in others)
    ]
    apart = {f"{k} less {base_label}": _less(each, base, names) for k, each in others}
    differ = any(bool(np.any(each[name].values)) for each in apart.values() for name in names)
    return apart if differ else {}


def _is_comparable(first: xr.DataArray, other: xr.Dataset, name: str) -> bool:
    if name not in other.data_vars or first.dims != ("time",) or other[name].dims != ("time",):
        return False
    is_mode = first.attrs.get("units", "1") == "1" and not np.any(np.mod(first.values, 1.0))
    return not is_mode and first.attrs.get("units") == other[name].attrs.get("units")


def _less(other: xr.Dataset, base: xr.Dataset, names: list[str]) -> xr.Dataset:
    time = base["time"].values
    is_same = np.array_equal(other["time"].values, time)
    signals = {}
    for name in names:
        first, second = base[name], other[name].values
        values = second if is_same else np.interp(time, other["time"].values, second)
        apart = values - first.values
        size = float(np.nanmax(np.abs(first.values), initial=0.0))
        apart = np.where(np.abs(apart) <= LEAST * size, 0.0, apart)
        unit = difference_unit(str(first.attrs.get("units", "1")))
        signals[name] = ("time", apart, {**first.attrs, "units": unit})
    kept = {key: base.attrs[key] for key in ("model",) if key in base.attrs}
    return xr.Dataset(signals, coords={"time": base["time"]}, attrs=kept)
