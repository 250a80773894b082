"""Parameter sets of Roberts et al. (2003): values from formulas. The TOML file has all others."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from bywire.brakes.wedge.parameters import WedgeParameters
from bywire.core.catalog import Formula
from bywire.reproduction.source_file import SourceFile

_LOOP_RATE = 2.0 * math.pi * 1200.0


def _moment_slope(par: Any) -> float:
    """Return the moment per angle in contact that the moment controller assumes."""
    wedge, caliper = par.wedge, par.caliper
    force = caliper.K_cal * math.tan(wedge.alpha) * _travel(par)
    slope: float = 2.0 * wedge.mu_B * caliper.r_B * force
    return slope


def _travel(par: Any) -> float:
    """Return a screw's travel per angle."""
    travel: float = par.screw.lead / (2.0 * math.pi)
    return travel


def _grease(par: Any) -> float:
    """Return a bearing's viscous friction at the reference speed and viscosity."""
    bearing = par.bearing
    torque: float = 1.2e-4 * (bearing.omega_ref * (bearing.nu_ref / 1e-6)) ** bearing.k_nu
    return torque


_FORMULAS: dict[str, Formula] = {
    "drive_k_p": lambda par: par.motor_1.L_M * _LOOP_RATE / par.drive.V_dc,
    "drive_k_i": lambda par: par.motor_1.R_ref * _LOOP_RATE / par.drive.V_dc,
    "eta_b": lambda par: 2.0 - 1.0 / par.screw.eta_f,
    "grease": _grease,
    "travel": _travel,
    "moment_slope": _moment_slope,
    "gap_slope": lambda par: _travel(par) * math.tan(par.wedge.alpha),
}

FILE = SourceFile(Path(__file__).with_suffix(".toml"))
ADJUSTER = FILE.groups["adjuster"]
ENTRIES = FILE.sets(
    WedgeParameters, {**FILE.values(_FORMULAS), "adjuster.tooth": ADJUSTER["tooth"]}
)
