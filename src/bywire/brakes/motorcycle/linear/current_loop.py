"""The motorcycle brake's sampled current loop as a linear model."""

from __future__ import annotations

from typing import Literal

from bywire.analysis.linear.closed_loop import closed_loop
from bywire.analysis.linear.linear_model import LinearModel
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import memory_at, state_at

Rotor = Literal["locked", "free"]


def current_loop(par: MotorcycleParameters, p: float, rotor: Rotor) -> LinearModel:
    """Return the loop from the set point ``i_set`` to the currents ``i`` and ``i_meas``.

    PI at the ECU's sample time, battery and bridge, winding, anti-alias filter; the converter's
    resolution is left out.

    Parameters
    ----------
    par
        Parameters; the drive mode does not matter.
    p
        Pressure of the operating point [Pa].
    rotor
        ``"locked"``: no back-EMF, as where friction holds the shaft. ``"free"``: the shaft moves
        against the brake, without dry friction.
    """
    own = par.replace({"drive.mode": "current-direct", "adc.law": "ideal"})
    return closed_loop(
        MotorcycleBrake(), own, state_at(p, own), memory_at(p, own),
        inputs=("i_set",), outputs=("i", "i_meas"),
        locked=("theta", "omega", "p_mc", "p_pd", "y_p") if rotor == "locked" else (),
    )  # fmt: skip
