"""Statements of Roberts et al. (2003), and common parts of all comparisons with them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
import xarray as xr

from bywire.brakes.wedge.case import FRICTIONLESS
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.panels import BRAKING
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.sets import roberts2003
from bywire.core.catalog import PARAMETER_SETS
from bywire.report.time_traces import time_traces
from bywire.reproduction.source_file import SourceFile

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CITATION = roberts2003.FILE.citation
FILE = SourceFile(Path(__file__).with_name("roberts2003.toml"))
FACTS, ALLOWANCES = FILE.facts, FILE.allowances


# --- Common parts of the figures: parameter set, changes, means over a turn

MAIN = "roberts2003"

WITHOUT_RUNOUT = {"flywheel.runout": 0.0}
IDEAL = {
    **FRICTIONLESS,
    **WITHOUT_RUNOUT,
    "motor_1.T_cog": 0.0,
    "motor_2.T_cog": 0.0,
}
"""overrides that leave the equations of section "Wedge and brake calliper", without friction"""
STACK = tuple(panel for panel in BRAKING.panels if panel.quantity != "force")
"""moment, speed, current, power and mode, one above the other as in Figs. 7 to 9"""


def parameters() -> WedgeParameters:
    """Return the parameter set of the catalog."""
    return cast(WedgeParameters, PARAMETER_SETS.find(MAIN).parameters())


def tan_alpha() -> float:
    """Return the tangent of the wedge's angle: the neutral point's friction coefficient."""
    return wedge.slope(parameters().wedge)


def stacked(run: xr.Dataset, measured: xr.Dataset | None = None) -> Figure:
    """Return a run stacked as in Figs. 7 to 9: demand, simulation, and a measurement if given.

    Parameters
    ----------
    run
        Recording of the wedge brake.
    measured
        Recording of a rig with the same names and units; its variables may be fewer.
    """
    return time_traces(run, panels=STACK, measured=measured)


def settled(run: xr.Dataset, name: str, end: float) -> float:
    """Return the mean of a signal over the disc's last revolution before a time [s]."""
    Omega = float(run["Omega"].sel(time=end, method="nearest"))
    begin = end - 2.0 * math.pi / abs(Omega)
    return float(run[name].sel(time=slice(begin + 1e-9, end - 1e-9)).mean())


def standby() -> float:
    """Return the drives' standby power [W]."""
    return parameters().supply.P_standby


def order_spectrum(
    run: xr.Dataset, name: str, turns: int, begin: float
) -> Mapping[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
    """Return the spectrum of a signal over the disc's angle.

    Parameters
    ----------
    turns
        Revolutions of the analysis: the spectrum resolves 1/turns.
    begin
        Start of the analysis [s].

    Returns
    -------
    mapping
        ``order`` [waves per revolution] and ``amplitude`` [the signal's unit], without the mean;
        NaN where the disc turns too little.
    """
    seen = run.sel(time=slice(begin, None))
    phi = np.abs(seen["phi"].values)
    angle = phi[0] + np.linspace(0.0, 2.0 * np.pi * turns, 128 * turns, endpoint=False)
    if angle[-1] > phi[-1]:
        return {"order": np.array([np.nan]), "amplitude": np.array([np.nan])}
    values = np.interp(angle, phi, seen[name].values)
    wave = 2.0 * np.abs(np.fft.rfft(values - values.mean())) / values.size
    return {"order": np.arange(wave.size) / turns, "amplitude": wave}
