"""The motorcycle brake's plant at an operating point."""

from __future__ import annotations

from typing import Any, cast

from bywire.analysis.linear.linear_model import LinearModel
from bywire.analysis.linear.linearize import linearize
from bywire.analysis.linear.plant import PlantPoint
from bywire.analysis.loop import Quantity
from bywire.brakes.motorcycle.model import MotorcycleBrake
from bywire.brakes.motorcycle.parameters import MotorcycleParameters
from bywire.brakes.motorcycle.trim import holding_current, memory_at, state_at
from bywire.core.errors import ParameterError
from bywire.core.parameters import ParameterSet

PRESSURE = Quantity("pressure", "Pa", 20e5)
CURRENT = Quantity("current", "A", 2.0)
AT = (PRESSURE, CURRENT)
"""pressure in both chambers, motor current without friction"""


def linear(
    par: ParameterSet, at: PlantPoint, mode: str, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> LinearModel:
    """Return the exact plant with a source in place of the ECU.

    Parameters
    ----------
    par, at
        Parameters and operating point.
    mode
        Value of ``drive.mode``.
    inputs, outputs
        As in `linearize`.

    Raises
    ------
    ParameterError
        When the point does not exist.
    """
    changes: dict[str, Any] = {"drive.mode": mode}
    own = cast(MotorcycleParameters, par.replace(changes))
    # The holding current is proportional to the pressure.
    p = at.value / holding_current(1.0, own) if at.quantity is CURRENT else at.value
    if not p > 0.0:
        raise ParameterError(
            f"{at.quantity.name} = {at.value:g} {at.quantity.unit} is no operating point: it must "
            f"be > 0 {at.quantity.unit}"
        )
    try:
        state = state_at(p, own)._replace(omega=at.speed)
    except ParameterError as error:
        if at.quantity is PRESSURE:
            raise
        raise ParameterError(
            f"current = {at.value:g} A is no operating point: {error}"
        ) from None
    return linearize(
        MotorcycleBrake(), own, state, memory_at(p, own),
        inputs=inputs, outputs=outputs, friction=at.friction,
    )  # fmt: skip
