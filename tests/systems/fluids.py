"""Brake fluids without air, a return pump, and parameters by group, for tests of hydraulics."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

FLUID = {
    "beta": 1.5e9,
    "nu": 12e-6,
    "rho": 1070.0,
    "air": "none",
    "V_air": 0.0,
    "n_air": 1.2,
    "p_atm": 101_325.0,
}
"""compressible fluid"""
STIFF = FLUID | {"beta": 1e12}
"""fluid whose compressibility is negligible"""
RIGID = FLUID | {"beta": 1e15}
"""fluid that does not compress measurably"""

PUMP = {
    "d_p": 6.5e-3,
    "e": 1e-3,
    "phase": math.pi / 2,
    "V_dead": 2e-8,
    "V_gas": 0.0,
    "tau": 5e-5,
    "G_back": 0.0,
    "p_max": 2.5e7,
    "suction.p_crack": 2e4,
    "suction.seat.d": 2.5e-3,
    "delivery.p_crack": 5e4,
    "delivery.seat.d": 1.2e-3,
    **{
        f"{valve}.seat.{name}": v
        for valve in ("suction", "delivery")
        for name, v in (("C_d", 0.65), ("Re_cr", 100.0))
    },
}
"""piston of a return pump, with its valves"""


def flat(groups: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the values of several groups by their full names."""
    return {f"{group}.{name}": v for group, values in groups.items() for name, v in values.items()}
