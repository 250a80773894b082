"""Cooling of released brakes between stops."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from bywire.core.typing import Array
from bywire.plant import disc_heat


def cooled(
    heat: disc_heat.State, law: disc_heat.Parameters, v: float, t: Array
) -> dict[str, Array]:
    """Return the temperatures [K] of a released brake by name, which start at ``heat``.

    No brake acts, so these are three temperatures over minutes. A high-order method with error
    control integrates the equations of the element, without substeps of 20 us.

    Parameters
    ----------
    v
        Vehicle speed [m/s].
    t
        Times [s], increasing from 0.
    """
    felt, capacities = disc_heat.Input(0.0, v, 0.0), np.array(disc_heat.mass(law))

    def rate(_: float, T: Array) -> Array:
        flows = np.array(disc_heat.balance(disc_heat.State(*T), felt, law))
        return np.asarray(flows / capacities)

    span = (0.0, float(t[-1]))
    solution = solve_ivp(rate, span, heat, "DOP853", t_eval=t, rtol=1e-10, atol=1e-8)
    return dict(zip(disc_heat.State._fields, solution.y, strict=True))
