"""Many dithers beside each other, and the one that overcomes the friction at least price."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from bywire.bench.kpis.kpi import Kpi
from bywire.brakes.motorcycle.dither.trial import (
    FIGURES,
    Trial,
    breakaway_torques,
    needed_gain,
    reach,
    tried,
)
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.control.dither import breakaway_current
from bywire.core.typing import Array
from bywire.data.labeled import labeled
from bywire.synthesis.study import Cut, variable

Figures = Mapping[str, Array]

OVERCOMES = ("stuck", "band")
"""figures that fall with the amplitude: friction counts as overcome below their limits"""
COSTS = ("ripple_caliper", "current_share", "duty_share")
"""figures that grow with the amplitude"""

NAMES = {
    "stuck": "share of the time stuck",
    "band": "dead band left",
    "ripple_caliper": "ripple at the caliper",
    "current_share": "current limit",
    "duty_share": "duty cycle's limit",
}
"""what messages call them"""


@dataclass(frozen=True)
class Least:
    """The weakest dither of one frequency that overcomes the friction.

    Parameters
    ----------
    gain
        Of the dither's law; NaN where none on the grid does.
    binding
        Which of `OVERCOMES` asks for that much.
    exceeded
        Which of `COSTS` it then exceeds.
    figures
        All figures at that gain, interpolated.
    """

    gain: float
    binding: str
    exceeded: tuple[str, ...]
    figures: Mapping[str, float]


def least(gains: Array, figures: Figures, limits: Mapping[str, float]) -> Least:
    """Return the weakest dither that overcomes the friction, from there on upward.

    ``gains``: shape (n,), ascending; ``figures``: name -> values at these gains, shape (n,);
    ``limits``: largest value of each of `OVERCOMES` and `COSTS`.
    """
    wanted = {name: crossing(gains, figures[name], limits[name]) for name in OVERCOMES}
    binding = max(OVERCOMES, key=lambda name: (math.isnan(wanted[name]), wanted[name]))
    gain = wanted[binding]
    if math.isnan(gain):
        return Least(gain, binding, (), dict.fromkeys(figures, math.nan))
    return at_gain(gains, figures, limits, gain, binding)


def at_gain(
    gains: Array, figures: Figures, limits: Mapping[str, float], gain: float, binding: str
) -> Least:
    """Return the figures at a gain within the grid, linear between its points."""
    at = {name: float(np.interp(gain, gains, values)) for name, values in figures.items()}
    exceeded = tuple(name for name in COSTS if at[name] > limits[name])
    return Least(gain, binding, exceeded, at)


def crossing(gains: Array, values: Array, limit: float) -> float:
    """Return the gain above which values stay within a limit, linear between points; NaN for none.

    Examples
    --------
    >>> import numpy as np
    >>> round(crossing(np.array([1.0, 2.0, 3.0]), np.array([0.9, 0.2, 0.0]), 0.1), 6)
    2.5
    """
    above = np.flatnonzero(~(values <= limit))  # NaN is above every limit
    if not above.size:
        return float(gains[0])
    k = int(above[-1])
    if k == gains.size - 1 or math.isnan(values[k]):
        return math.nan if k == gains.size - 1 else float(gains[k + 1])
    share = (values[k] - limit) / (values[k] - values[k + 1])
    return float(gains[k] + share * (gains[k + 1] - gains[k]))


@dataclass(frozen=True)
class Candidate:
    """The least gain of one frequency that is enough at every pressure.

    ``gain``: naN where none on the grid is enough; ``decisive``: which pressure asks for that gain;
    ``binding``: which of `OVERCOMES` asks for it; ``price``: copper power [W], mean over the
    pressures; ``ripple``: ripple at the caliper [Pa], worst pressure; ``exceeded``: which of
    `COSTS` exceed their limits at any pressure.
    """

    gain: float
    decisive: int
    binding: str
    price: float
    ripple: float
    exceeded: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """Why it cannot be had; empty where it can."""
        if math.isnan(self.gain):
            return f"{NAMES[self.binding]}: no gain is enough"
        return ", ".join(NAMES[name] for name in self.exceeded)


def candidates(
    gains: Array, figures: Sequence[Figures], limits: Mapping[str, float]
) -> list[Candidate]:
    """Return one candidate for every frequency.

    Parameters
    ----------
    figures
        Of every pressure: name -> values, shape (gains, frequencies).
    """
    count = next(iter(figures[0].values())).shape[1]
    return [
        _candidate(gains, [_column(at_pressure, k) for at_pressure in figures], limits)
        for k in range(count)
    ]


def _column(figures: Figures, k: int) -> Figures:
    """Return the figures of a frequency, shape (gains,) each."""
    return {name: values[:, k] for name, values in figures.items()}


def best_of(candidates: Sequence[Candidate]) -> int | None:
    """Return which candidate costs least; None where none is admissible."""
    admissible = [k for k, candidate in enumerate(candidates) if not candidate.verdict]
    return min(admissible, key=lambda k: candidates[k].price, default=None)


def _candidate(gains: Array, columns: Sequence[Figures], limits: Mapping[str, float]) -> Candidate:
    each = [least(gains, column, limits) for column in columns]
    n = max(range(len(each)), key=lambda k: (math.isnan(each[k].gain), each[k].gain))
    gain, binding = each[n].gain, each[n].binding
    if math.isnan(gain):
        return Candidate(gain, n, binding, math.nan, math.nan, ())
    there = [at_gain(gains, column, limits, gain, binding) for column in columns]
    return Candidate(
        gain,
        n,
        binding,
        price=float(np.mean([at_pressure.figures["copper"] for at_pressure in there])),
        ripple=max(at_pressure.figures["ripple_caliper"] for at_pressure in there),
        exceeded=tuple(sorted({name for at_pressure in there for name in at_pressure.exceeded})),
    )


# --- The map

Par = MotorcycleParameters
Report = Callable[[float], None]


@dataclass(frozen=True)
class Grid:
    """The dithers to compare.

    ``pressures``, ``gains``, ``frequencies``: pressures [Pa], gains of the law (ascending),
    frequencies [Hz]; ``trial``: how each is tried.
    """

    pressures: Sequence[float]
    gains: Sequence[float]
    frequencies: Sequence[float]
    trial: Trial


def figures_of(par: Par, grid: Grid, report: Report) -> list[Mapping[str, Array]]:
    """Return every pressure's figures, shape (gains, frequencies) each."""
    figures = []
    for k, p in enumerate(grid.pressures):
        figures.append(tried(par, p, grid.gains, grid.frequencies, grid.trial))
        report((k + 1) / len(grid.pressures))
    return figures


