"""Curves of the braking dynamics: magnitude, phase and step, measured, modeled, theoretical."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.brakes.motorcycle.linear.brake import theoretical, with_slow_pair
from bywire.brakes.motorcycle.methods.braking.fit import five_of
from bywire.brakes.motorcycle.methods.braking.records import Region, StepRecord
from bywire.brakes.motorcycle.methods.braking.slow_pair import response
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import travel_at
from bywire.core.typing import Array
from bywire.data.labeled import over
from bywire.identification.estimate import Estimate
from bywire.identification.method import Curve


def curves_of(
    regions: Sequence[Region], estimates: Mapping[str, Estimate], par: MotorcycleParameters
) -> tuple[Curve, ...]:
    """Return measured, identified and theoretical responses of every region.

    Parameters
    ----------
    regions
        The records.
    estimates
        By region.
    par
        What eq. (15) is computed from.

    References
    ----------
    Dardanelli, Alli, Savaresi (2010), eqs. (15), (22), Fig. 6.
    """
    curves: list[Curve] = []
    for region in regions:
        estimate = estimates[region.name]
        if region.points.frequencies.size:
            curves += _bode(region, estimate, par)
        curves += [
            Curve(
                f"{region.name}-step" if len(region.steps) == 1 else f"{region.name}-step-{k + 1}",
                f"Step of the current at {region.name} pressure, dither averaged: measured, "
                "identified, and eq. (15).",
                _step(step, estimate, par, region.pressure),
                "time",
            )
            for k, step in enumerate(region.steps)
        ]
    return tuple(curves)


def _bode(region: Region, estimate: Estimate, par: MotorcycleParameters) -> list[Curve]:
    f = region.points.frequencies
    measured = np.exp(region.points.log_gain)
    modeled = with_slow_pair(*five_of(estimate).values()).response(f)
    theory = theoretical(par, region.pressure, travel_at(region.pressure, par)).response(f)
    parts = {"measured": measured, "modeled": modeled, "theoretical": theory}
    caption = f"Pressure over current at {region.name} pressure: measured, identified, eq. (15)."
    axis = ("frequency", f, "Hz", "frequency")
    magnitude, phase = (
        over(axis, {name: part(G) for name, G in parts.items()}, unit, label)
        for part, unit, label in ((np.abs, "Pa/A", "gain"), (_degrees, "degree", "phase"))
    )
    return [
        Curve(f"{region.name}-gain", caption, magnitude, "frequency"),
        Curve(f"{region.name}-phase", caption, phase, "frequency"),
    ]


def _degrees(G: NDArray[np.complex128]) -> Array:
    return np.degrees(np.unwrap(np.angle(G)))


def _step(step: StepRecord, estimate: Estimate, par: MotorcycleParameters, p: float) -> xr.Dataset:
    rest = estimate[f"{step.label or 'step'}:p_rest"]
    y, _ = response(np.array(list(five_of(estimate).values())), step.u, step.interval, step.block)
    middle = np.arange(y.size) * step.block + 0.5 * (step.block - 1)
    t = np.asarray((middle - step.before) * step.interval, dtype=float)
    height = float(np.mean(step.u[step.before :]))
    theory = rest + height * theoretical(par, p, travel_at(p, par)).step(t)
    columns = {"measured": step.pressure, "modeled": rest + y, "theoretical": theory}
    return over(("time", t, "s", "time after the step"), columns, "Pa", "pressure")
