"""Many dithers beside each other, as a dataset."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from bywire.brakes.motorcycle.dither.choice import least
from bywire.brakes.motorcycle.dither.reach import needed_gain, reach
from bywire.brakes.motorcycle.dither.trial import FIGURES, Trial, tried
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.synthesis.study import variable

Array = NDArray[np.float64]
Par = MotorcycleParameters
Report = Callable[[float], None]


@dataclass(frozen=True)
class Grid:
    """The dithers to compare.

    Parameters
    ----------
    pressures, gains, frequencies
        Pressures [Pa], gains of the law (ascending), frequencies [Hz].
    trial
        How each is tried.
    """

    pressures: Sequence[float]
    gains: Sequence[float]
    frequencies: Sequence[float]
    trial: Trial


def figures_of(par: Par, grid: Grid, report: Report) -> list[Mapping[str, Array]]:
    """Return every pressure's figures, shape (gains, frequencies) each."""
    found = []
    for k, p in enumerate(grid.pressures):
        found.append(tried(par, p, grid.gains, grid.frequencies, grid.trial))
        report((k + 1) / len(grid.pressures))
    return found


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
    found = {}
    for name, (unit, label) in FIGURES.items():
        values = np.stack([one[name] for one in figures])
        found[name] = variable(values, dims, unit, label)
        found[f"worst_{name}"] = variable(
            values.max(axis=0), dims[1:], unit, f"{label}, worst"
        )
    enough = [
        [least(gains, {n: v[:, k] for n, v in one.items()}, limits)
         for k in range(len(grid.frequencies))]
        for one in figures
    ]  # fmt: skip
    both = ("pressure", "frequency")
    predicted = [[needed_gain(par, f, p) for f in grid.frequencies] for p in grid.pressures]
    middle = grid.pressures[len(grid.pressures) // 2]
    found |= {
        "least_gain": variable([[c.gain for c in row] for row in enough], both, "1",
                               "least gain that overcomes the friction"),
        "least_copper": variable([[c.figures["copper"] for c in row] for row in enough], both, "W",
                                 "dither's copper power at the least gain"),
        "predicted_gain": variable(predicted, both, "1",
                                   "gain that breaks a stuck shaft away, from linear models"),
        "reach": variable([reach(par, f, middle) for f in grid.frequencies], ("frequency",), "1",
                          "motor current over dither, stuck shaft"),
    }  # fmt: skip
    return xr.Dataset(found).assign_coords(
        pressure=variable(list(grid.pressures), ("pressure",), "Pa", "pressure"),
        gain=variable(gains, ("gain",), "1", "dither gain"),
        frequency=variable(list(grid.frequencies), ("frequency",), "Hz", "dither frequency"),
    )
