"""Brake fluids without air, and parameters by group, for the tests of hydraulic elements."""

from __future__ import annotations

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


def flat(groups: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the values of several groups by their full names."""
    return {f"{group}.{name}": v for group, values in groups.items() for name, v in values.items()}
