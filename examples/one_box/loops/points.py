"""Operating points of the loops, and causes of their nonlinearity."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

from bywire.authoring import ParameterError, ParameterSet, Point, Quantity, zeros
from one_box.ecu import Stimulus
from one_box.model import OneBox
from one_box.parameters import DriveMode, OneBoxParameters
from one_box.trim import holding_current, memory_at, state_at

PRESSURE = Quantity("pressure", "Pa", 60e5)
CAUSES: Mapping[str, Mapping[str, Any]] = {
    "dry friction": {
        "seal.T_pr": 0.0,
        "seal.f_cfr_p": 0.0,
        "seal.f_cfr_n": 0.0,
        "gear.eta_g": 1.0,
    },
}
"""cause -> parameters that remove it; brakes and valves stay nonlinear"""


def point(par: ParameterSet, p: float, drive: DriveMode, step: float = 20e-6) -> Point:
    """Return the brake in equilibrium at a pressure [Pa].

    Raises
    ------
    ParameterError
        If the plunger is parked.
    """
    driven = cast(OneBoxParameters, par.replace({"drive": drive}))
    p_on = driven.ecu.pressure.p_on
    if not p > p_on:
        raise ParameterError(
            f"pressure = {p / 1e5:g} bar is not a valid operating point, because the ECU parks the "
            f"plunger up to ecu.pressure.p_on = {p_on / 1e5:g} bar. Use a higher pressure, such as "
            "'20 bar'"
        )
    state, memory = state_at(p, driven), memory_at(p, driven)
    held: Mapping[str, Mapping[str, float]] = {
        "pressure": {"p_set": p},
        "position": {"theta_set": memory.theta_ref},
        "current": {"i_set": holding_current(p, driven)},
    }
    stimulus = zeros(Stimulus)._replace(**held[drive])
    return Point(OneBox(), driven, state, memory, stimulus, step)