def mapped(
    par: Par, grid: Grid, figures: Sequence[Mapping[str, Array]], limits: Mapping[str, float]
) -> xr.Dataset:
    """Return all figures, the worst over the pressures, and the least gain that is enough.

    Returns
    -------
    xarray.Dataset
        Dimensions ``pressure``, ``gain``, ``frequency``: the variables of `FIGURES`; without
        pressure as ``worst_NAME``; ``least_gain`` and ``least_copper`` over pressure and
        frequency, NaN where no gain is enough; ``predicted_gain`` likewise and ``reach`` over
        frequency, of linear models alone.
    """
    dims = ("pressure", "gain", "frequency")
    gains = np.asarray(grid.gains)
    columns = {}
    for name, (unit, label) in FIGURES.items():
        values = np.stack([at_pressure[name] for at_pressure in figures])
        columns[name] = variable(values, dims, unit, label)
        columns[f"worst_{name}"] = variable(values.max(axis=0), dims[1:], unit, f"{label}, worst")
    enough = [
        [
            least(gains, {n: v[:, k] for n, v in at_pressure.items()}, limits)
            for k in range(len(grid.frequencies))
        ]
        for at_pressure in figures
    ]
    both = ("pressure", "frequency")
    predicted = [[needed_gain(par, f, p) for f in grid.frequencies] for p in grid.pressures]
    middle = grid.pressures[len(grid.pressures) // 2]
    columns |= {
        "least_gain": variable(
            [[c.gain for c in row] for row in enough],
            both,
            "1",
            "least gain that overcomes the friction",
        ),
        "least_copper": variable(
            [[c.figures["copper"] for c in row] for row in enough],
            both,
            "W",
            "dither's copper power at the least gain",
        ),
        "predicted_gain": variable(
            predicted, both, "1", "gain that breaks a stuck shaft away, from linear models"
        ),
        "reach": variable(
            [reach(par, f, middle) for f in grid.frequencies],
            ("frequency",),
            "1",
            "motor current over dither, stuck shaft",
        ),
    }
    return xr.Dataset(columns).assign_coords(
        pressure=variable(list(grid.pressures), ("pressure",), "Pa", "pressure"),
        gain=variable(gains, ("gain",), "1", "dither gain"),
        frequency=variable(list(grid.frequencies), ("frequency",), "Hz", "dither frequency"),
    )


def by_frequency(grid: Grid, each: list[Candidate]) -> Cut:
    """Return the gain that is enough at every pressure, its price, and what stands against it."""
    names = ("gain", "price", "ripple")
    units = {"price": "W", "ripple": "Pa"}
    words = {
        "decided by": [
            f"{NAMES[candidate.binding]} at {grid.pressures[candidate.decisive] / 1e5:g} bar"
            for candidate in each
        ],
        "beyond": [candidate.verdict or "nothing" for candidate in each],
    }
    numbers = {name: [getattr(candidate, name) for candidate in each] for name in names}
    table = labeled(
        {"frequency": (list(grid.frequencies), "Hz", "dither frequency")},
        {name: (column, units.get(name, "1"), name) for name, column in (numbers | words).items()},
    )
    return Cut("least gain for all pressures together", table, ("frequency", *names, *words))


def by_pressure(par: Par, data: xr.Dataset) -> Cut:
    """Return the least dither of every pressure, each at the frequency where it costs least."""
    rows: dict[str, list[float]] = {}
    for k, p in enumerate(data["pressure"].values):
        copper = data["least_copper"].values[k]
        n = int(np.nanargmin(copper)) if np.isfinite(copper).any() else 0
        f, gain = float(data["frequency"].values[n]), float(data["least_gain"].values[k, n])
        amplitude = gain * float(breakaway_current(p, par.ecu.est_par))
        torque = amplitude * reach(par, f, p) * par.motor.K_e
        row = {
            "frequency": f,
            "gain": gain,
            "predicted": float(data["predicted_gain"].values[k, n]),
            "amplitude": amplitude,
            "torque": torque,
            "breakaway": breakaway_torques(par, p)[0],
            "copper": float(copper[n]),
            **{
                name: float(np.interp(gain, data["gain"].values, data[name].values[k, :, n]))
                for name in ("ripple_sensor", "ripple_caliper", "current_share")
            },
        }
        for name, value in row.items():
            rows.setdefault(name, []).append(value)
    units = {
        "frequency": "Hz",
        "amplitude": "A",
        "torque": "N*m",
        "breakaway": "N*m",
        "copper": "W",
        "ripple_sensor": "Pa",
        "ripple_caliper": "Pa",
    }
    table = labeled(
        {"pressure": (data["pressure"].values, "Pa", "pressure")},
        {name: (values, units.get(name, "1"), name) for name, values in rows.items()},
    )
    title = "least dither of each pressure on its own; torque at the shaft, predicted gain linear"
    return Cut(title, table, ("pressure", *rows))


def law(par: Par, data: xr.Dataset, best: int, grid: Grid) -> list[Kpi]:
    """Return what the ECU should believe of the friction so that gain 1 is just enough."""
    f = grid.frequencies[best]
    p, est = np.asarray(grid.pressures), par.ecu.est_par
    current = np.array([float(breakaway_current(pressure, est)) for pressure in p])
    needed = data["least_gain"].values[:, best] * current * est.K_e / est.k_brk_p
    kpis = [
        Kpi(
            "optimum_reach",
            reach(par, f, float(np.median(p))),
            "1",
            "Motor current over dither at the optimum's frequency, shaft stuck.",
        ),
        Kpi(
            "optimum_predicted_gain",
            float(data["predicted_gain"].values[:, best].max()),
            "1",
            "Gain that breaks the stuck shaft away both ways, from linear models alone.",
        ),
    ]
    if p.size > 1:
        slope, offset = np.polyfit(p, needed, 1)
        offset += float(np.max(needed - (offset + slope * p)))  # enough at every pressure
        text = "What the ECU must believe for a gain of 1 to be just enough:"
        kpis += [
            Kpi("law_T_pr", offset, "N*m", f"{text} preload's friction torque."),
            Kpi("law_f_cfr_p", slope, "N*m/Pa", f"{text} growth with pressure."),
        ]
    return kpis
