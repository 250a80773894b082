"""Bandwidths by amplitude, of one case or over a range, as tables and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.analysis.response.large_signal import Variant, narrowest
from bywire.report.tables import Table, amount_cell, measured_cell, text_table
from bywire.report.wording import amount, measured_amount

NOTE = (
    "bandwidth: -3 dB; crossover and margins of the loop gain's describing function; shares "
    "of the time: the largest of all frequencies"
)


_WIDTHS = ("bandwidth", "crossover", "phase_margin", "gain_margin", "lower_gain_margin")


def shares(response: xr.Dataset) -> dict[str, str]:
    """Return the shares of the time that a response tells, with the titles of their columns."""
    names = [str(name) for name in response if str(name).startswith("share_")]
    return {name: _title(name.removeprefix("share_")) for name in names}


def _title(flag: str) -> str:
    """Return a mode's title; ``sat_`` names a limit."""
    if flag.startswith("sat_"):
        return f"at {flag.removeprefix('sat_').replace('_', ' ')} limit"
    return flag.replace("_", " ")


def figures_table(response: xr.Dataset, unit: str) -> Table:
    """Return bandwidth, crossover, margins and limits of the first variant by amplitude."""
    known = shares(response)
    heading = [
        "amplitude",
        "bandwidth",
        "crossover",
        "phase margin",
        "gain margin",
        "lower gain margin",
        *known.values(),
    ]
    rows = []
    for j, size in enumerate(response["amplitude"].values):
        case = response.isel(variant=0, amplitude=j)
        most = [f"{100.0 * float(case[name].max()):.3g} %" for name in known]
        margin = measured_cell(
            float(case["phase_margin"]), "deg", _step_error(case, "phase_margin"), 3
        )
        factors = [_factor(case, name) for name in ("gain_margin", "lower_gain_margin")]
        rows.append(
            [
                amount_cell(float(size), unit, 3),
                _frequency(case, "bandwidth"),
                _frequency(case, "crossover"),
                margin,
                *factors,
                *most,
            ]
        )
    return text_table(heading, rows)


def worst_line(
    response: xr.Dataset, variants: Sequence[Variant], range_: tuple[str, str], unit: str
) -> str:
    """Return the worst case of every amplitude over a range as a line; see `over_table`."""
    texts = []
    for j, size in enumerate(response["amplitude"].values):
        k = narrowest(response, j)
        width = _frequency(response.isel(variant=k, amplitude=j), "bandwidth")
        at = f"{range_[0]} = {amount(variants[k].label, range_[1])}"
        texts.append(f"{width} for {amount(float(size), unit, 3)} at {at}")
    return f"worst: {'; '.join(texts)}"


def over_table(
    response: xr.Dataset, variants: Sequence[Variant], range_: tuple[str, str], unit: str
) -> Table:
    """Return the bandwidths over a range by amplitude.

    Parameters
    ----------
    response
        Response with its widths.
    variants
        Cases of the range.
    range_
        Name and unit of what is varied.
    unit
        Of the amplitudes.
    """
    sizes = [amount(float(size), unit, 3) for size in response["amplitude"].values]
    rows = [
        [
            amount_cell(variant.label, range_[1]),
            *(
                _frequency(response.isel(variant=k, amplitude=j), "bandwidth")
                for j in range(len(sizes))
            ),
        ]
        for k, variant in enumerate(variants)
    ]
    return text_table([range_[0], *sizes], rows)


def figures_object(response: xr.Dataset, variant: int) -> list[dict[str, Any]]:
    """Return the figures of a variant by amplitude; null beyond the measured frequencies."""
    rows = []
    for j, size in enumerate(response["amplitude"].values):
        case = response.isel(variant=variant, amplitude=j)
        row: dict[str, Any] = {"amplitude": float(size)}
        row |= _bounded(case, "bandwidth") | _bounded(case, "crossover")
        row |= {
            name: _or_none(float(case[name]))
            for name in ("phase_margin", "gain_margin", "lower_gain_margin")
        }
        row |= {
            key: _or_none(float(case[key]))
            for key in map("{}_step_error".format, _WIDTHS)
            if key in case
        }
        row |= {f"largest_{name}": float(case[name].max()) for name in shares(response)}
        rows.append(row)
    return rows


def over_object(response: xr.Dataset, variants: Sequence[Variant], name: str) -> dict[str, Any]:
    """Return the figures of all cases of a range, and the worst of every amplitude."""
    cases = [
        {
            name: variant.label,
            "figures": figures_object(response, k),
            "gain": _listed(response["gain"].values[k]),
            "phase": _listed(response["phase"].values[k]),
        }
        for k, variant in enumerate(variants)
    ]
    worst = []
    for j, size in enumerate(response["amplitude"].values):
        k = narrowest(response, j)
        row = _bounded(response.isel(variant=k, amplitude=j), "bandwidth")
        worst.append({"amplitude": float(size), **row, name: variants[k].label})
    return {"over": name, "cases": cases, "worst": worst}


def _frequency(case: xr.Dataset, name: str) -> str:
    value, f = float(case[name]), case["frequency"].values
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return f"> {amount(float(f[-1]), 'Hz', 3)}"
    if value == 0.0:
        return f"< {amount(float(f[0]), 'Hz', 3)}"
    return measured_amount(value, "Hz", _step_error(case, name), 3)


def _factor(case: xr.Dataset, name: str) -> str:
    value = float(case[name])
    return "-" if math.isnan(value) else measured_amount(value, "1", _step_error(case, name), 3)


def _step_error(case: xr.Dataset, name: str) -> float:
    key = f"{name}_step_error"
    return float(case[key]) if key in case else math.nan


def _bounded(case: xr.Dataset, name: str) -> dict[str, float | None]:
    """Return a frequency, or null with the bound that is known."""
    value, f = float(case[name]), case["frequency"].values
    if math.isinf(value):
        return {name: None, f"{name}_above": float(f[-1])}
    if value == 0.0:
        return {name: None, f"{name}_below": float(f[0])}
    return {name: _or_none(value)}


def _or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _listed(values: NDArray[np.float64]) -> list[list[float | None]]:
    return [[_or_none(value) for value in row] for row in values.tolist()]
