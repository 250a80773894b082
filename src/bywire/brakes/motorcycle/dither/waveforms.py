"""Sine, square and triangle against each other, filtered with the demand or past the filter."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import xarray as xr

from bywire.brakes.motorcycle.dither.choice import candidates
from bywire.brakes.motorcycle.dither.map import Grid
from bywire.brakes.motorcycle.dither.reach import attenuation, reach, waveform
from bywire.brakes.motorcycle.dither.trial import tried
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.synthesis.study import Cut, variable

Par = MotorcycleParameters

WAVEFORMS = ("sine", "square", "triangle")
PLACES = ("after-dither", "before-dither")
_UNITS = {"distortion": "%", "copper": "W", "ripple_caliper": "Pa"}


def compared(
    par: Par, grid: Grid, f: float, limits: Mapping[str, float], report: Callable[[float], None]
) -> Cut:
    """Return what each waveform takes to overcome the friction at one frequency [Hz].

    Each has the least gain that is enough at every pressure; copper power is the mean over the
    pressures, ripple the worst.
    """
    cases = [(shape, place) for place in PLACES for shape in WAVEFORMS]
    rows: list[dict[str, Any]] = []
    for k, (shape, place) in enumerate(cases):
        shaped = par.replace({"ecu.dither.waveform": shape, "ecu.filter.place": place})
        rows.append({"waveform": shape, "filter": place, **_row(shaped, grid, f, limits)})
        report((k + 1) / len(cases))
    index = np.arange(len(rows))
    table = xr.Dataset(
        {
            name: variable(
                np.array([row[name] for row in rows]), ("case",), _UNITS.get(name, "1"), name
            )
            for name in rows[0]
        },
        coords={"case": ("case", index)},
    )
    return Cut(
        f"waveforms at {f:.4g} Hz, filter after or before the dither joins", table, tuple(rows[0])
    )


def distortion(par: Par, f: float, p: float) -> float:
    """Return the total harmonic distortion of the motor current at a stuck shaft, in %.

    Up to half the ECU's sampling rate, where the converter's hold and the winding leave little.
    """
    samples = waveform(par, f)
    orders = np.arange(1, (samples.size + 1) // 2)
    passed = attenuation(par, np.asarray(orders * f, dtype=np.float64), p)
    size = np.abs(np.fft.rfft(samples)[orders]) * np.abs(passed)
    return float(100.0 * np.sqrt(np.sum(size[1:] ** 2)) / size[0])


def _row(par: Par, grid: Grid, f: float, limits: Mapping[str, float]) -> dict[str, Any]:
    gains = np.asarray(grid.gains)
    middle = grid.pressures[len(grid.pressures) // 2]
    columns = [tried(par, p, grid.gains, (f,), grid.trial) for p in grid.pressures]
    candidate = candidates(gains, columns, limits)[0]
    return {
        "reach": reach(par, f, middle),
        "distortion": distortion(par, f, middle),
        "gain": candidate.gain,
        "copper": candidate.price,
        "ripple_caliper": candidate.ripple,
        "limit": candidate.verdict or "none",
    }
