"""Tables of a dither's design: by frequency, by pressure, and the amplitude's law."""

from __future__ import annotations

import numpy as np
import xarray as xr

from bywire.bench.kpis.kpi import Kpi
from bywire.brakes.motorcycle.dither.choice import NAMES, Candidate
from bywire.brakes.motorcycle.dither.map import Grid
from bywire.brakes.motorcycle.dither.reach import breakaway_torques, reach
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.control.dither import breakaway_current
from bywire.synthesis.study import Cut, variable

Par = MotorcycleParameters


def by_frequency(grid: Grid, each: list[Candidate]) -> Cut:
    """Return the gain that is enough at every pressure, its price, and what stands against it."""
    names = ("gain", "price", "ripple")
    units = {"price": "W", "ripple": "Pa"}
    words = {
        "decided by": [
            f"{NAMES[one.binding]} at {grid.pressures[one.decisive] / 1e5:g} bar" for one in each
        ],
        "beyond": [one.verdict or "nothing" for one in each],
    }
    found = {name: variable([getattr(one, name) for one in each], ("frequency",),
                            units.get(name, "1"), name) for name in names}  # fmt: skip
    found |= {name: variable(texts, ("frequency",), "1", name) for name, texts in words.items()}
    coordinate = variable(list(grid.frequencies), ("frequency",), "Hz", "dither frequency")
    table = xr.Dataset(found, coords={"frequency": coordinate})
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
            "frequency": f, "gain": gain,
            "predicted": float(data["predicted_gain"].values[k, n]), "amplitude": amplitude,
            "torque": torque, "breakaway": breakaway_torques(par, p)[0],
            "copper": float(copper[n]),
            **{name: float(np.interp(gain, data["gain"].values, data[name].values[k, :, n]))
               for name in ("ripple_sensor", "ripple_caliper", "current_share")},
        }  # fmt: skip
        for name, value in row.items():
            rows.setdefault(name, []).append(value)
    units = {"frequency": "Hz", "amplitude": "A", "torque": "N*m", "breakaway": "N*m",
             "copper": "W", "ripple_sensor": "Pa", "ripple_caliper": "Pa"}  # fmt: skip
    table = xr.Dataset(
        {name: variable(v, ("pressure",), units.get(name, "1"), name) for name, v in rows.items()},
        coords={"pressure": data["pressure"]},
    )
    title = "least dither of each pressure on its own; torque at the shaft, predicted gain linear"
    return Cut(title, table, ("pressure", *rows))


def law(par: Par, data: xr.Dataset, best: int, grid: Grid) -> list[Kpi]:
    """Return what the ECU should believe of the friction so that gain 1 is just enough."""
    f = grid.frequencies[best]
    p, est = np.asarray(grid.pressures), par.ecu.est_par
    current = np.array([float(breakaway_current(one, est)) for one in p])
    needed = data["least_gain"].values[:, best] * current * est.K_e / est.k_brk_p
    found = [
        Kpi("optimum_reach", reach(par, f, float(np.median(p))), "1",
            "Motor current over dither at the optimum's frequency, shaft stuck."),
        Kpi("optimum_predicted_gain", float(data["predicted_gain"].values[:, best].max()),
            "1", "Gain that breaks the stuck shaft away both ways, from linear models alone."),
    ]  # fmt: skip
    if p.size > 1:
        slope, offset = np.polyfit(p, needed, 1)
        offset += float(np.max(needed - (offset + slope * p)))  # enough at every pressure
        text = "What the ECU must believe for a gain of 1 to be just enough:"
        found += [
            Kpi("law_T_pr", offset, "N*m", f"{text} preload's friction torque."),
            Kpi("law_f_cfr_p", slope, "N*m/Pa", f"{text} growth with pressure."),
        ]
    return found
