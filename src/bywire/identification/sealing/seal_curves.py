"""What shows a seal's friction: the line over pressure, and the force while it slides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from bywire.core.typing import Array
from bywire.data.labeled import over
from bywire.identification.estimate import Estimate
from bywire.identification.method import Curve
from bywire.identification.output_error import even_interval
from bywire.identification.records import after_one_another
from bywire.identification.sealing.strokes import Group, find_strokes, velocity


def friction_line(fit: Estimate, groups: Sequence[Group]) -> Curve:
    """Return friction over pressure with its band, and what each group says of it."""
    offset = fit["F_off"] if "F_off" in fit.names else 0.0
    seen = {g.p: g.direction * (g.F - fit["A"] * g.p - offset) for g in groups}
    p = np.union1d(np.linspace(0.0, 1.1 * max(seen), 60), list(seen))
    places = [fit.names.index(n) for n in ("F_0", "f") if n in fit.names]
    rows = np.column_stack((np.ones(p.size), p))[:, : len(places)]
    value = rows @ fit.values[places]
    variance = np.einsum("ni,ij,nj->n", rows, fit.covariance[np.ix_(places, places)], rows)
    half = 0.5 * float(np.diff(fit.intervals()[0])[0]) / float(fit.deviations[0])
    reach = half * np.sqrt(variance)
    columns = {
        "value": value,
        "low": value - reach,
        "high": value + reach,
        "measured": np.array([seen.get(float(v), np.nan) for v in p]),
    }
    return Curve(
        "friction",
        "Friction over pressure with its 95 % band; points: each record, each direction.",
        over(("p", p, "Pa", "pressure"), columns, "N", "friction"),
        "p",
    )


def sliding_force(
    records: Mapping[str, xr.Dataset],
    fit: Estimate,
    stretch: tuple[float, float],
    slowest: float,
    cutoff: float,
) -> Curve:
    """Return the force while it slides, measured and modeled, record after record."""
    pairs, times = [], {}
    for name, record in records.items():
        times[name] = record["time"].values - record["time"].values[0]
        pairs.append(_sliding(record, fit, stretch, slowest, cutoff))
    return Curve(
        "strokes",
        "Force while the piston slides, record after record: measured, and of the model.",
        _beside(pairs, after_one_another(times)),
        "time",
    )


def force_over_travel(
    records: Mapping[str, xr.Dataset],
    fit: Estimate,
    stretch: tuple[float, float],
    slowest: float,
    cutoff: float,
) -> Curve:
    """Return the loops of force over travel while it slides, measured and modeled."""
    pairs = [_sliding(record, fit, stretch, slowest, cutoff) for record in records.values()]
    x = np.concatenate([record["x"].values for record in records.values()])
    axis = {"x": ("x", x, {"units": "m", "long_name": "travel"})}
    return Curve(
        "loops",
        "Force over travel while the piston slides: the height of a loop is twice the friction.",
        _beside(pairs, axis, "x"),
        "x",
    )


def _sliding(
    record: xr.Dataset, fit: Estimate, stretch: tuple[float, float], slowest: float, cutoff: float
) -> tuple[Array, Array]:
    """Return measured and modeled force, NaN where the piston does not slide."""
    offset = fit["F_off"] if "F_off" in fit.names else 0.0
    x, p, F = (record[n].values for n in ("x", "p", "F"))
    v = velocity(x, even_interval(record["time"].values), cutoff)
    model = np.full(F.size, np.nan)
    for stroke in find_strokes(x, v, *stretch, slowest):
        k = stroke.rows
        model[k] = fit["A"] * p[k] + stroke.direction * (fit["F_0"] + fit["f"] * p[k]) + offset
    return np.where(np.isfinite(model), F, np.nan), model


def _beside(pairs: Sequence[tuple[Array, Array]], axis: Any, dim: str = "time") -> xr.Dataset:
    attrs = {"units": "N", "long_name": "force"}
    measured, modeled = (np.concatenate(columns) for columns in zip(*pairs, strict=True))
    return xr.Dataset({"measured": (dim, measured, attrs), "modeled": (dim, modeled, attrs)}, axis)
