"""Statements of Roberts et al. (2003), and common parts of all comparisons with them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, cast

from bywire.brakes.wedge.case import FRICTIONLESS
from bywire.brakes.wedge.elements import wedge
from bywire.brakes.wedge.panels import BRAKING
from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.brakes.wedge.sets import roberts2003
from bywire.core.catalog import PARAMETER_SETS
from bywire.reproduction.source_file import SourceFile

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

CITATION = roberts2003.FILE.citation
FILE = SourceFile(Path(__file__).with_name("roberts2003.toml"))
FACTS, ALLOWANCES = FILE.facts, FILE.allowances


# --- Common parts of the figures: parameter set, overrides, means over a revolution

MAIN = "roberts2003"

WITHOUT_RUNOUT = {"flywheel.runout": 0.0}
IDEAL = {
    **FRICTIONLESS,
    **WITHOUT_RUNOUT,
    "motor_1.T_cog": 0.0,
    "motor_2.T_cog": 0.0,
}
"""overrides that reduce the model to section "Wedge and brake calliper", without friction"""
STACK = tuple(panel for panel in BRAKING.panels if panel.quantity != "force")
"""moment, speed, current, power and mode, one above the other as in Figs. 7 to 9"""


def parameters() -> WedgeParameters:
    """Return the parameter set from the catalog."""
    return cast(WedgeParameters, PARAMETER_SETS.find(MAIN).parameters())


def tan_alpha() -> float:
    """Return the tangent of the wedge angle: the friction coefficient at the neutral point."""
    return wedge.slope(parameters().wedge)


def stacked(run: xr.Dataset, measured: xr.Dataset | None = None) -> Figure:
    """Draw demand, simulation and an optional measurement, stacked as in Figs. 7 to 9.

    Parameters
    ----------
    run
        Recording of the wedge brake.
    measured
        Recording from a rig with the same names and units. It may have fewer variables.
    """
    from bywire.report.time_traces import time_traces  # loads Matplotlib, which runs do not need

    return time_traces(run, panels=STACK, measured=measured)


def settled(run: xr.Dataset, name: str, end: float) -> float:
    """Return the mean of a signal over the disc's last revolution before a time [s]."""
    Omega = float(run["Omega"].sel(time=end, method="nearest"))
    begin = end - 2.0 * math.pi / abs(Omega)
    return float(run[name].sel(time=slice(begin + 1e-9, end - 1e-9)).mean())


def standby() -> float:
    """Return the drives' standby power [W]."""
    return parameters().supply.P_standby
