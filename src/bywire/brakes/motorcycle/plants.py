"""The motorcycle brake's plant at an operating point, driven by current or voltage."""

from __future__ import annotations

from typing import Any, cast

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import linearize
from bywire.analysis.loop import Plant, PlantPoint, Quantity
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current, memory_at, state_at
from bywire.core.parameters import ParameterSet

_PRESSURE = Quantity("pressure", "Pa", 20e5)
_CURRENT = Quantity("current", "A", 2.0)
_AT = (_PRESSURE, _CURRENT)
"""operating points: pressure in both chambers, or holding current without friction"""


def linear(
    par: ParameterSet, at: PlantPoint, mode: str, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> LinearModel:
    """Return the exact plant with an ideal source instead of the ECU.

    ``par``, ``at``: parameters and operating point; ``mode``: value of ``drive.mode``; ``inputs``,
    ``outputs``: as in `linearize`.

    Raises
    ------
    ParameterError
        When the brake has no such operating point.
    """
    changes: dict[str, Any] = {"drive.mode": mode}
    driven = cast(MotorcycleParameters, par.replace(changes))
    # The holding current is proportional to the pressure.
    p = at.value / holding_current(1.0, driven) if at.quantity is _CURRENT else at.value
    at.quantity.require_positive(at.value)
    with at.named(unless=_PRESSURE):
        state = state_at(p, driven)._replace(omega=at.speed)
    whole = linearize(
        MotorcycleBrake(),
        driven,
        state,
        memory_at(p, driven),
        inputs=inputs,
        outputs=outputs,
        friction=at.friction,
    )
    return whole.reduced(whole.live)


def by_current(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the plant from motor current: eq. (14) of Dardanelli et al. (2010), plus the angle."""
    return linear(par, at, "current-source", ("i_source",), ("p_mc", "p_pd", "x_mc"))


def by_voltage(par: ParameterSet, at: PlantPoint) -> LinearModel:
    """Return the plant from motor voltage, including winding and back-EMF."""
    return linear(par, at, "voltage-source", ("v_source",), ("i", "p_mc", "p_pd", "x_mc"))


CURRENT = Plant(
    name="motorcycle-plant",
    assembly="motorcycle-brake",
    summary="motor current to pressures: gear, master cylinder, pipeline, caliper (eq. (14) of "
    "Dardanelli et al.)",
    at=_AT,
    model=by_current,
    band=50.0,
)
VOLTAGE = Plant(
    name="motorcycle-voltage",
    assembly="motorcycle-brake",
    summary="motor voltage to current and pressures: winding, gear, hydraulics",
    at=_AT,
    model=by_voltage,
    band=200.0,
)
