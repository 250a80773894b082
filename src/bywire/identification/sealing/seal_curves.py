"""What shows a seal's friction: the line over pressure, and the force while it slides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

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
    attrs = {"units": "N", "long_name": "friction"}
    return Curve(
        "friction",
        "Friction over pressure with its 95 % band; points: each record, each direction.",
        xr.Dataset(
            {"value": ("p", value, attrs), "low": ("p", value - reach, attrs),
             "high": ("p", value + reach, attrs),
             "measured": ("p", np.array([seen.get(float(v), np.nan) for v in p]), attrs)},
            {"p": ("p", p, {"units": "Pa", "long_name": "pressure"})},
        ),
        "p",
    )  # fmt: skip


def sliding_force(
    records: Mapping[str, xr.Dataset],
    fit: Estimate,
    stretch: tuple[float, float],
    slowest: float,
    cutoff: float,
) -> Curve:
    """Return the force while it slides, measured and modeled, record after record."""
    offset = fit["F_off"] if "F_off" in fit.names else 0.0
    measured, modeled, times = [], [], {}
    for name, record in records.items():
        x, p, F = (record[n].values for n in ("x", "p", "F"))
        times[name] = record["time"].values - record["time"].values[0]
        v = velocity(x, even_interval(record["time"].values), cutoff)
        model = np.full(F.size, np.nan)
        for stroke in find_strokes(x, v, *stretch, slowest):
            k = stroke.rows
            rubs = fit["F_0"] + fit["f"] * p[k]
            model[k] = fit["A"] * p[k] + stroke.direction * rubs + offset
        measured.append(np.where(np.isfinite(model), F, np.nan))
        modeled.append(model)
    attrs = {"units": "N", "long_name": "force"}
    return Curve(
        "strokes",
        "Force while the piston slides, record after record: measured, and of the model.",
        xr.Dataset(
            {"measured": ("time", np.concatenate(measured), attrs),
             "modeled": ("time", np.concatenate(modeled), attrs)},
            after_one_another(times),
        ),
        "time",
    )  # fmt: skip
