"""What limits a drive train: constraints at their limit, and what its neighbors fail at or cost."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.sizing.map import HELD, LATE, LEFT
from bywire.brakes.wedge.sizing.options import Options
from bywire.core.typing import Array

_AT = 0.99  # share of a limit from which on it counts as reached


def active(at: xr.Dataset, par: WedgeParameters, options: Options) -> list[str]:
    """Return the constraints that a design is at.

    Parameters
    ----------
    at
        The design: variables over ``mu_B`` and scalars.
    par
        The given brake.
    options
        The study's.
    """
    texts = []
    if options.response == "enforced" and float(at["lateness"]) >= _AT:
        texts.append(
            f"time: {float(at['t_90'].max()) * 1e3:.4g} ms of the {options.t_90 * 1e3:.4g} ms "
            f"demanded, slowest at mu_B = {_where(at['t_90']):g}"
        )
    limits = {"control.position.i_max": par.control.position.i_max, "drive.i_max": par.drive.i_max}
    name, i_max = min(limits.items(), key=lambda limit: limit[1])
    if float(at["current"].max()) >= _AT * i_max:
        reached = at["mu_B"].values[at["current"].values >= _AT * i_max]
        texts.append(f"current: at the limit {name} = {i_max:g} A with mu_B = {_listed(reached)}")
    held = at["held"].min() / options.moment
    if float(held) < HELD / _AT:
        texts.append(
            f"hold: {100.0 * float(held):.3g} % of the demand is held, least at "
            f"mu_B = {_where(-at['held']):g}"
        )
    if float(at["left"].max()) > _AT * LEFT * options.moment:
        texts.append(f"release: {float(at['left'].max()):.3g} N·m are left at its end")
    powers = at[options.power]
    near = at["mu_B"].values[powers.values >= _AT * float(powers.max())]
    texts.append(f"power: {float(powers.max()):.3g} W at mu_B = {_listed(near)}")
    return texts


def failures(at: xr.Dataset, options: Options) -> list[str]:
    """Return why a design is infeasible; empty where it is not."""
    reasons = []
    slowest = float(at["t_90"].max(skipna=False))
    if math.isnan(slowest):
        reasons.append("never reaches 90 % of the demand")
    elif options.response == "enforced" and float(at["lateness"]) > LATE:
        reasons.append(f"late, {slowest * 1e3:.4g} ms at mu_B = {_where(at['t_90']):g}")
    if float(at["held"].min()) < HELD * options.moment:
        reasons.append("does not hold the demand")
    if float(at["left"].max()) > LEFT * options.moment:
        reasons.append("does not release")
    if float(at["stop"].max()) > 0.0:
        reasons.append("presses on an end stop")
    return reasons


def around(grids: Sequence[xr.Dataset], best: xr.Dataset, options: Options) -> list[str]:
    """Return what happens one step away from the best design, on the finest grid that has it.

    ``grids``: maps of designs, coarse to fine; ``best``: one design of the last grid that holds it.
    """
    tan_alpha, lead = float(best["tan_alpha"]), float(best["lead"])
    power, texts = float(best[f"worst_{options.power}"]), []
    grid = [g for g in grids if tan_alpha in g["tan_alpha"].values and lead in g["lead"].values][-1]
    i, j = (
        int(np.flatnonzero(grid[name].values == value)[0])
        for name, value in (("tan_alpha", tan_alpha), ("lead", lead))
    )
    steps = {
        "flatter wedge": (-1, 0),
        "steeper wedge": (1, 0),
        "shorter lead": (0, -1),
        "longer lead": (0, 1),
    }
    for label, (di, dj) in steps.items():
        k, m = i + di, j + dj
        if not (0 <= k < grid.sizes["tan_alpha"] and 0 <= m < grid.sizes["lead"]):
            continue
        neighbor = grid.isel(tan_alpha=k, lead=m)
        value = (
            f"tan(alpha) = {float(neighbor['tan_alpha']):.4g}"
            if di
            else f"lead = {1e3 * float(neighbor['lead']):.4g} mm"
        )
        reasons = failures(neighbor, options)
        more = 100.0 * (float(neighbor[options.power].max()) / power - 1.0)
        outcome = f"{more:+.2g} % power, at mu_B = {_where(neighbor[options.power]):g}"
        if reasons:
            outcome = f"infeasible: {'; '.join(reasons)}"
        texts.append(f"{label}, {value}: {outcome}")
    return texts


def _where(values: xr.DataArray) -> float:
    return float(values["mu_B"].values[np.argmax(values.values)])


def _listed(values: Array) -> str:
    return ", ".join(f"{float(value):g}" for value in values)
