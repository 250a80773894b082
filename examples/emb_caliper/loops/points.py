"""Operating points of the loops, and causes of their nonlinearity."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

from bywire.authoring import ParameterError, ParameterSet, Point, Quantity, zeros
from emb_caliper.ecu import Stimulus
from emb_caliper.parameters import BrakeParameters, DriveMode
from emb_caliper.trim import brake_with, holding_current, holding_voltage, memory_at, state_at

FORCE = Quantity("clamp force", "N", 20e3)

CAUSES: Mapping[str, Mapping[str, Any]] = {
    "dry friction": {"friction.C": 0.0, "friction.G": 0.0, "friction.T_s": 0.0},
    "converter": {"adc.law": "ideal"},
}
"""cause -> parameters that remove it; the nonlinear stiffness cannot be removed"""


def point(par: ParameterSet, F: float, drive: DriveMode, step: float = 20e-6) -> Point:
    """Return the brake in equilibrium at a clamp force [N].

    Raises
    ------
    ParameterError
        If the pads do not touch.
    """
    driven = cast(BrakeParameters, par.replace({"drive": drive}))
    if driven.ecu.F_on > F:
        raise ParameterError(
            f"clamp force = {F:g} N is not a valid operating point, because the ECU parks the "
            f"piston below ecu.F_on = {driven.ecu.F_on:g} N. Use a higher force, such as '5 kN'"
        )
    state = state_at(F, driven)
    held = {
        "force": {"F_set": F},
        "speed": {},
        "current": {"i_set": holding_current(F, driven)},
        "voltage": {"v_set": holding_voltage(F, driven)},
    }[drive]
    stimulus = zeros(Stimulus)._replace(**held)
    return Point(brake_with(driven), driven, state, memory_at(F, driven), stimulus, step)
