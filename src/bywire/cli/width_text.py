"""Bandwidths by amplitude, of one case or over a range, as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.analysis.response.large_signal import Variant, narrowest
from bywire.report.table_text import table_text
from bywire.report.tables import Table, text_table
from bywire.report.wording import amount

SHARES = {
    "share_stuck": "stuck", "share_sat_current": "at current limit",
    "share_sat_duty": "at duty limit", "share_sat_rate": "at rate limit",
}  # fmt: skip
"""shares of the time that are shown, with their titles"""


NOTE = (
    "bandwidth: -3 dB; crossover and phase margin of the loop gain's describing function; shares "
    "of the time: the largest of all frequencies"
)


def figures_text(found: xr.Dataset, unit: str) -> str:
    """Return a table of the first variant with a word on what it shows."""
    return f"{table_text(figures_table(found, unit))}\n{NOTE}"


def figures_table(found: xr.Dataset, unit: str) -> Table:
    """Return bandwidth, crossover and limits of the first variant by amplitude."""
    known = {name: title for name, title in SHARES.items() if name in found}
    heading = ["amplitude", "bandwidth", "crossover", "phase margin", *known.values()]
    rows = []
    for j, size in enumerate(found["amplitude"].values):
        one = found.isel(variant=0, amplitude=j)
        most = [f"{100.0 * float(one[name].max()):.3g} %" for name in known]
        margin = amount(float(one["phase_margin"]), "deg", 3)
        rows.append([amount(float(size), unit, 3), _frequency(one, "bandwidth"),
                     _frequency(one, "crossover"), margin, *most])  # fmt: skip
    return text_table(heading, rows)


def over_text(
    found: xr.Dataset, variants: Sequence[Variant], range_: tuple[str, str], unit: str
) -> str:
    """Return the table of a range, and the worst case of every amplitude; see `over_table`."""
    lines = []
    for j, size in enumerate(found["amplitude"].values):
        k = narrowest(found, j)
        width = _frequency(found.isel(variant=k, amplitude=j), "bandwidth")
        at = f"{range_[0]} = {amount(variants[k].label, range_[1])}"
        lines.append(f"{width} for {amount(float(size), unit, 3)} at {at}")
    table = table_text(over_table(found, variants, range_, unit))
    return f"bandwidth (-3 dB) by amplitude\n{table}\nworst: {'; '.join(lines)}"


def over_table(
    found: xr.Dataset, variants: Sequence[Variant], range_: tuple[str, str], unit: str
) -> Table:
    """Return the bandwidths over a range by amplitude.

    Parameters
    ----------
    found
        Response with its widths.
    variants
        Cases of the range.
    range_
        Name and unit of what is varied.
    unit
        Of the amplitudes.
    """
    sizes = [amount(float(size), unit, 3) for size in found["amplitude"].values]
    rows = [
        [amount(one.label, range_[1]),
         *(_frequency(found.isel(variant=k, amplitude=j), "bandwidth") for j in range(len(sizes)))]
        for k, one in enumerate(variants)
    ]  # fmt: skip
    return text_table([range_[0], *sizes], rows)


def figures_object(found: xr.Dataset, variant: int) -> list[dict[str, Any]]:
    """Return the figures of a variant by amplitude; null beyond the measured frequencies."""
    rows = []
    for j, size in enumerate(found["amplitude"].values):
        one = found.isel(variant=variant, amplitude=j)
        row: dict[str, Any] = {"amplitude": float(size)}
        row |= _bounded(one, "bandwidth") | _bounded(one, "crossover")
        row["phase_margin"] = _or_none(float(one["phase_margin"]))
        row |= {f"largest_{name}": float(one[name].max()) for name in SHARES if name in found}
        rows.append(row)
    return rows


def over_object(found: xr.Dataset, variants: Sequence[Variant], name: str) -> dict[str, Any]:
    """Return the figures of all cases of a range, and the worst of every amplitude."""
    cases = [
        {name: one.label, "figures": figures_object(found, k),
         "gain": _listed(found["gain"].values[k]), "phase": _listed(found["phase"].values[k])}
        for k, one in enumerate(variants)
    ]  # fmt: skip
    worst = []
    for j, size in enumerate(found["amplitude"].values):
        k = narrowest(found, j)
        row = _bounded(found.isel(variant=k, amplitude=j), "bandwidth")
        worst.append({"amplitude": float(size), **row, name: variants[k].label})
    return {"over": name, "cases": cases, "worst": worst}


def _frequency(one: xr.Dataset, name: str) -> str:
    value, f = float(one[name]), one["frequency"].values
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return f"> {amount(float(f[-1]), 'Hz', 3)}"
    return f"< {amount(float(f[0]), 'Hz', 3)}" if value == 0.0 else amount(value, "Hz", 3)


def _bounded(one: xr.Dataset, name: str) -> dict[str, float | None]:
    """Return a frequency, or null with the bound that is known."""
    value, f = float(one[name]), one["frequency"].values
    if math.isinf(value):
        return {name: None, f"{name}_above": float(f[-1])}
    if value == 0.0:
        return {name: None, f"{name}_below": float(f[0])}
    return {name: _or_none(value)}


def _or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _listed(values: NDArray[np.float64]) -> list[list[float | None]]:
    return [[_or_none(one) for one in row] for row in values.tolist()]
